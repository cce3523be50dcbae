"""Plots time per frame against the number of objects, both on logarithmic axes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jeat_graph.drawing.palette import LINES


def plot_speed(rows: Sequence[dict[str, Any]], path: str | Path) -> None:
    """Draw the medians, with a whisker up to the 99th percentile.

    Args:
        rows: records of `speed_timing.summarise`, with `objects`.
        path: PNG or SVG file.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import FuncFormatter

    from jeat_graph.io.files.atomic import atomic_path

    figure, axes = plt.subplots(figsize=(7.2, 4.6), dpi=130, layout="constrained")
    names = list(dict.fromkeys(row["tracker"] for row in rows))
    ends = []
    for k, name in enumerate(names):
        mine = sorted((r for r in rows if r["tracker"] == name), key=lambda r: int(r["objects"]))
        x = [r["objects"] for r in mine]
        y = [r["median_ms"] for r in mine]
        ours = name.startswith(("highway", "default", "paper"))
        colour = LINES[k % len(LINES)]
        # Beside each other, so that whiskers of lines close together can be told apart.
        shifted = [v * (0.94 + 0.12 * k / max(len(names) - 1, 1)) for v in x]
        axes.vlines(shifted, y, [r["p99_ms"] for r in mine], color=colour, alpha=0.5, linewidth=1.2)
        axes.plot(
            shifted, y, "o-" if ours else "s--", color=colour, linewidth=2 if ours else 1.4, markersize=4
        )
        ends.append((y[-1], shifted[-1], name, colour))
    axes.set_xscale("log")
    axes.set_yscale("log")
    # Names stand at the ends of their lines, pushed apart where lines end close together.
    lowest = 0.0
    for y_end, x_end, name, colour in sorted(ends):
        at = max(y_end, 1.45 * lowest)
        axes.annotate(
            name, (x_end, at), (8, 0), textcoords="offset points", va="center", color=colour, fontsize=9
        )
        lowest = at
    ticks = sorted({row["objects"] for row in rows})
    axes.set_xticks(ticks, [str(t) for t in ticks])
    axes.minorticks_off()
    axes.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    axes.set_xlabel("objects in the picture")
    axes.set_ylabel("time per frame (ms): median, whisker up to p99")
    axes.set_xlim(min(ticks) * 0.85, max(ticks) * 3.2)
    axes.grid(True, alpha=0.3)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    with atomic_path(path) as temporary:
        # Without the software's name and version in the file, the same numbers give the same bytes.
        figure.savefig(temporary, metadata={"Software": None} if Path(path).suffix == ".png" else None)
    plt.close(figure)
