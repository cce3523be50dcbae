"""By how much two clocks differ, roughly, where neither the pictures nor the times are known.

The same vehicle grows and shrinks in the same way in both pictures: the logarithms of its sizes differ by one
number, the same for all vehicles (the ratio of the lenses), at the right difference of the clocks and at no
other. So each difference is tried, and judged by how many vehicles of one sensor have a partner of the
other's whose size goes along with theirs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.rig.sensor_tracks import STEP_S, SensorTracks

# Sizes are compared at every so many steps, at least and at most: the usual track at so many times. At every
# .4 s, vehicles that are seen for 1 to 2 s would have too few times in common.
_LEAST_STRIDE, _MOST_STRIDE, _USUAL_TIMES = 2, 4, 8
# Differences of clocks are tried at every so many steps.
_OFFSET_STEPS = 2
# A pair is compared at so many times at least, and goes along where the difference of its logarithms varies
# by no more than this.
_LEAST_TIMES, _GOES_ALONG = 4, 0.13
# All pairs have one difference, but for detectors' errors of size.
_ONE_RATIO, _RATIO_BIN = 0.2, 0.1
#: Recordings that overlap for less say nothing (s).
LEAST_OVERLAP_S = 8.0
# Differences that are nearer to a better one are no others (s).
_APART_S = 0.45


class TrackPairs(NamedTuple):
    """TrackPairs of tracks whose sizes go along, at one difference of the clocks.

    Attributes:
        a: (P,) track of the first sensor.
        b: (P,) track of the second.
        pair: (K,) to which pair each common time belongs.
        step_a: (K,) the step of the first's grid.
        step_b: (K,) that of the second's.
        log_ratio: (P,) mean difference of the logarithms of the sizes.
    """

    a: IntArray
    b: IntArray
    pair: IntArray
    step_a: IntArray
    step_b: IntArray
    log_ratio: FloatArray


class _Sizes(NamedTuple):
    """What is compared of both sensors.

    Attributes:
        logs: (N, T) logarithms of the sizes at each step.
        there: (T, P) which tracks are there at each step.
        stride: steps from one comparison to the next.
    """

    logs: tuple[FloatArray, FloatArray]
    there: tuple[IntArray, IntArray]
    stride: int


class OffsetCandidate(NamedTuple):
    """A difference of the clocks that may be the right one.

    Attributes:
        shift: what leads from a step of the first's grid to one of the second's.
        score: share of what both could see together that goes along.
    """

    shift: int
    score: float


def offset_of(shift: float, first: SensorTracks, second: SensorTracks) -> float:
    """Return what the second's clock is ahead of the first's (s), for a shift of their grids."""
    return second.start_s - first.start_s + STEP_S * shift


def rank_offsets(first: SensorTracks, second: SensorTracks, count: int) -> list[OffsetCandidate]:
    """Try all differences of the clocks, and return the best ones, the best first."""
    least = round(LEAST_OVERLAP_S / STEP_S)
    shifts = np.arange(least - first.steps, second.steps - least + 1, _OFFSET_STEPS)
    sizes = _sizes(first, second)
    found = [OffsetCandidate(int(shift), _score(sizes, int(shift))) for shift in shifts]
    found.sort(key=lambda one: -one.score)
    kept: list[OffsetCandidate] = []
    for one in found:
        if all(abs(one.shift - other.shift) * STEP_S > _APART_S for other in kept):
            kept.append(one)
        if len(kept) == count:
            break
    return kept


def pairs_at(first: SensorTracks, second: SensorTracks, shift: int) -> TrackPairs:
    """Return the pairs whose sizes go along at a shift, all with about one ratio."""
    code, difference, step_a = _compared(_sizes(first, second), shift)
    number = len(second)
    codes, inverse = np.unique(code, return_inverse=True)
    good, mean = _along(inverse, difference, len(codes))
    centre = _usual(mean[good])
    good &= np.abs(mean - centre) < _ONE_RATIO
    chosen = np.flatnonzero(good)
    place = np.full(len(codes), -1)
    place[chosen] = np.arange(len(chosen))
    rows = place[inverse] >= 0
    return TrackPairs(
        codes[chosen] // max(number, 1),
        codes[chosen] % max(number, 1),
        place[inverse][rows],
        step_a[rows],
        step_a[rows] + shift,
        mean[chosen],
    )


def _sizes(first: SensorTracks, second: SensorTracks) -> _Sizes:
    both = first, second
    usual = min(
        (
            float(np.median(np.isfinite(one.centre[one.moves.astype(bool), :, 0]).sum(axis=1)))
            for one in both
            if one.moves.any()
        ),
        default=0.0,
    )
    stride = int(np.clip(usual // _USUAL_TIMES, _LEAST_STRIDE, _MOST_STRIDE))
    return _Sizes((_log_size(first), _log_size(second)), (first.present(), second.present()), stride)


def _log_size(tracks: SensorTracks) -> FloatArray:
    with np.errstate(invalid="ignore"):
        return np.asarray(0.5 * np.log(tracks.size.prod(axis=2)))


def _compared(sizes: _Sizes, shift: int) -> tuple[IntArray, FloatArray, IntArray]:
    """Every pair of tracks at every common time: its code (K,), their difference, step of the first."""
    logs, there = sizes.logs, sizes.there
    begin = max(0, -shift)
    end = min(logs[0].shape[1], logs[1].shape[1] - shift)
    steps = np.arange(begin, max(end, begin), sizes.stride)
    a, b = there[0][steps][:, :, None], there[1][steps + shift][:, None, :]
    both = (a >= 0) & (b >= 0)
    when, i, j = np.nonzero(both)
    a, b = a[when, i, 0], b[when, 0, j]
    step = steps[when]
    return a * logs[1].shape[0] + b, logs[0][a, step] - logs[1][b, step + shift], step


def _along(inverse: IntArray, difference: FloatArray, count: int) -> tuple[BoolArray, FloatArray]:
    """Whether the sizes of pairs go along (P,), and the mean differences of their logarithms (P,)."""
    times = np.bincount(inverse, minlength=count)
    mean = np.bincount(inverse, difference, count) / np.maximum(times, 1)
    square = np.bincount(inverse, difference**2, count) / np.maximum(times, 1)
    spread = np.sqrt(np.maximum(square - mean**2, 0.0))
    return (times >= _LEAST_TIMES) & (spread < _GOES_ALONG), mean


def _usual(values: FloatArray) -> float:
    """The value around which most lie."""
    if not len(values):
        return 0.0
    low = float(values.min())
    count = np.bincount(((values - low) / _RATIO_BIN).astype(int))
    wide = np.convolve(count, [1, 2, 1], mode="same")
    middle = low + _RATIO_BIN * (float(wide.argmax()) + 0.5)
    near = values[np.abs(values - middle) < 2.0 * _RATIO_BIN]
    return float(np.median(near)) if len(near) else middle


def _score(sizes: _Sizes, shift: int) -> float:
    code, difference, _ = _compared(sizes, shift)
    if not len(code):
        return 0.0
    codes, inverse = np.unique(code, return_inverse=True)
    good, mean = _along(inverse, difference, len(codes))
    if not good.any():
        return 0.0
    good &= np.abs(mean - _usual(mean[good])) < _ONE_RATIO
    times = np.bincount(inverse)
    number = len(sizes.logs[1])
    shares = []
    for whose in (codes // number, codes % number):
        best = np.zeros(int(whose.max()) + 1)
        np.maximum.at(best, whose, np.where(good, times, 0))
        most = np.zeros_like(best)
        np.maximum.at(most, whose, times)
        shares.append(best.sum() / max(float(most[most >= _LEAST_TIMES].sum()), 1.0))
    # A short overlap, with few vehicles, reaches any share by chance.
    return float(min(shares) * (1.0 - np.exp(-good.sum() / 30.0)))
