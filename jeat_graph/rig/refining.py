"""Picture and clock to the pixel and the millisecond: one factor graph of all matched vehicles.

Unknowns are the map from the second picture to the first (8 numbers, 3 for parallax, and one for each lens
where lenses bend), the offset and the drift of the second clock, and the path of every matched vehicle in the
first picture, a white-jerk process. A box of the first sensor measures the path at its time; one of the
second, mapped, measures it at its time on the common clock. Each is linearised about what was found last, and
all are solved together by GTSAM (`smoothers.gtsam.shared_paths`), until nothing moves.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jeat_graph.config.fields import SMALLEST
from jeat_graph.config.sensors import ClockConfig
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.lens import RadialLens
from jeat_graph.data.picture_map import LENSES, ONE_IS_FIXED, PictureMap
from jeat_graph.filters.motion import process_noise, transition
from jeat_graph.rig.between_vehicles import LensEvidence, jackknife, lens_evidence
from jeat_graph.rig.common_picture import common_time
from jeat_graph.rig.matching import MatchedTracks
from jeat_graph.rig.sensor_tracks import SensorTracks, TrackMeasurements
from jeat_graph.smoothers.gtsam.shared_paths import PathRows, solve_paths

# Rounds of linearising, of those that only matches are chosen by; they end where nothing moves by more (px).
_ROUNDS, _ROUGH_ROUNDS, _ENOUGH_PX = 12, 5, 1e-2
# Steps of a path's states (s), and how far they reach beyond its first and last measurement (s).
_STEP_S, _BEYOND_S = 0.25, 0.4
# Root spectral density of the jerk: so many sizes (1/s^2.5), and so many with the 2.5th power of the growth.
_JERK, _JERK_PER_GROWTH = 1.0, 60.0
# Standard deviation of a centre in sizes, before the residuals say it, and Huber's bound on residuals.
_SIGMA, _LEAST_SIGMA, _HUBER = 0.04, 0.02, 2.0
# The states that GTSAM sees are in px and these units of time (s).
_TAU_S = 0.2
_CLOCK = 2
# Prior standard deviations. Of the affine part about the first map (1 and px): none to speak of. Of the
# perspective part about that of two lenses turned against each other by the angle that their pictures are
# shifted by: by half of it, as focal lengths are known to a quarter only, and in units of half a picture, as
# the axis of a lens need not go through the middle of its picture. Of the parallax about none, in units of
# the scale: half of the lenses' distance over their height above the road. Of the clock's offset about the
# first (s), of its drift about none (1e-6): two quartzes.
_PRIOR_LINEAR, _PRIOR_SHIFT_PX, _PRIOR_PERSPECTIVE, _PRIOR_TURN = 0.5, 300.0, 0.02, 0.5
_PRIOR_PARALLAX, _PRIOR_PARALLAX_DOWN, _PRIOR_PARALLAX_DEPTH = 0.1, 0.05, 0.015
# The prior gives way where the first map is so many standard deviations beside it.
_FAR_OFF = 0.2
_PRIOR_OFFSET_S, _PRIOR_DRIFT_PPM = 0.5, 30.0
# Radial distortion, with the picture's width as the focal length: wide lenses have -.1 to -.3.
_PRIOR_K1 = 0.2
_PPM = 1e-6
# First guesses of velocity and acceleration are uncertain by so many sizes a second, and a second squared.
_START = np.array([2.0, 20.0, 100.0])


class Refined(NamedTuple):
    """What the graph found.

    Attributes:
        way: the map from the second picture to the first, with covariance.
        clock: of the second sensor, with standard deviations.
        residual_px: (2,) rms of the measurements' residuals of each sensor, in the first picture (px).
        sizes_px: mean size of the boxes there (px).
        vehicles: number of paths.
        bends: whether the residuals say that a lens bends; None where the map has lenses.
    """

    way: PictureMap
    clock: ClockConfig
    residual_px: tuple[float, float]
    sizes_px: float
    vehicles: int
    bends: LensEvidence | None


class _Unknowns(NamedTuple):
    way: PictureMap
    offset_s: float
    drift_ppm: float
    at_s: float

    @property
    def clock(self) -> ClockConfig:
        return ClockConfig(
            offset_s=no_smaller(self.offset_s), drift_ppm=no_smaller(self.drift_ppm), at_s=self.at_s
        )

    @property
    def numbers(self) -> FloatArray:
        return np.append(self.way.numbers, [self.offset_s, self.drift_ppm])

    def moved(self, step: FloatArray) -> _Unknowns:
        offset, drift = step[-_CLOCK:]
        return self._replace(
            way=self.way.moved(step[:-_CLOCK]),
            offset_s=self.offset_s + float(offset),
            drift_ppm=self.drift_ppm + float(drift),
        )


class _Path(NamedTuple):
    """One vehicle: its measurements, the times (K,) of its states, and its states (K, 2, 3)."""

    ours: TrackMeasurements
    theirs: TrackMeasurements
    t: FloatArray
    states: FloatArray
    jerk: FloatArray


def refine(
    first: SensorTracks,
    second: SensorTracks,
    matched: MatchedTracks,
    sizes: tuple[tuple[float, float], tuple[float, float]],
    rough: bool = False,
) -> Refined:
    """Solve for map, clock and paths.

    Args:
        first: tracks of the sensor whose picture and clock are the common ones.
        second: of the other.
        matched: which belong together, and a first map and offset.
        sizes: width and height of both pictures (px).
        rough: a few rounds are enough, for vehicles will be matched again by the result.

    Raises:
        RuntimeError: GTSAM's, if the system is indeterminate.
        DataError: the map runs away.
    """
    theirs = [second.measured[b] for b in matched.b]
    at = float(np.median(np.concatenate([one.t for one in theirs])))
    unknowns = _Unknowns(matched.way, matched.offset_s, 0.0, at)
    pairs = [(first.measured[a], second.measured[b]) for a, b in zip(matched.a, matched.b, strict=True)]
    paths = [_path(ours, other, unknowns.clock) for ours, other in pairs]
    sigma = (_SIGMA, _SIGMA)
    centre, scale = _prior(unknowns, *sizes)
    round_number, rounds = 0, _ROUGH_ROUNDS if rough else _ROUNDS
    while True:
        round_number += 1
        rows, residuals = zip(*(_rows(path, unknowns, sigma, scale) for path in paths), strict=True)
        shift = (unknowns.numbers - centre) / scale
        solved = solve_paths(rows, np.eye(len(scale)), -shift)
        unknowns = unknowns.moved(scale * solved.shared)
        paths = [
            path._replace(states=_unscaled(states)) for path, states in zip(paths, solved.states, strict=True)
        ]
        sigma = (_robust([part for one in residuals for part in one]),) * 2
        if round_number == rounds or _largest_move(unknowns.way, scale * solved.shared, paths) < _ENOUGH_PX:
            return _result(unknowns, scale, paths, sigma, sizes)


def no_smaller(value: float) -> float:
    """Return a number, 0 where it is nearer to it than a setting may be."""
    return value if abs(value) > SMALLEST else 0.0


def _prior(
    first: _Unknowns, common: tuple[float, float], own: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Means (m,) and standard deviations (m,) of the unknowns before any vehicle is seen."""
    half = 0.5 * max(own)
    matrix = first.way.matrix
    gain = float(np.sqrt(abs(np.linalg.det(matrix[:2, :2]))))
    centre, std = np.zeros((3, 4)), np.ones((3, 4))
    centre[:2, :3] = matrix[:2, :3]
    std[:2, :2], std[:2, 2] = _PRIOR_LINEAR * gain, _PRIOR_SHIFT_PX
    std[:2, 3] = gain * _PRIOR_PARALLAX, gain * _PRIOR_PARALLAX_DOWN
    # Of a lens of usual width (53° across) the focal length is as long as the picture is wide.
    focal = max(own)
    shift = first.way.points(0.5 * np.array(own)) - 0.5 * np.array(common)
    turned = -shift / (gain * focal**2)
    centre[2, :2] = turned
    std[2, :2] = np.hypot(_PRIOR_PERSPECTIVE / half, _PRIOR_TURN * np.abs(turned))
    # Cameras that are far apart are no such pair: then the first map says more than this.
    std[2, :2] = np.maximum(std[2, :2], _FAR_OFF * np.abs(matrix[2, :2] - turned))
    std[2, 3] = _PRIOR_PARALLAX_DEPTH / half
    lenses = first.way.free - len(ONE_IS_FIXED)
    ends = (
        [*np.zeros(lenses), first.offset_s, 0.0],
        [*np.full(lenses, _PRIOR_K1), _PRIOR_OFFSET_S, _PRIOR_DRIFT_PPM],
    )
    return np.append(centre.ravel()[ONE_IS_FIXED], ends[0]), np.append(std.ravel()[ONE_IS_FIXED], ends[1])


def _path(ours: TrackMeasurements, theirs: TrackMeasurements, clock: ClockConfig) -> _Path:
    """Lay the times of a path's states, and guess the states from its own sensor."""
    times = np.concatenate([ours.t, common_time(theirs.t, clock)])
    begin, end = times.min() - _BEYOND_S, times.max() + _BEYOND_S
    t = np.linspace(begin, end, max(int(np.ceil((end - begin) / _STEP_S)), 2) + 1)
    size = np.sqrt(ours.size.prod(axis=1))
    growth = 0.0
    if len(ours.t) > 2:
        growth = float(np.polyfit(ours.t - ours.t.mean(), np.log(size), 1)[0])
    at = np.interp(t, ours.t, size)
    # Beyond the measurements sizes go on growing.
    at *= np.exp(growth * (np.minimum(t - ours.t[0], 0.0) + np.maximum(t - ours.t[-1], 0.0)))
    jerk = at * (_JERK + _JERK_PER_GROWTH * abs(growth) ** 2.5)
    states = np.zeros((len(t), 2, 3))
    degree = min(3, len(ours.t) - 1)
    middle = ours.t.mean()
    for axis in range(2):
        fit = np.polynomial.Polynomial.fit(ours.t - middle, ours.centre[:, axis], degree)
        for k in range(3):
            states[:, axis, k] = (fit.deriv(k) if k else fit)(t - middle)
    return _Path(ours, theirs, t, states, np.asarray(np.sqrt(0.5 * (jerk[1:] ** 2 + jerk[:-1] ** 2))))


def _rows(
    path: _Path, unknowns: _Unknowns, sigma: tuple[float, ...], scale: FloatArray
) -> tuple[PathRows, tuple[FloatArray, FloatArray]]:
    """Linearise a path's factors about its states and the unknowns; also its residuals in sizes."""
    clock, way = unknowns.clock, unknowns.way
    size = np.sqrt(path.ours.size.prod(axis=1))
    mine = _measured(path, path.ours.t, path.ours.centre)
    when = common_time(path.theirs.t, clock)
    there = way.points(path.theirs.centre, path.theirs.size[:, 1])
    other = _measured(path, when, there)
    m = len(scale)
    J = np.zeros((len(when), 2, m))
    J[:, :, :-_CLOCK] = way.jacobian(path.theirs.centre, path.theirs.size[:, 1])
    J[:, :, -2] = other.velocity
    J[:, :, -1] = _PPM * (path.theirs.t - unknowns.at_s)[:, None] * other.velocity
    J *= scale
    good = np.isfinite(there).all(axis=1)
    there_size = np.sqrt(way.boxes(_boxes(path.theirs))[0][:, 2:].prod(axis=1))
    good &= np.isfinite(there_size)
    left = (mine.residual / size[:, None], other.residual[good] / there_size[good, None])
    weights = [
        _weight(one, s) / (s * n) for one, s, n in zip(left, sigma, (size, there_size[good]), strict=True)
    ]
    weight = np.concatenate(weights)[:, None]
    # The state that explains a measurement z: basis · x = z; of the second sensor J s + z - basis · x = 0.
    before = np.concatenate([mine.before, other.before[good]]) * weight[:, :, None]
    after = np.concatenate([mine.after, other.after[good]]) * weight[:, :, None]
    shared = np.concatenate([np.zeros((len(size), 2, m)), -J[good]]) * weight[:, :, None]
    right = np.concatenate([path.ours.centre, there[good]]) * weight
    motion0, motion1 = _motion(path)
    start = np.kron(np.eye(2), np.diag(1.0 / (_START * size.mean()))) @ _units()
    return (
        PathRows(
            motion0,
            motion1,
            np.zeros((len(path.t) - 1, 6)),
            np.concatenate([mine.state, other.state[good]]),
            before,
            after,
            shared,
            right,
            start,
            start @ np.linalg.inv(_units()) @ path.states[0].ravel(),
        ),
        left,
    )


class _AtTimes(NamedTuple):
    state: IntArray
    before: FloatArray
    after: FloatArray
    velocity: FloatArray
    residual: FloatArray


def _measured(path: _Path, t: FloatArray, z: FloatArray) -> _AtTimes:
    """Rows that give places at times (R,) from the states before and after, scaled; residuals there."""
    state = np.clip(np.searchsorted(path.t, t) - 1, 0, len(path.t) - 2).astype(np.int64)
    span = path.t[state + 1] - path.t[state]
    s = (t - path.t[state]) / span
    place, speed = _quintic(s), _quintic_slope(s)
    powers = span[:, None] ** np.array([0, 1, 2, 0, 1, 2])
    basis, slope = place * powers, speed * powers / span[:, None]
    both = np.concatenate([path.states[state], path.states[state + 1]], axis=2)
    at, velocity = np.einsum("rk,rak->ra", basis, both), np.einsum("rk,rak->ra", slope, both)
    tau = _TAU_S ** -np.array([0.0, 1.0, 2.0])
    before, after = np.zeros((len(t), 2, 6)), np.zeros((len(t), 2, 6))
    for axis in range(2):
        before[:, axis, 3 * axis : 3 * axis + 3] = basis[:, :3] * tau
        after[:, axis, 3 * axis : 3 * axis + 3] = basis[:, 3:] * tau
    return _AtTimes(state, before, after, velocity, z - at)


def _quintic(s: FloatArray) -> FloatArray:
    """Weights (R, 6) of place, velocity and acceleration at both ends: the mean of a white-jerk process."""
    s3, s4, s5 = s**3, s**4, s**5
    return np.stack(
        [
            1 - 10 * s3 + 15 * s4 - 6 * s5,
            s - 6 * s3 + 8 * s4 - 3 * s5,
            0.5 * s**2 - 1.5 * s3 + 1.5 * s4 - 0.5 * s5,
            10 * s3 - 15 * s4 + 6 * s5,
            -4 * s3 + 7 * s4 - 3 * s5,
            0.5 * s3 - s4 + 0.5 * s5,
        ],
        axis=1,
    )


def _quintic_slope(s: FloatArray) -> FloatArray:
    s2, s3, s4 = s**2, s**3, s**4
    return np.stack(
        [
            -30 * s2 + 60 * s3 - 30 * s4,
            1 - 18 * s2 + 32 * s3 - 15 * s4,
            s - 4.5 * s2 + 6 * s3 - 2.5 * s4,
            30 * s2 - 60 * s3 + 30 * s4,
            -12 * s2 + 28 * s3 - 15 * s4,
            1.5 * s2 - 4 * s3 + 2.5 * s4,
        ],
        axis=1,
    )


def _motion(path: _Path) -> tuple[FloatArray, FloatArray]:
    """Whitened rows of the white-jerk process between neighbouring states, scaled."""
    span = float(path.t[1] - path.t[0])
    F, Q = transition(span), process_noise(span, 1.0)
    W = np.linalg.inv(np.linalg.cholesky(Q))
    tau = np.diag(_TAU_S ** -np.array([0.0, 1.0, 2.0]))
    first, second = np.kron(np.eye(2), -W @ F @ tau), np.kron(np.eye(2), W @ tau)
    weight = 1.0 / path.jerk[:, None, None]
    return weight * first, weight * second


def _units() -> FloatArray:
    """From the scaled states to px and s (6, 6)."""
    return np.asarray(np.kron(np.eye(2), np.diag(_TAU_S ** -np.array([0.0, 1.0, 2.0]))), dtype=np.float64)


def _unscaled(states: FloatArray) -> FloatArray:
    return np.asarray((states @ _units().T).reshape(len(states), 2, 3))


def _boxes(measured: TrackMeasurements) -> FloatArray:
    return np.concatenate([measured.centre - 0.5 * measured.size, measured.size], axis=1)


def _weight(residual: FloatArray, sigma: float) -> FloatArray:
    """Huber's weights (R,), as factors on rows, of residuals (R, 2) in sizes."""
    far = np.linalg.norm(residual, axis=1) / sigma
    return np.asarray(np.sqrt(np.minimum(1.0, _HUBER / np.maximum(far, 1e-9))))


def _robust(residuals: list[FloatArray]) -> float:
    """Standard deviation of both sensors' residuals by their median.

    One number: of two, that of the sensor which a path follows closer would fall, and fall.
    """
    found = 1.4826 * float(np.median(np.abs(np.concatenate(residuals))))
    return max(found, _LEAST_SIGMA)


def _largest_move(way: PictureMap, step: FloatArray, paths: list[_Path]) -> float:
    """By how much a step of the unknowns moves the mapped measurements at most (px)."""
    centre = np.concatenate([path.theirs.centre for path in paths])
    height = np.concatenate([path.theirs.size[:, 1] for path in paths])
    moved = way.jacobian(centre, height) @ step[:-_CLOCK]
    return float(np.nanmax(np.abs(moved)))


def _result(
    unknowns: _Unknowns,
    scale: FloatArray,
    paths: list[_Path],
    sigma: tuple[float, ...],
    sizes: tuple[tuple[float, float], tuple[float, float]],
) -> Refined:
    """Covariances from the scatter between vehicles, as the errors of one have memory."""
    rows, residuals = zip(*(_rows(path, unknowns, sigma, scale) for path in paths), strict=True)
    last = solve_paths(rows, np.eye(len(scale)), np.zeros(len(scale)))
    cov = jackknife(last) * np.outer(scale, scale)
    size = [np.sqrt(path.ours.size.prod(axis=1)) for path in paths]
    other = [np.sqrt(unknowns.way.boxes(_boxes(path.theirs))[0][:, 2:].prod(axis=1)) for path in paths]
    rms = []
    for k, own in enumerate((size, other)):
        px = [
            np.abs(one[k]) * np.nan_to_num(s[np.isfinite(s)])[: len(one[k]), None]
            for one, s in zip(residuals, own, strict=True)
        ]
        rms.append(float(np.sqrt(np.mean(np.concatenate(px) ** 2))))
    free = unknowns.way.free
    clock = ClockConfig(
        offset_s=no_smaller(unknowns.offset_s),
        drift_ppm=no_smaller(unknowns.drift_ppm),
        at_s=unknowns.at_s,
        offset_std_s=no_smaller(float(np.sqrt(cov[free, free]))),
        drift_std_ppm=no_smaller(float(np.sqrt(cov[free + 1, free + 1]))),
    )
    way = replace(unknowns.way, covariance=cov[:free, :free])
    return Refined(
        way,
        clock,
        (rms[0], rms[1]),
        float(np.mean(np.concatenate(size))),
        len(paths),
        None if way.lenses is not None else _lens_evidence(unknowns, paths, sigma, sizes),
    )


def _lens_evidence(
    unknowns: _Unknowns,
    paths: list[_Path],
    sigma: tuple[float, ...],
    sizes: tuple[tuple[float, float], tuple[float, float]],
) -> LensEvidence:
    """Test whether the lenses bend, about the best map between lenses that do not."""
    bending = unknowns._replace(way=with_lenses(unknowns.way, sizes))
    _, scale = _prior(bending, *sizes)
    rows = [_rows(path, bending, sigma, scale)[0] for path in paths]
    solved = solve_paths(rows, np.eye(len(scale)), np.zeros(len(scale)))
    return lens_evidence(solved, slice(-_CLOCK - LENSES, -_CLOCK))


def with_lenses(way: PictureMap, sizes: tuple[tuple[float, float], tuple[float, float]]) -> PictureMap:
    """Give a map lenses that may bend but do not yet; `sizes` are those of the common and the own picture."""
    lenses = RadialLens.of_picture(0.0, sizes[1]), RadialLens.of_picture(0.0, sizes[0])
    return replace(way, lenses=lenses)
