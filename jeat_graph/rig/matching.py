"""Which track of one sensor is which of another's: RANSAC over pairs of trajectories.

Two pairs of trajectories that belong together tell an affine map of the one picture into the other, and what
is left of the clocks' difference; the map under which most vehicles have a partner is the right one (Fischler
and Bolles, Communications of the ACM 24, 1981). It is fitted again to all of these, as a homography.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.rig.clock_search import TrackPairs, offset_of, pairs_at
from jeat_graph.rig.homography import fit_homography
from jeat_graph.rig.sensor_tracks import STEP_S, SensorTracks

# Hypotheses that are drawn, and the times of a pair that one rests on.
_DRAWS, _TIMES = 600, 8
# A pair fits where its boxes' centres are apart by less than this share of their size, in the mean.
_FITS = 0.6
_FAR = 2.0
_LEAST_TIMES = 4
#: No clock is moved by more than this beside the shift that is tried (s).
MOST_DELTA_S = 0.6
_REFITS = 4
_AFFINE = 6


class MatchedTracks(NamedTuple):
    """Tracks of two sensors that are of the same vehicles.

    Attributes:
        a: (M,) tracks of the first.
        b: (M,) their partners of the second.
        way: from the second's picture to the first's.
        offset_s: what the second's clock is ahead (s).
        possible: tracks of each sensor that a partner could be found for, as the other looked there.
        wrong_map: most matches with other partners that a map had which is quite another.
    """

    a: IntArray
    b: IntArray
    way: PictureMap
    offset_s: float
    possible: int
    wrong_map: int = 0


class _Samples(NamedTuple):
    """Common times of pairs: which pair (K,), places (K, 2), velocity of the first (K, 2), size (K,)."""

    pair: IntArray
    a: FloatArray
    b: FloatArray
    velocity: FloatArray
    size: FloatArray


def match_at(first: SensorTracks, second: SensorTracks, shift: int, seed: int = 0) -> MatchedTracks | None:
    """Find the map at one rough difference of the clocks.

    Args:
        first: tracks of the sensor whose picture is the common one.
        second: of the other.
        shift: from steps of the first's grid to those of the second's.
        seed: of the draws.

    Returns:
        The best matches, or None where nothing fits.
    """
    pairs = pairs_at(first, second, shift)
    moving = first.moves[pairs.a].astype(bool) & second.moves[pairs.b].astype(bool)
    samples = _samples(first, second, pairs)
    if int(moving.sum()) < 2:
        return None
    best, affine, delta = _draw(pairs, samples, np.flatnonzero(moving), seed)
    if best < 2:
        return None
    matrix = np.zeros((3, 4))
    matrix[:2, :3], matrix[2, 2] = affine, 1.0
    try:
        way = PictureMap(matrix)
        for _ in range(_REFITS):
            rows, distance = _fitting(pairs, samples, way, delta)
            chosen = _one_to_one(pairs, distance, rows)
            if len(chosen) < 2:
                return None
            way, delta = _refit(samples, chosen, way, delta)
    except DataError:
        return None
    rows, distance = _fitting(pairs, samples, way, delta)
    chosen = _one_to_one(pairs, distance, rows)
    offset = offset_of(shift, first, second) - delta
    return MatchedTracks(pairs.a[chosen], pairs.b[chosen], way, offset, _possible(first, second, way, shift))


def match_again(first: SensorTracks, second: SensorTracks, found: MatchedTracks) -> MatchedTracks:
    """Match once more by a map and an offset that are known better."""
    exact = (found.offset_s - second.start_s + first.start_s) / STEP_S
    shift = round(exact)
    delta = (shift - exact) * STEP_S
    pairs = pairs_at(first, second, shift)
    samples = _samples(first, second, pairs)
    rows, distance = _fitting(pairs, samples, found.way, delta)
    chosen = _one_to_one(pairs, distance, rows)
    return found._replace(
        a=pairs.a[chosen], b=pairs.b[chosen], possible=_possible(first, second, found.way, shift)
    )


def _samples(first: SensorTracks, second: SensorTracks, pairs: TrackPairs) -> _Samples:
    i, j = pairs.a[pairs.pair], pairs.b[pairs.pair]
    velocity = np.gradient(first.centre, STEP_S, axis=1)
    v = velocity[i, pairs.step_a]
    good = np.isfinite(v).all(axis=1)
    i, j, v, pair = i[good], j[good], v[good], pairs.pair[good]
    at, there = pairs.step_a[good], pairs.step_b[good]
    return _Samples(
        pair,
        first.centre[i, at],
        second.centre[j, there],
        v,
        np.sqrt(first.size[i, at].prod(axis=1)),
    )


def _draw(pairs: TrackPairs, samples: _Samples, moving: IntArray, seed: int) -> tuple[int, FloatArray, float]:
    """Draw pairs of pairs, and return the most matches, their affine map (2, 3) and change of the clock."""
    rng = np.random.default_rng(seed)
    order = np.argsort(samples.pair, kind="stable")
    bounds = np.searchsorted(samples.pair[order], np.arange(len(pairs.a) + 1))
    best, affine, delta = 0, np.zeros((2, 3)), 0.0
    for _ in range(_DRAWS):
        p, q = rng.choice(moving, 2, replace=False)
        if pairs.a[p] == pairs.a[q] or pairs.b[p] == pairs.b[q]:
            continue
        rows = np.concatenate([_few(order[bounds[k] : bounds[k + 1]]) for k in (p, q)])
        if len(rows) < 2 * _LEAST_TIMES:
            continue
        found = _affine(samples, rows)
        if found is None:
            continue
        count = _count(pairs, samples, *found)
        if count > best:
            best, (affine, delta) = count, found
    return best, affine, delta


def _few(rows: IntArray) -> IntArray:
    if len(rows) <= _TIMES:
        return rows
    return np.asarray(rows[np.linspace(0, len(rows) - 1, _TIMES).round().astype(np.int64)])


def _affine(samples: _Samples, rows: IntArray) -> tuple[FloatArray, float] | None:
    """Solve a + v δ = M b for an affine M and δ, by least squares; None where that is no map."""
    a, b, v = samples.a[rows], samples.b[rows], samples.velocity[rows]
    n = len(rows)
    X = np.zeros((2 * n, _AFFINE + 1))
    shifted = np.column_stack([b, np.ones(n)])
    middle, spread = b.mean(axis=0), max(float(b.std()), 1.0)
    shifted[:, :2] = (b - middle) / spread
    X[:n, :3], X[n:, 3:6] = shifted, shifted
    X[:n, 6], X[n:, 6] = -v[:, 0], -v[:, 1]
    solved, _, rank, _ = np.linalg.lstsq(X, a.T.ravel(), rcond=1e-6)
    if rank < _AFFINE + 1 or abs(solved[6]) > MOST_DELTA_S:
        return None
    M = solved[:6].reshape(2, 3)
    moved = np.column_stack([M[:, :2] / spread, M[:, 2] - M[:, :2] @ middle / spread])
    return np.asarray(moved, dtype=np.float64), float(solved[6])


def _count(pairs: TrackPairs, samples: _Samples, affine: FloatArray, delta: float) -> int:
    there = samples.b @ affine[:, :2].T + affine[:, 2]
    distance = _mean_distance(pairs, samples, there, delta)
    good = distance < _FITS
    return min(len(np.unique(pairs.a[good])), len(np.unique(pairs.b[good])))


def _mean_distance(pairs: TrackPairs, samples: _Samples, there: FloatArray, delta: float) -> FloatArray:
    """Mean distance (P,) of each pair's boxes, in sizes; infinite where there are too few times."""
    apart = np.linalg.norm(samples.a + delta * samples.velocity - there, axis=1) / samples.size
    apart = np.minimum(np.where(np.isfinite(apart), apart, _FAR), _FAR)
    times = np.bincount(samples.pair, minlength=len(pairs.a))
    mean = np.bincount(samples.pair, apart, len(pairs.a)) / np.maximum(times, 1)
    return np.where(times >= _LEAST_TIMES, mean, np.inf)


def _fitting(
    pairs: TrackPairs, samples: _Samples, way: PictureMap, delta: float
) -> tuple[IntArray, FloatArray]:
    distance = _mean_distance(pairs, samples, way.points(samples.b), delta)
    return np.flatnonzero(distance < _FITS), distance


def _one_to_one(pairs: TrackPairs, distance: FloatArray, rows: IntArray) -> IntArray:
    """Choose pairs so that each track has one partner, and most of them the nearest."""
    if not len(rows):
        return rows
    a, i = np.unique(pairs.a[rows], return_inverse=True)
    b, j = np.unique(pairs.b[rows], return_inverse=True)
    cost = np.full((len(a), len(b)), 2.0 * _FITS)
    cost[i, j] = distance[rows]
    left, right = linear_sum_assignment(cost)
    number = np.full(cost.shape, -1)
    number[i, j] = rows
    chosen = number[left, right]
    return np.sort(chosen[chosen >= 0])


def _refit(samples: _Samples, chosen: IntArray, way: PictureMap, delta: float) -> tuple[PictureMap, float]:
    """Fit a homography, and what is left of the clock's difference, to the chosen pairs."""
    rows = np.isin(samples.pair, chosen)
    a, b, v, size = samples.a[rows], samples.b[rows], samples.velocity[rows], samples.size[rows]
    good = np.isfinite(way.points(b)).all(axis=1)
    a, b, v, size = a[good], b[good], v[good], size[good]
    way = fit_homography(b, a + delta * v, 1.0 / size)
    left = way.points(b) - a
    weight = 1.0 / np.maximum(size**2, 1.0)
    # Along the vehicles' motion, by the slowness that they have.
    seen = np.isfinite(left).all(axis=1)
    delta = float(
        ((left * v)[seen].sum(axis=1) * weight[seen]).sum()
        / max(((v**2)[seen].sum(axis=1) * weight[seen]).sum(), 1e-12)
    )
    return fit_homography(b, a + delta * v, 1.0 / size), delta


def _possible(first: SensorTracks, second: SensorTracks, way: PictureMap, shift: int) -> int:
    """How many of the second's moving tracks come, while the first records, to where the first sees any."""
    seen = first.centre[np.isfinite(first.centre[:, :, 0])]
    if not len(seen):
        return 0
    low, high = seen.min(axis=0), seen.max(axis=0)
    begin, end = max(0, shift), min(second.steps, first.steps + shift)
    there = way.points(second.centre[:, begin:end])
    with np.errstate(invalid="ignore"):
        inside = ((there > low) & (there < high)).all(axis=2)
    return int(((inside.sum(axis=1) * STEP_S >= 1.0) & second.moves.astype(bool)).sum())


def no_tracks() -> IntArray:
    """Return no numbers of tracks, of a map whose matches are still to be found."""
    return np.zeros(0, dtype=np.int64)
