"""Places and speeds on the road a fixed lag behind, while vehicles drive by: better than causal, soon enough.

Each vehicle has a window of states and its size (`road_factors`), solved by GTSAM whenever some new boxes
have come. States that leave it are final; what the boxes about them said stays as a factor on the first state
left and the size, linear from then on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.core import road as core
from jeat_graph.data.arrays import FloatArray, RecordArray
from jeat_graph.road.box_errors import BoxRows
from jeat_graph.road.box_rows import BoxConfig, rows_of_log
from jeat_graph.road.box_solver import size_step
from jeat_graph.road.boxes_road import BOX_MOTION
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.chain_rows import SIZES
from jeat_graph.road.cuboid_fit import CuboidConfig, begin, fit_begun
from jeat_graph.road.fleet import sizes_allowed
from jeat_graph.road.motion_fit import MotionFitConfig
from jeat_graph.road.road_factors import (
    Drive,
    coefficients_of,
    factors,
    first_state,
    jerk_of,
    trial_at,
    with_sensors,
)
from jeat_graph.road.road_state import ROAD_ROW
from jeat_graph.smoothers.gtsam.shared_chain import (
    ChainRows,
    PriorRows,
    SharedChain,
    known_of_last,
    solve_shared_chain,
)

_ANY_SIZE_M = 100.0
_SAME_S = 1e-6  # two sensors with scans so closely together share a state
# Of a state of the graph, in the order of the causal filter's: x, its speed, y, its speed and acceleration.
_AS_CAUSAL = np.array([0, 1, 3, 4, 5])


@dataclass(frozen=True)
class RoadLagConfig:
    """How far behind, and how often."""

    lag_s: float = number(1.0, "s", "how far behind the newest box a state is final", open_low=True)
    key_s: float = number(0.25, "s", "distance of the states", open_low=True)
    chunk_s: float = number(0.5, "s", "time between two solutions", open_low=True)
    steps: int = number(2, "steps", "Gauss-Newton steps of each", 1)
    silence_s: float = number(2.0, "s", "a track without a box for longer has ended", open_low=True)
    begin_s: float = number(10.0, "s", "of its boxes a track begins with the newest so long", open_low=True)

    def __post_init__(self) -> None:
        check(self)


@dataclass(eq=False)
class _Window:
    """States of one vehicle that are not final yet.

    Attributes:
        rows: boxes since the first of them.
        keys: (K,) their times (s).
        coefficients: (2, 3 K) as `KeyMotion` has them.
        size: (3,) length, width, height (m).
        priors: what is known of the first state and the size by what came before.
        belief: mean (3,) and covariance (3, 3) of sizes of vehicles of its kind.
        solution: the last one, and the rows that it solves.
        dropped: states that have left since.
    """

    rows: BoxRows
    keys: FloatArray
    coefficients: FloatArray
    size: FloatArray
    priors: list[PriorRows]
    belief: tuple[FloatArray, FloatArray]
    solution: tuple[SharedChain, ChainRows] | None = None
    dropped: int = 0


@dataclass(eq=False)
class _Track:
    """One track: what waits to be taken in, the time of its last box (s), its window once it has begun."""

    waiting: list[RecordArray]
    last_t: float
    window: _Window | None = None


class RoadFixedLag:
    """All vehicles' windows; feed it what each step of a tracker gave to its tracks.

    Args:
        camera: the camera.
        config: how far behind, and how often.
        motion: how vehicles move.
    """

    def __init__(
        self,
        camera: RoadCamera,
        config: RoadLagConfig = RoadLagConfig(),
        motion: MotionFitConfig = BOX_MOTION,
    ) -> None:
        self._camera, self._kernel = camera, camera.compiled()
        self._sensors = 0  # those that have given boxes so far
        self._config, self._motion = config, motion
        self._tracks: dict[int, _Track] = {}
        self._pending: list[RecordArray] = []
        self._next = -math.inf

    def step(self, t: float, rows: RecordArray) -> RecordArray:
        """Take in one step.

        Args:
            t: time of the step (s).
            rows: (M,) what the step gave to the tracks (`filters.measurement.MEASUREMENT`).

        Returns:
            (K,) records of `road_state.ROAD_ROW` that are final now, by track and time.
        """
        if len(rows):
            self._pending.append(rows.copy())
        if t < self._next:
            return np.empty(0, dtype=ROAD_ROW)
        self._next = t + self._config.chunk_s
        return self._advance(t)

    def finish(self) -> RecordArray:
        """Return all that is not final yet, (K,) records, and forget the vehicles."""
        return self._advance(math.inf)

    def held(self) -> set[int]:
        """Return the identities of the tracks of which rows may still come."""
        return set(self._tracks).union(*(part["track_id"].tolist() for part in self._pending))

    def _advance(self, t: float) -> RecordArray:
        if self._pending:
            log = np.concatenate(self._pending)
            self._pending = []
            self._sensors = max(self._sensors, int(log["sensor"].max()) + 1)
            log = log[np.lexsort((log["t"], log["track_id"]))]
            for part in np.split(log, np.flatnonzero(np.diff(log["track_id"])) + 1):
                track = self._tracks.setdefault(int(part["track_id"][0]), _Track([], 0.0))
                track.waiting.append(part)
                track.last_t = float(part["t"][-1])
        found = [np.empty(0, dtype=ROAD_ROW)]
        for identity, track in list(self._tracks.items()):
            ended = t - track.last_t > self._config.silence_s
            seen = not track.waiting or self._grow(track)
            if seen and track.window is not None:
                until = math.inf if ended else t - self._config.lag_s
                found.append(_leave(identity, track.window, until))
            if ended or not seen:
                del self._tracks[identity]
        return np.concatenate(found)

    def _grow(self, track: _Track) -> bool:
        """Take in what has come, and solve; False where the vehicle is not before the camera any more."""
        log = np.concatenate(track.waiting)
        rows = rows_of_log(log, self._sensors, (self._camera.width, self._camera.height), BoxConfig())
        if track.window is None:
            track.window = self._begun(rows)
            if track.window is None:
                # What never makes a vehicle, such as a false box in the sky, must not be kept for ever.
                track.waiting = [log[log["t"] > log["t"][-1] - self._config.begin_s]]
                return True
            track.waiting = []
            return self._solve(track.window)
        track.waiting, window = [], track.window
        # What another sensor saw at the time of the last state needs no state of its own.
        if rows.t[-1] > window.keys[-1] + _SAME_S:
            keys = self._keys(window.keys[-1], rows.t[-1])[1:]
            window.coefficients = _extended(window, keys)
            window.keys = np.concatenate([window.keys, keys])
        more = len(rows.memory_s) - len(window.rows.memory_s)
        if more:  # a sensor has been met since
            window.priors = [with_sensors(prior, more) for prior in window.priors]
        window.rows = window.rows._replace(memory_s=rows.memory_s).followed_by(rows)
        return self._solve(window)

    def _begun(self, rows: BoxRows) -> _Window | None:
        """Begin with a fit to the first boxes; None where they do not make a vehicle yet."""
        begun = begin(rows, self._camera, CuboidConfig(), self._motion)
        fit = None if begun is None else fit_begun(begun, self._camera, CuboidConfig())
        if begun is None or fit is None:
            return None
        keys = self._keys(begun.rows.t[0], begun.rows.t[-1])
        states = np.stack([fit.motion.at(keys, d) for d in range(3)], axis=-1)  # (K, 2, 3)
        coefficients = np.ascontiguousarray(states.swapaxes(0, 1).reshape(2, -1))
        first = first_state(self._motion, len(rows.memory_s), states[0, :, 0])
        any_size = PriorRows(None, np.eye(SIZES) / _ANY_SIZE_M, fit.size / _ANY_SIZE_M)
        fleet = sizes_allowed(np.zeros((SIZES, SIZES)), np.zeros(SIZES))
        return _Window(begun.rows, keys, coefficients, fit.size, [first, any_size], fleet)

    def _keys(self, start: float, end: float) -> FloatArray:
        count = max(math.ceil((end - start) / self._config.key_s - 1e-9), 1)
        return np.linspace(start, end, count + 1)

    def _drive(self, window: _Window) -> Drive:
        config = CuboidConfig()
        velocity = window.coefficients.reshape(2, -1, 3)[:, :, 1].mean(axis=1)
        along = math.atan2(*velocity) if np.hypot(*velocity) > config.least_speed else 0.0
        return Drive(self._kernel, window.rows, window.keys, jerk_of(self._motion), along, config.least_speed)

    def _solve(self, window: _Window) -> bool:
        drive, weight = self._drive(window), np.ones(len(window.rows.t))
        for _ in range(self._config.steps):
            trial = trial_at(drive, window.coefficients, window.size)
            system = factors(drive, trial, weight, CuboidConfig().soft)
            if system is None:
                return False
            mean, cov = window.belief
            W = np.asarray(np.linalg.inv(np.linalg.cholesky(cov)), dtype=np.float64)
            solved = solve_shared_chain(system[0], [*window.priors, PriorRows(None, W, W @ mean)])
            window.coefficients = coefficients_of(solved)
            window.size = window.size + size_step(window.size, solved.shared) * (solved.shared - window.size)
            own = np.linalg.inv(solved.shared_cov) - W.T @ W
            own_part = np.linalg.solve(solved.shared_cov, solved.shared) - W.T @ W @ mean
            window.belief = sizes_allowed(own, own_part)
            window.solution, window.dropped = (solved, system[0]), 0
        return bool(np.isfinite(window.coefficients).all())


def _leave(identity: int, window: _Window, until: float) -> RecordArray:
    """Read out and forget the states up to a time; two at least stay unless it is infinite."""
    count = int(np.searchsorted(window.keys, until, side="right"))
    if until < math.inf:
        count = min(count, len(window.keys) - 2)
    if count <= 0 or window.solution is None:
        return np.empty(0, dtype=ROAD_ROW)
    (solved, system), first = window.solution, window.dropped
    out = _rows(identity, window.keys[:count], solved, first)
    if until < math.inf:
        # The last solution's rows, linearised where it was, stand for the boxes from now on.
        window.priors = [known_of_last(system.take(first, first + count), window.priors)]
        kept = np.searchsorted(window.rows.t, window.keys[count], side="right")
        window.rows = window.rows.take(slice(kept, None))
        window.dropped += count
        window.keys = window.keys[count:]
        window.coefficients = np.ascontiguousarray(window.coefficients[:, 3 * count :])
    return out


def _extended(window: _Window, keys: FloatArray) -> FloatArray:
    """Coefficients with those of further keys, to which the last acceleration goes on."""
    last = window.coefficients[:, -3:]
    dt = keys - window.keys[-1]
    one = np.ones_like(dt)
    more = np.stack(
        [
            last[:, :1] + last[:, 1:2] * dt + last[:, 2:] * dt**2 / 2.0,
            last[:, 1:2] + last[:, 2:] * dt,
            last[:, 2:] * one,
        ],
        axis=-1,
    )
    return np.concatenate([window.coefficients, more.reshape(2, -1)], axis=1)


def _rows(track_id: int, keys: FloatArray, solved: SharedChain, first: int) -> RecordArray:
    """Records of some states of a solution, from the `first`."""
    K, n = solved.states.shape
    cov = solved.covariance()
    each = first + np.arange(len(keys))
    size = np.broadcast_to(K * n + np.arange(SIZES), (len(keys), SIZES))
    index = np.concatenate([each[:, None] * n + _AS_CAUSAL, size], axis=1)
    state = np.concatenate([solved.states.ravel(), solved.shared])[index]
    out = np.empty(len(keys), dtype=ROAD_ROW)
    out["t"], out["track_id"] = keys, track_id
    out["mean"], out["var"] = core.road_terms(state, cov[index[:, :, None], index[:, None]])
    return out
