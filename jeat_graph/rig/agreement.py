"""By how much two clocks differ whose sensors' boxes are in one picture: where boxes agree best.

For each difference of the clocks, boxes of the second sensor are compared with those that the first one has
at that time. What stands still agrees at all differences; what moves, at the right one.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections

# Scans of the second sensor that are compared, and boxes of one that are.
_SCANS, _LEAST_SCANS, _MOST_BOXES = 240, 60, 24
# Boxes agree where their centres are apart by less than this share of their size, sizes within this factor.
_REACH, _SAME_SIZE = 0.6, 2.0
# Differences that are tried (s): finely near none, coarsely elsewhere, and how far from none and from the
# difference of the starts where recordings are long.
STEP_S, _FINE_S, _FINE_STEP_S, _FARTHEST_S = 0.05, 1.0, 0.025, 90.0
_LEAST_OVERLAP_S = 8.0
_LEAST_BOXES = 30
# So many differences tell what agreement is usual; one is clearly right at so many times as much.
_FEW, _CLEAR, _LEAST_USUAL = 60, 3.0, 0.05
# A look at a scan of the first sensor counts for a difference that it is not farther from (s).
_NEAR_S = 0.6
# Scans that are looked at in one step.
_SCANS_A_STEP = 64


class Agreement(NamedTuple):
    """How boxes of two sensors agree.

    Attributes:
        offset_s: by how much the second's clock is ahead where they agree best.
        best: mean agreement there, from 0 to 1.
        at_zero: mean agreement as the times are; 0 where they do not overlap.
        usual: median over all differences.
    """

    offset_s: float
    best: float
    at_zero: float
    usual: float


class _SampledBoxes(NamedTuple):
    """Scans (S,) of one sensor, their boxes (S, P, 4) padded with NaN: x, y, ln size, size."""

    t: FloatArray
    boxes: FloatArray


def agreement_in_steps(
    first: Detections, second: Detections, pairs: int | None = None
) -> Generator[None, None, Agreement | None]:
    """Find at which difference of the clocks the boxes of two sensors agree best; one difference a step.

    Args:
        first: of the sensor whose clock is taken for right.
        second: of the other; both in one picture.
        pairs: so many pairs of boxes are compared in one step at most, by looking at fewer scans.

    Returns:
        The agreement; None where there is too little to compare.
    """
    if min(len(first), len(second)) < _LEAST_BOXES:
        return None
    ours = yield from _samples(first, None)
    scans = _SCANS
    if pairs is not None:
        wide = ours.boxes.shape[1] * min(int(np.diff(second.scan_start).max()), _MOST_BOXES)
        scans = min(scans, max(pairs // wide, _LEAST_SCANS))
    theirs = yield from _samples(second, scans)
    tried = _differences(ours.t, theirs.t)
    if not len(tried):
        return None
    near = tried[np.abs(tried) <= _FINE_S]
    few = tried[:: max(len(tried) // _FEW, 1)]
    for offsets in (np.union1d(near, few), tried):
        scores = np.zeros(len(offsets))
        for k, offset in enumerate(offsets.tolist()):
            scores[k] = _score(ours, theirs, offset)
            yield
        best, usual = int(scores.argmax()), float(np.median(scores))
        if abs(offsets[best]) < 0.5 * _FINE_S and scores[best] > _CLEAR * max(usual, _LEAST_USUAL):
            break  # they agree as they are, or nearly: the rest need not be tried
    zero = _score(ours, theirs, 0.0)
    if zero >= scores[best]:
        return Agreement(0.0, zero, zero, usual)
    return Agreement(float(offsets[best]), float(scores[best]), zero, usual)


def _differences(ours: FloatArray, theirs: FloatArray) -> FloatArray:
    """All differences (D,) of the second's clock at which both look at one time for a while."""
    least = min(_LEAST_OVERLAP_S, 0.5 * float(np.ptp(ours)), 0.5 * float(np.ptp(theirs)))
    low, high = theirs[0] - ours[-1] + least, theirs[-1] - ours[0] - least
    if not high > low:
        return np.zeros(0)
    start = float(theirs[0] - ours[0])
    parts = [np.arange(-_FINE_S, _FINE_S + 1e-9, _FINE_STEP_S)]
    for middle in (0.0, start):
        begin, end = max(low, middle - _FARTHEST_S), min(high, middle + _FARTHEST_S)
        parts.append(middle + STEP_S * np.arange(np.ceil((begin - middle) / STEP_S), (end - middle) / STEP_S))
    tried = np.unique(np.round(np.concatenate(parts), 6))
    return np.asarray(tried[(tried >= low) & (tried <= high)])


def _samples(detections: Detections, most: int | None) -> Generator[None, None, _SampledBoxes]:
    filled = np.flatnonzero(np.diff(detections.scan_start) > 0)
    if most is not None and len(filled) > most:
        filled = filled[np.linspace(0, len(filled) - 1, most).round().astype(int)]
    count = np.diff(detections.scan_start)[filled]
    width = int(min(count.max(initial=1), _MOST_BOXES))
    out = np.full((len(filled), width, 4), np.nan)
    for k, scan in enumerate(filled):
        first, end = detections.scan_start[scan], detections.scan_start[scan + 1]
        rows = np.arange(first, end)
        if len(rows) > width:
            rows = rows[np.argsort(-detections.scores[rows], kind="stable")[:width]]
        own = detections.boxes[rows]
        size = np.sqrt(own[:, 2] * own[:, 3])
        out[k, : len(rows)] = np.column_stack([own[:, :2] + 0.5 * own[:, 2:], np.log(size), size])
        if k % _SCANS_A_STEP == 0:
            yield
    return _SampledBoxes(detections.scan_t[filled], out)


def _score(ours: _SampledBoxes, theirs: _SampledBoxes, offset: float) -> float:
    """Mean agreement of the second's boxes at a difference of the clocks, where the first looks too."""
    wanted = theirs.t - offset
    after = np.clip(np.searchsorted(ours.t, wanted), 1, len(ours.t) - 1)
    nearest = np.where(wanted - ours.t[after - 1] < ours.t[after] - wanted, after - 1, after)
    sampled = np.abs(ours.t[nearest] - wanted) < _NEAR_S
    if not sampled.any():
        return 0.0
    a, b = ours.boxes[nearest[sampled]][:, None, :, :], theirs.boxes[sampled][:, :, None, :]
    apart = np.hypot(a[..., 0] - b[..., 0], a[..., 1] - b[..., 1]) / (
        _REACH * np.minimum(a[..., 3], b[..., 3])
    )
    same_size = np.abs(a[..., 2] - b[..., 2]) < np.log(_SAME_SIZE)
    match = np.where(same_size & (apart < 1.0), 1.0 - apart, 0.0).max(axis=2)
    there = np.isfinite(theirs.boxes[sampled][:, :, 0])
    return float(match[there].mean()) if there.any() else 0.0
