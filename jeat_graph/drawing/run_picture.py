"""A picture of a run: the tracks in the image plane, and which sensor saw each of them when."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.trajectories import Trajectories

SUFFIXES = (".png", ".svg")
_TRAIL_S = 3.0  # length of the bright part of a trail
_RECENT_S = 0.1  # a track whose last row is older than this before the shown instant is not there any more
_STILL = 0.35  # a track that never moved further than this part of its box stands
_STILL_MIN_S = 2.0
_MOST_ROWS = 160  # of the timeline
_BINS = 900  # of the timeline, over the length of the run
_LABEL_PX = 30.0  # boxes less high than this are far away and crowded: no number
_GOLDEN = 0.61803398875


@dataclass(frozen=True)
class Theme:
    """Colours of a picture."""

    paper: str
    picture: str
    ink: str
    quiet: str
    road: str
    lightness: float
    missed: str
    both: str
    single: tuple[str, ...]
    coast: str


NIGHT = Theme(
    paper="#0d1117",
    picture="#06080c",
    ink="#d7dde5",
    quiet="#7d8794",
    road="#2b3440",
    lightness=0.66,
    missed="#ff6b6b",
    both="#ffd166",
    single=("#4cc9f0", "#f78fb3", "#9ef01a", "#c77dff"),
    coast="#3a4453",
)
DAY = Theme(
    paper="#fbfaf7",
    picture="#f1efe9",
    ink="#2a2f36",
    quiet="#737b85",
    road="#cfcbc0",
    lightness=0.42,
    missed="#d62828",
    both="#e09f00",
    single=("#0077b6", "#c2185b", "#4c8c0a", "#7b2cbf"),
    coast="#cfd3d8",
)


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

    from jeat_graph.io.atomic import atomic_path

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
    _draw_plane(plane, table, backdrop, theme)
    _draw_timeline(times, table, theme)
    top = (3.6 + height + 0.22) / total
    figure.text(0.2 / 12, top, backdrop.title, color=theme.ink, size=15, weight="bold", va="center")
    figure.text(11.8 / 12, top, backdrop.subtitle, color=theme.quiet, size=10.5, va="center", ha="right")
    _draw_legend(figure, table.sensors, theme, 3.3 / total)
    return figure


def standing_tracks(table: Trajectories) -> set[int]:
    """Tracks of at least two seconds whose centre never moved further than a part of their box."""
    out = set()
    for rows in _rows_by_track(table):
        if table.t[rows[-1]] - table.t[rows[0]] < _STILL_MIN_S:
            continue
        # The median box: a single jump of a young track does not make a parked vehicle drive.
        spread = np.quantile(table.mean[rows, :2], (0.02, 0.98), axis=0)
        size = np.sqrt(np.median(table.boxes[rows, 2]) * np.median(table.boxes[rows, 3]))
        if np.linalg.norm(spread[1] - spread[0]) < _STILL * size:
            out.add(int(table.track_id[rows[0]]))
    return out


def _rows_by_track(table: Trajectories) -> list[IntArray]:
    order = np.lexsort((table.t, table.track_id))
    cuts = np.flatnonzero(np.diff(table.track_id[order])) + 1
    return [part for part in np.split(order, cuts) if len(part)]


def _track_colour(track_id: int, lightness: float) -> tuple[float, float, float]:
    """Neighbouring identities get hues far apart (multiples of the golden ratio); red is kept for errors."""
    return colorsys.hls_to_rgb(0.07 + 0.84 * (track_id * _GOLDEN % 1.0), lightness, 0.82)


def _draw_plane(axes: Any, table: Trajectories, backdrop: Backdrop, theme: Theme) -> None:
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
    for rows in _rows_by_track(table):
        track_id = int(table.track_id[rows[0]])
        colour = _track_colour(track_id, theme.lightness)
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


def _draw_timeline(axes: Any, table: Trajectories, theme: Theme) -> None:
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
    groups = sorted(_rows_by_track(table), key=lambda rows: (table.t[rows[0]], table.track_id[rows[0]]))
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
    column = ((table.t[rows] - start) / bin_s).astype(np.int64)
    alive = np.zeros(_BINS + 1, dtype=bool)
    alive[column[0] : column[-1] + 1] = True
    reach = max(1, round(0.05 / bin_s))
    seen = [
        _dilate(np.bincount(column, table.used[rows] >> k & 1, _BINS + 1) > 0, reach) for k in _bits(table)
    ]
    count = np.sum(seen, axis=0, dtype=np.int64) if seen else np.zeros(_BINS + 1, dtype=np.int64)
    out = np.zeros((_BINS + 1, 4))
    out[alive] = _rgba(theme.coast)
    for k, here in enumerate(seen):
        out[alive & here] = _rgba(theme.single[k % len(theme.single)])
    out[alive & (count > 1)] = _rgba(theme.both)
    return out


def _dilate(mask: BoolArray, reach: int) -> BoolArray:
    return np.convolve(mask, np.ones(2 * reach + 1), mode="same") > 0.5


def _bits(table: Trajectories) -> range:
    return range(len(table.sensors))


def _rgba(colour: str) -> tuple[float, float, float, float]:
    from matplotlib.colors import to_rgba

    return to_rgba(colour)


def _draw_legend(figure: Any, sensors: Sequence[str], theme: Theme, y: float) -> None:
    entries = [(theme.single[k % len(theme.single)], f"only {name}") for k, name in enumerate(sensors)]
    entries = [(theme.both, "several sensors"), *entries, (theme.coast, "predicted")]
    figure.text(0.2 / 12, y, "Which sensor saw each track", color=theme.ink, size=10.5, va="center")
    x = 3.0 / 12
    for colour, name in entries:
        figure.text(x, y, "■", color=colour, size=11, va="center")
        figure.text(x + 0.17 / 12, y, name, color=theme.quiet, size=9.5, va="center")
        x += (0.55 + 0.085 * len(name)) / 12
