"""Puts the picture of a run together, the image plane above a timeline, and saves it as PNG and SVG."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jeat_graph.data.trajectories import Trajectories
from jeat_graph.drawing.palette import NIGHT, Theme
from jeat_graph.drawing.picture.plane import Backdrop, draw_plane
from jeat_graph.drawing.picture.timeline import draw_timeline

SUFFIXES = (".png", ".svg")


def save_pictures(
    table: Trajectories, backdrop: Backdrop, stem: str | Path, theme: Theme = NIGHT
) -> list[Path]:
    """Draw a run and save it as PNG and SVG; the same run gives the same bytes.

    Args:
        table: a trajectory table, rows in time order.
        backdrop: the picture's size and what else to draw.
        stem: path without a suffix.
        theme: colours.

    Returns:
        The files written.
    """
    import matplotlib as mpl

    from jeat_graph.io.files.atomic import atomic_path

    mpl.use("Agg")
    settings: Any = {"svg.hashsalt": "jeat-graph", "font.family": "DejaVu Sans"}
    out = []
    with mpl.rc_context(settings):
        figure = draw_run(table, backdrop, theme)
        for suffix in SUFFIXES:
            path = Path(f"{stem}{suffix}")
            metadata: dict[str, Any] = {"Software": None} if suffix == ".png" else {"Date": None}
            with atomic_path(path) as temporary:
                figure.savefig(temporary, dpi=130, facecolor=theme.paper, metadata=metadata)
            out.append(path)
    return out


def draw_run(table: Trajectories, backdrop: Backdrop, theme: Theme = NIGHT) -> Any:
    """Draw the image plane above a timeline and return the matplotlib figure."""
    from matplotlib.figure import Figure

    height = 11.6 * backdrop.height / backdrop.width
    figure = Figure(figsize=(12.0, height + 4.2), facecolor=theme.paper)
    total = height + 4.2
    plane = figure.add_axes((0.2 / 12, 3.6 / total, 11.6 / 12, height / total))
    times = figure.add_axes((0.2 / 12, 0.45 / total, 11.6 / 12, 2.6 / total))
    draw_plane(plane, table, backdrop, theme)
    draw_timeline(times, table, theme)
    top = (3.6 + height + 0.22) / total
    figure.text(0.2 / 12, top, backdrop.title, color=theme.ink, size=15, weight="bold", va="center")
    figure.text(11.8 / 12, top, backdrop.subtitle, color=theme.quiet, size=10.5, va="center", ha="right")
    _draw_legend(figure, table.sensors, theme, 3.3 / total)
    return figure


def _draw_legend(figure: Any, sensors: Sequence[str], theme: Theme, y: float) -> None:
    entries = [(theme.single[k % len(theme.single)], f"only {name}") for k, name in enumerate(sensors)]
    entries = [(theme.both, "several sensors"), *entries, (theme.coast, "predicted")]
    figure.text(0.2 / 12, y, "Which sensor saw each track", color=theme.ink, size=10.5, va="center")
    x = 3.0 / 12
    for colour, name in entries:
        figure.text(x, y, "■", color=colour, size=11, va="center")
        figure.text(x + 0.17 / 12, y, name, color=theme.quiet, size=9.5, va="center")
        x += (0.55 + 0.085 * len(name)) / 12
