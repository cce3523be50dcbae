"""Draws the tracks of a run into the image plane: their trails, and boxes at the last instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.drawing.palette import Theme, track_shade
from jeat_graph.runs.recorded import rows_of_tracks

_TRAIL_S = 3.0  # length of the bright part of a trail
_RECENT_S = 0.1  # a track whose last row is older than this before the shown instant is not there any more
_STILL = 0.35  # a track that never moved further than this part of its box stands
_STILL_MIN_S = 2.0
_LABEL_PX = 30.0  # boxes less high than this are far away and crowded: no number


@dataclass(frozen=True, eq=False)
class Backdrop:
    """What is known beside the tracks.

    Attributes:
        width: width of the picture (px).
        height: height of the picture (px).
        lines: polylines (K, 2) drawn behind the tracks (px), such as the road's markings.
        missed: (M, 4) true boxes that no track lies on at the last instant (px).
        false: tracks that lie on no true box at the last instant.
        title: one line above the picture.
        subtitle: a smaller line beside it.
    """

    width: float
    height: float
    lines: Sequence[FloatArray] = ()
    missed: FloatArray | None = None
    false: frozenset[int] = frozenset()
    title: str = ""
    subtitle: str = ""


def standing_tracks(table: Trajectories) -> set[int]:
    """Tracks of at least two seconds whose centre never moved further than a part of their box."""
    out = set()
    for track_id, rows in rows_of_tracks(table.track_id, table.t).items():
        if table.t[rows[-1]] - table.t[rows[0]] < _STILL_MIN_S:
            continue
        # The median box: a single jump of a young track does not make a parked vehicle drive.
        spread = np.quantile(table.mean[rows, :2], (0.02, 0.98), axis=0)
        size = np.sqrt(np.median(table.boxes[rows, 2]) * np.median(table.boxes[rows, 3]))
        if np.linalg.norm(spread[1] - spread[0]) < _STILL * size:
            out.add(track_id)
    return out


def draw_plane(axes: Any, table: Trajectories, backdrop: Backdrop, theme: Theme) -> None:
    """Draw trails, boxes and what is known beside the tracks into matplotlib axes."""
    from matplotlib.collections import LineCollection

    axes.set(xlim=(0, backdrop.width), ylim=(backdrop.height, 0), xticks=[], yticks=[])
    axes.set_facecolor(theme.picture)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.add_collection(LineCollection(list(backdrop.lines), colors=theme.road, linewidths=1.1, zorder=0))
    if not len(table):
        middle = (0.5 * backdrop.width, 0.5 * backdrop.height)
        axes.text(*middle, "no tracks", color=theme.quiet, size=18, ha="center", va="center")
        return
    end = float(table.t[-1])
    standing = standing_tracks(table)
    for track_id, rows in rows_of_tracks(table.track_id, table.t).items():
        colour = track_shade(track_id, theme.lightness)
        _draw_trail(axes, table.t[rows], table.mean[rows, :2], colour, end)
        if end - table.t[rows[-1]] <= _RECENT_S:
            kind = "false" if track_id in backdrop.false else "parked" if track_id in standing else ""
            _draw_box(axes, table.boxes[rows[-1]], f"{track_id} {kind}".strip(), colour, theme)
    note = "dashed: parked" + ("" if backdrop.missed is None else " · red: false · red, dotted: missed")
    axes.text(0.012, 0.018, note, color=theme.quiet, size=9, transform=axes.transAxes)
    for left, top, width, height in [] if backdrop.missed is None else backdrop.missed:
        _rectangle(
            axes, (left, top, width, height), edgecolor=theme.missed, linestyle=(0, (1, 1.5)), zorder=3
        )


def _draw_trail(
    axes: Any, t: FloatArray, centre: FloatArray, colour: tuple[float, float, float], end: float
) -> None:
    """Draw the way of a track: faint as a whole, brighter towards the last instant."""
    from matplotlib.collections import LineCollection

    # 40 points a second are a smooth line; 100 only make the file larger.
    keep = np.unique(np.floor((t - t[0]) * 40.0), return_index=True)[1]
    keep = np.union1d(keep, [len(t) - 1])
    t, centre = t[keep], np.round(centre[keep], 1)
    axes.plot(*centre.T, color=colour, alpha=0.13, linewidth=0.9, zorder=1, rasterized=True)
    near = t >= end - _TRAIL_S
    if near.sum() < 2:
        return
    t, centre = t[near], centre[near]
    fresh = np.clip(1.0 - (end - t[1:]) / _TRAIL_S, 0.0, 1.0) ** 1.6
    colours = np.column_stack([np.tile(colour, (len(fresh), 1)), 0.05 + 0.85 * fresh])
    segments = np.stack([centre[:-1], centre[1:]], axis=1)
    axes.add_collection(
        LineCollection(list(segments), colors=colours, linewidths=0.8 + 1.6 * fresh, zorder=2)
    )


def _draw_box(
    axes: Any, box: FloatArray, text: str, colour: tuple[float, float, float], theme: Theme
) -> None:
    left, top, width, height = (float(v) for v in box)
    line: Any = (0, (3.5, 1.8)) if text.endswith("parked") else "solid"
    edge = theme.missed if text.endswith("false") else (*colour, 1.0)
    _rectangle(axes, (left, top, width, height), facecolor=(*colour, 0.13), linewidth=0.0, zorder=3)
    _rectangle(axes, (left, top, width, height), edgecolor=edge, linestyle=line, linewidth=1.6, zorder=4)
    if height >= _LABEL_PX or text.endswith("parked"):
        place = {"color": theme.ink, "size": 7.5, "zorder": 5, "clip_on": True}
        axes.text(left + 0.5 * width, top - 4.0, text, ha="center", va="bottom", **place)


def _rectangle(axes: Any, box: tuple[float, float, float, float], **style: Any) -> None:
    from matplotlib.patches import Rectangle

    style.setdefault("facecolor", "none")
    axes.add_patch(Rectangle(box[:2], box[2], box[3], **style))
