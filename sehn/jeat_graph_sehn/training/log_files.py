"""The log of a training: a table, and a plot of what it cost and how good it became."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.tables.table_writer import write_columns
from jeat_graph_sehn.training.trainer import LogRow

_SIZE_IN = (8.0, 4.0)


def write_log(rows: Sequence[LogRow], path: Path) -> None:
    """Write the table (CSV): one row each time that was judged, columns as in `LogRow`."""
    write_columns({name: np.array([getattr(row, name) for row in rows]) for name in LogRow._fields}, path)


def draw_log(rows: Sequence[LogRow], path: Path) -> None:
    """Draw loss and average precision over the steps (PNG)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, layout="constrained")
    FigureCanvasAgg(figure)
    cost, good = figure.subplots(1, 2)
    steps = [row.step for row in rows]
    for name, label in (("loss", "all"), ("loss_scores", "scores"), ("loss_boxes", "boxes (1 - GIoU)")):
        cost.plot(steps, [getattr(row, name) for row in rows], label=label)
    cost.set_ylabel("loss")
    cost.legend()
    good.plot(steps, [row.ap50 for row in rows], label="AP50")
    good.plot(steps, [row.ap for row in rows], label="AP50:95")
    good.set_ylabel("average precision (%)")
    good.set_ylim(0.0, 100.0)
    good.legend()
    for axis in (cost, good):
        axis.set_xlabel("step")
        axis.grid(alpha=0.3)
    with atomic_path(path) as temporary:
        figure.savefig(temporary)
