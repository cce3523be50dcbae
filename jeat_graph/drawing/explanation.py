"""A plot of why a track was taken for what it is: its log odds over time, and the terms that make them up."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.io.files.atomic import atomic_path

if TYPE_CHECKING:
    from jeat_graph.data.identity_links import IdentityLinks
    from jeat_graph.runs.explaining import TrackMoment

# Terms that stay nearer to 0 than this are left out of the plot.
_LEAST_TERM = 0.05


def plot_explanation(
    moments: Sequence[TrackMoment], title: str, path: Path, links: IdentityLinks | None = None
) -> None:
    """Draw the log odds of a track above their terms, and save them; the same moments give the same bytes.

    Args:
        moments: of one track, at least one.
        title: above the plot.
        path: PNG, SVG or PDF.
        links: what the smoother joined to one identity: each gap is shaded, with its probability.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib.figure import Figure

    t = [one.t for one in moments]
    figure = Figure(figsize=(10.0, 6.5), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 3))
    above.plot(t, [one.log_odds for one in moments], color="black", label="log odds of being real")
    above.axhline(0.0, color="grey", linewidth=0.8)
    low, high = above.get_ylim()
    shown = [one.reported for one in moments]
    above.fill_between(t, low, high, where=shown, step="mid", alpha=0.15, color="green", label="reported")
    if links is not None:
        _shade(above, links.between_tracks(), high)
    above.set_ylim(low, high)
    above.set_ylabel("log odds")
    above.set_title(title)
    above.legend(loc="best", fontsize=8)
    for name in moments[0].terms | moments[-1].terms:
        values = [one.terms.get(name, 0.0) for one in moments]
        if max(map(abs, values)) > _LEAST_TERM:
            below.plot(t, values, label=name)
    below.axhline(0.0, color="grey", linewidth=0.8)
    below.set_ylabel("terms")
    below.set_xlabel("t (s)")
    below.legend(loc="best", fontsize=8)
    settings: Any = {"svg.hashsalt": "jeat-graph"}
    metadata = {".png": {"Software": None}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    with mpl.rc_context(settings), atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=120, metadata=metadata.get(path.suffix.lower()))


def _shade(axes: Any, links: IdentityLinks, top: float) -> None:
    """Shade the gaps over which causal tracks were joined."""
    for k in range(len(links.tail)):
        first, last = float(links.t_tail[k]), float(links.t_head[k])
        axes.axvspan(first, last, color="orange", alpha=0.3, label="joined over a gap" if k == 0 else None)
        text = f"{links.tail[k]} to {links.head[k]}: {links.probability[k]:.2f}"
        axes.annotate(text, ((first + last) / 2.0, top), ha="center", va="top", fontsize=7, rotation=90)
