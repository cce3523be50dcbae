"""Draws one row a track over time; the colour says which sensors saw it."""

from __future__ import annotations

from typing import Any

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.drawing.palette import Theme
from jeat_graph.runs.recorded import rows_of_tracks

_MOST_ROWS = 160  # of the timeline
_BINS = 900  # of the timeline, over the length of the run


def draw_timeline(axes: Any, table: Trajectories, theme: Theme) -> None:
    """One row a track, in the order of their births; the colour says which sensors saw it."""
    axes.set_facecolor(theme.paper)
    for name, spine in axes.spines.items():
        spine.set_visible(name == "bottom")
        spine.set_color(theme.road)
    axes.tick_params(colors=theme.quiet, labelsize=9, length=3)
    axes.set_yticks([])
    axes.set_xlabel("time (s)", color=theme.quiet, size=9.5, labelpad=2)
    if not len(table):
        return
    start, end = float(table.t[0]), float(table.t[-1])
    bin_s = max(end - start, 1e-9) / _BINS
    tracks = rows_of_tracks(table.track_id, table.t).values()
    groups = sorted(tracks, key=lambda rows: (table.t[rows[0]], table.track_id[rows[0]]))
    if len(groups) > _MOST_ROWS:
        shortest = sorted((len(rows) for rows in groups), reverse=True)[_MOST_ROWS - 1]
        groups = [rows for rows in groups if len(rows) >= shortest][:_MOST_ROWS]
    image = np.zeros((len(groups), _BINS + 1, 4))
    for row, rows in enumerate(groups):
        image[row] = _timeline_row(table, rows, start, bin_s, theme)
    axes.imshow(image, aspect="auto", interpolation="nearest", extent=(start, end, len(groups), 0))


def _timeline_row(
    table: Trajectories, rows: IntArray, start: float, bin_s: float, theme: Theme
) -> FloatArray:
    """Colours (bins, 4) of one track: what saw it within the tenth of a second around each bin."""
    from matplotlib.colors import to_rgba

    column = ((table.t[rows] - start) / bin_s).astype(np.int64)
    alive = np.zeros(_BINS + 1, dtype=bool)
    alive[column[0] : column[-1] + 1] = True
    reach = max(1, round(0.05 / bin_s))
    seen = [
        _dilate(np.bincount(column, table.used[rows] >> k & 1, _BINS + 1) > 0, reach)
        for k in range(len(table.sensors))
    ]
    count = np.sum(seen, axis=0, dtype=np.int64) if seen else np.zeros(_BINS + 1, dtype=np.int64)
    out = np.zeros((_BINS + 1, 4))
    out[alive] = to_rgba(theme.coast)
    for k, here in enumerate(seen):
        out[alive & here] = to_rgba(theme.single[k % len(theme.single)])
    out[alive & (count > 1)] = to_rgba(theme.both)
    return out


def _dilate(mask: BoolArray, reach: int) -> BoolArray:
    return np.convolve(mask, np.ones(2 * reach + 1), mode="same") > 0.5
