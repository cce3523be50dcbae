"""Drawings of the road's page as SVG: the road from above, ways over time, speeds by lane."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.lanes import Lanes
from jeat_graph.road.results import RoadResult

_WIDTH, _PLAN_HEIGHT, _TIME_HEIGHT = 960, 300, 420
_LEFT, _RIGHT, _TOP, _BOTTOM = 56, 10, 12, 34
_BUDGET = 24_000  # points of all lines of a drawing
_MOST_POINTS, _LEAST_POINTS = 80, 4
_MARGIN_M = 2.0
_BIN_KMH = (1, 2, 5, 10, 20)
_BINS = 28
_BAR_WIDTH, _BAR_HEIGHT = 440, 150


class _Axis(NamedTuple):
    """A straight map of values to picture units."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        share = (value - self.low) / max(self.high - self.low, 1e-9)
        return round(self.start + share * (self.end - self.start), 1)


def plan_svg(result: RoadResult) -> str:
    """The road from above, stretched across: every vehicle's way, coloured by lane, with the lanes' edges."""
    ways = _ways(result)
    if not ways:
        return ""
    places = np.concatenate([xy for _, _, xy in ways])
    along = _axis(places[:, 1], _LEFT, _WIDTH - _RIGHT, 0.0)
    across = _axis(places[:, 0], _PLAN_HEIGHT - _BOTTOM, _TOP, _MARGIN_M)
    parts = [
        _frame(_PLAN_HEIGHT),
        *_grid(along, True, _PLAN_HEIGHT, "along the road (m)"),
        *_grid(across, False, _PLAN_HEIGHT, "across (m)"),
    ]
    for k in range(len(result.lanes.names)):
        for edge in (result.lanes.left[k], result.lanes.right[k]):
            if across.low <= edge <= across.high:
                parts.append(_line("edge", along.start, across(edge), along.end, across(edge)))
    for lane, _, xy in ways:
        points = [(along(y), across(x)) for x, y in xy.tolist()]
        parts.append(_path(points, _colour(result.lanes, lane)))
    for k, name in enumerate(result.lanes.names):
        if across.low <= result.lanes.middle[k] <= across.high:
            at = across(float(result.lanes.middle[k]))
            parts.append(f'<text class="lane" x="{along.end - 4}" y="{at + 4}">lane {escape(name)}</text>')
    label = f"The road from above with the ways of {len(ways)} vehicles; the tables have the same in numbers."
    return _svg(parts, _PLAN_HEIGHT, label)


def time_space_svg(result: RoadResult) -> str:
    """Place along the road over time: steep is fast, level is standing, lines that meet are too close."""
    ways = _ways(result)
    if not ways:
        return ""
    t = np.concatenate([times for _, times, _ in ways])
    y = np.concatenate([xy[:, 1] for _, _, xy in ways])
    time = _axis(t, _LEFT, _WIDTH - _RIGHT, 0.0)
    along = _axis(y, _TIME_HEIGHT - _BOTTOM, _TOP, 0.0)
    parts = [
        _frame(_TIME_HEIGHT),
        *_grid(time, True, _TIME_HEIGHT, "time (s)"),
        *_grid(along, False, _TIME_HEIGHT, "along the road (m)"),
    ]
    for lane, times, xy in ways:
        points = [(time(a), along(b)) for a, b in zip(times.tolist(), xy[:, 1].tolist(), strict=True)]
        parts.append(_path(points, _colour(result.lanes, lane)))
    return _svg(parts, _TIME_HEIGHT, f"Place along the road over time of {len(ways)} vehicles.")


def histogram_svg(kmh: FloatArray, span: tuple[float, float], colour: str, label: str) -> str:
    """Speeds of one lane: bars, the mean as a line and the 85th percentile dashed.

    Args:
        kmh: (N,) speeds (km/h).
        span: first and last speed of the axis, the same for all lanes.
        colour: of the bars.
        label: what it is, for those who cannot see it.
    """
    width = next((w for w in _BIN_KMH if (span[1] - span[0]) / w <= _BINS), _BIN_KMH[-1])
    low = width * np.floor(span[0] / width)
    edges = low + width * np.arange(int(np.ceil((span[1] - low) / width)) + 1)
    if len(edges) < 2:
        edges = np.array([low, low + width])
    counts = np.histogram(kmh, edges)[0]
    speed = _Axis(float(edges[0]), float(edges[-1]), 34.0, _BAR_WIDTH - 18.0)
    height = _Axis(0.0, max(float(counts.max(initial=0)), 1.0), _BAR_HEIGHT - 30.0, 8.0)
    parts = []
    for k, count in enumerate(counts.tolist()):
        if count:
            left, right, top = speed(float(edges[k])), speed(float(edges[k + 1])), height(count)
            shape = f'x="{left}" y="{top}" width="{max(right - left - 1, 1):.1f}"'
            low, high = edges[k], edges[k + 1]
            title = f"<title>{low:g} to {high:g} km/h: {count}</title>"
            parts.append(f'<rect fill="{colour}" {shape} height="{height.start - top:.1f}">{title}</rect>')
    for value in (0.0, height.high):
        at = height(value)
        parts.append(f'<text class="tick end" x="30" y="{at + 4}">{value:g}</text>')
    for value in round_ticks(speed.low, speed.high, 6):
        parts.append(f'<text class="tick mid" x="{speed(value)}" y="{_BAR_HEIGHT - 14}">{value:g}</text>')
    base = height.start
    parts.append(_line("axis", speed.start, base, speed.end, base))
    for value, kind in ((float(kmh.mean()), "mean"), (float(np.percentile(kmh, 85.0)), "p85")):
        parts.append(_line(kind, speed(value), height.end, speed(value), base))
    parts.append(f'<text class="tick mid" x="{_BAR_WIDTH / 2}" y="{_BAR_HEIGHT - 1}">km/h</text>')
    inner = "".join(parts)
    return (
        f'<svg class="bars" role="img" viewBox="0 0 {_BAR_WIDTH} {_BAR_HEIGHT}" '
        f'aria-label="{escape(label)}">{inner}</svg>'
    )


def lane_colour(lanes: Lanes, name: str) -> str:
    """Colour of a lane on the page; grey for a vehicle in none."""
    return _colour(lanes, name)


def _colour(lanes: Lanes, name: str) -> str:
    return f"var(--s{lanes.names.index(name) % 6})" if name in lanes.names else "var(--quiet)"


def _ways(result: RoadResult) -> list[tuple[str, FloatArray, FloatArray]]:
    """Lane, times and places of each vehicle while its fit is believed, with few points."""
    most = int(np.clip(_BUDGET // max(len(result.vehicles), 1), _LEAST_POINTS, _MOST_POINTS))
    out = []
    for vehicle, lane in zip(result.vehicles, result.lane_names, strict=True):
        start, end = vehicle.fit.window()
        t = np.linspace(start, end, most)
        out.append((lane, t, vehicle.fit.at(t)))
    return out


def _axis(values: FloatArray, start: float, end: float, margin: float) -> _Axis:
    low, high = np.percentile(values, [0.5, 99.5]).tolist() if margin else (values.min(), values.max())
    return _Axis(float(low) - margin, float(high) + margin, start, end)


def round_ticks(low: float, high: float, most: int) -> list[float]:
    """Return round numbers between two, about `most` of them at most."""
    span = max(high - low, 1e-9)
    step = 10.0 ** np.floor(np.log10(span / most))
    step *= next(m for m in (1.0, 2.0, 5.0, 10.0) if span / (step * m) <= most)
    first = np.ceil(low / step)
    return [float(step * k) for k in np.arange(first, np.floor(high / step) + 1)]


def _grid(axis: _Axis, across: bool, height: int, name: str) -> list[str]:
    out = []
    for value in round_ticks(axis.low, axis.high, 8 if across else 6):
        at = axis(value)
        if across:
            out.append(_line("grid", at, _TOP, at, height - _BOTTOM))
            out.append(f'<text class="tick mid" x="{at}" y="{height - _BOTTOM + 14}">{value:g}</text>')
        else:
            out.append(_line("grid", _LEFT, at, _WIDTH - _RIGHT, at))
            out.append(f'<text class="tick end" x="{_LEFT - 6}" y="{at + 4}">{value:g}</text>')
    if across:
        out.append(f'<text class="tick mid" x="{_WIDTH / 2}" y="{height - 4}">{name}</text>')
    else:
        middle = height / 2
        out.append(
            f'<text class="tick mid" x="12" y="{middle}" transform="rotate(-90 12 {middle})">{name}</text>'
        )
    return out


def _frame(height: int) -> str:
    size = f'width="{_WIDTH - _LEFT - _RIGHT}" height="{height - _TOP - _BOTTOM}"'
    return f'<rect class="plane" x="{_LEFT}" y="{_TOP}" {size}/>'


def _line(kind: str, x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<line class="{kind}" x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}"/>'


def _path(points: Sequence[tuple[float, float]], colour: str) -> str:
    steps = "L".join(f"{x:g} {y:g}" for x, y in points)
    return f'<path class="way" stroke="{colour}" d="M{steps}"/>'


def _svg(parts: Sequence[str], height: int, label: str) -> str:
    body = "\n".join(parts)
    return (
        f'<svg class="road" role="img" viewBox="0 0 {_WIDTH} {height}" '
        f'aria-label="{escape(label)}">\n{body}\n</svg>'
    )
