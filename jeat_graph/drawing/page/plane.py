"""Draws the map of the page: every track on the picture plane, as SVG."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.drawing.page.thinning import spread
from jeat_graph.drawing.palette import track_hue
from jeat_graph.runs.recorded import RunData, rows_of_tracks

_BUDGET = 40_000  # points of all lines of one kind
_LEAST_POINTS, _MOST_POINTS = 8, 400
_BREAK_S = 0.5  # rows further apart are not joined


def map_svg(data: RunData) -> str:
    """Draw all tracks: causal thin, smoothed thick and pale beneath."""
    width, height = data.size_px()
    causal, smoothed = _paths(data.causal), _paths(data.smoothed)
    groups = []
    for track_id in data.track_ids().tolist():
        lines = "".join(
            f'<path class="{kind}" d="{paths[track_id]}"/>'
            for kind, paths in (("late", smoothed), ("now", causal))
            if track_id in paths
        )
        groups.append(
            f'<g class="track" data-id="{track_id}" style="--h:{round(360.0 * track_hue(track_id))}">'
            f"<title>track {track_id}</title>{lines}</g>"
        )
    label = (
        f"Map of the picture plane, {width:g} by {height:g} pixels, with the ways of {len(groups)} tracks; "
        "the list of tracks below has the same in numbers."
    )
    return (
        f'<svg id="map" class="map" role="img" viewBox="0 0 {width:g} {height:g}" aria-label="{label}">\n'
        f'<rect class="plane" width="{width:g}" height="{height:g}"/>\n' + "\n".join(groups) + "\n"
        '<circle id="dot" class="dot" r="0"/></svg>\n'
    )


def _paths(table: Trajectories | None) -> dict[int, str]:
    if table is None:
        return {}
    parts = rows_of_tracks(table.track_id, table.t)
    most = int(np.clip(_BUDGET // max(len(parts), 1), _LEAST_POINTS, _MOST_POINTS))
    out = {}
    for track_id, rows in parts.items():
        keep = rows[spread(len(rows), most)]
        out[track_id] = _path(table.t[keep], table.mean[keep, :2], _break_s(table.t[rows], table.t[keep]))
    return out


def _break_s(t: FloatArray, kept: FloatArray) -> float:
    """Gap (s) at which a line is broken: half a second, or what thinning alone has made."""
    usual = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    factor = len(t) / max(len(kept), 1)
    return max(_BREAK_S, 3.0 * usual * factor)


def _path(t: FloatArray, centre: FloatArray, break_s: float) -> str:
    """Steps of an SVG path; each after the first is relative, in tenths of a pixel, which is shorter."""
    points = np.rint(10.0 * centre).astype(np.int64)
    gaps = np.diff(t) > break_s
    out = [f"M{_tenths(points[0, 0])} {_tenths(points[0, 1])}"]
    for (dx, dy), gap in zip(np.diff(points, axis=0).tolist(), gaps.tolist(), strict=True):
        out.append(f"{'m' if gap else 'l'}{_tenths(dx)} {_tenths(dy)}")
    if len(points) == 1:
        out.append("h.1")
    return "".join(out)


def _tenths(value: int) -> str:
    whole, part = divmod(abs(int(value)), 10)
    text = f"{whole}.{part}" if part else f"{whole}"
    return f"-{text}" if value < 0 else text
