"""One interface for all smoothers, so that the configuration chooses among them."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import ConfigError
from jeat_graph.smoothers.fixed_lag import FixedLagSmoother
from jeat_graph.smoothers.gtsam.full import smooth_full
from jeat_graph.smoothers.measurements import COINCIDENT_S, Measurements, check_measurements
from jeat_graph.smoothers.robust import robust_weights
from jeat_graph.smoothers.rts import smooth_rts
from jeat_graph.smoothers.track_data import SmoothedTrack, TrackData

#: Names of the engines: GTSAM with a lag, our own RTS with a lag, GTSAM and RTS over the whole track.
ENGINES = ("fixed-lag", "fixed-lag-rts", "full", "rts")


class TrackSmoother(Protocol):
    """The smoother of one track.

    Attributes:
        rebuilds: how often GTSAM failed and the track was solved anew from our arrays.
        fallbacks: how often our own RTS pass had to stand in for GTSAM.
        too_late: measurements refused because the states they belong to were final.
    """

    rebuilds: int
    fallbacks: int
    too_late: int

    def feed(
        self,
        t: npt.ArrayLike,
        z: npt.ArrayLike,
        r: npt.ArrayLike,
        q: npt.ArrayLike,
        lever: npt.ArrayLike | None = None,
        error: npt.ArrayLike | None = None,
    ) -> None:
        """Take in measurements z = p + lever · e + w.

        Args:
            t: (M,) times (s).
            z: (M, 2) centres (px).
            r: (M, 2) variances of the white part w (px²).
            q: (M,) root spectral densities of the jerk (px/s^2.5).
            lever: (M, 2) standard deviations of the part with a memory (px); None for none.
            error: (M,) index of the error state e of each, or -1; None for -1.
        """

    def departed(self) -> SmoothedTrack:
        """Return the states that have become final since the last call, and forget them."""

    def current(self) -> SmoothedTrack:
        """Return the states that are not final yet, given all measurements so far."""

    def finish(self) -> SmoothedTrack:
        """Return all states not yet returned by `departed`, and close."""

    def close(self) -> None:
        """Free everything; the smoother takes no more measurements."""


class WholeTrackSmoother:
    """Keeps the measurements of a track and solves for all of it when asked; nothing is final before.

    Args:
        prior_t: time of the prior (s).
        prior_mean: (2, 3 + B) prior mean of [p, v, a, e_1, …, e_B] per axis (px, px/s, px/s², 1).
        prior_cov: (2, 3 + B, 3 + B) prior covariance.
        use_gtsam: whether GTSAM does the solving, or our own RTS pass.
        robust: kernel that weighs down outliers (`robust.KERNELS`), or "none".
        memory: (B,) memory of the error states (s).

    Attributes:
        rebuilds: how often GTSAM failed.
        fallbacks: how often the RTS pass gave the result instead; the same number.
        too_late: measurements refused because they were older than the prior.
    """

    def __init__(
        self,
        prior_t: float,
        prior_mean: FloatArray,
        prior_cov: FloatArray,
        *,
        use_gtsam: bool = True,
        robust: str = "none",
        memory: npt.ArrayLike = (),
    ) -> None:
        self.rebuilds = self.fallbacks = self.too_late = 0
        self._prior = (prior_t, np.asarray(prior_mean), np.asarray(prior_cov))
        self._use_gtsam, self._robust = use_gtsam, robust
        self._memory = np.asarray(memory, dtype=np.float64)
        self._parts: list[Measurements] = []

    def feed(
        self,
        t: npt.ArrayLike,
        z: npt.ArrayLike,
        r: npt.ArrayLike,
        q: npt.ArrayLike,
        lever: npt.ArrayLike | None = None,
        error: npt.ArrayLike | None = None,
    ) -> None:
        """Take in measurements, in any order; see `TrackSmoother.feed`.

        Raises:
            DataError: wrong shapes, numbers that are not finite, variances or densities <= 0, error states
                that do not exist.
        """
        taken = check_measurements(t, z, r, q, lever, error, len(self._memory))
        earliest = self._prior[0] - COINCIDENT_S
        if taken.t.min(initial=np.inf) < earliest:
            valid = taken.t >= earliest
            self.too_late += int(np.count_nonzero(~valid))
            taken = taken.take(valid)
        self._parts.append(taken)

    def data(self) -> TrackData:
        """Return the prior and all measurements so far."""
        empty = check_measurements([], np.zeros((0, 2)), np.zeros((0, 2)), [])
        taken = Measurements.concatenate([empty, *self._parts])
        return TrackData.from_measurements(*self._prior, *taken, memory=self._memory)

    def departed(self) -> SmoothedTrack:
        """Return nothing: no state is final before the track ends."""
        return SmoothedTrack.empty()

    def current(self) -> SmoothedTrack:
        """Return the whole track, smoothed with all measurements so far."""
        data = self.data()
        weights = None if self._robust == "none" else robust_weights(data, self._robust)
        if self._use_gtsam:
            try:
                return smooth_full(data, weights)
            except (RuntimeError, np.linalg.LinAlgError):
                self.rebuilds += 1
                self.fallbacks += 1
        return smooth_rts(data, weights)

    def finish(self) -> SmoothedTrack:
        """Return the whole track, and close."""
        result = self.current()
        self.close()
        return result

    def close(self) -> None:
        """Forget the measurements."""
        self._parts = []


def load_engine(engine: str) -> None:
    """Load what an engine needs, now rather than in the middle of a live run: GTSAM takes a while."""
    if engine in ("fixed-lag", "full"):
        import gtsam  # noqa: F401


def make_smoother(
    engine: str,
    prior_t: float,
    prior_mean: FloatArray,
    prior_cov: FloatArray,
    *,
    lag_s: float = 1.0,
    chunk: int = 24,
    robust: str = "none",
    memory: npt.ArrayLike = (),
) -> TrackSmoother:
    """Make the smoother of one track.

    Args:
        engine: one of `ENGINES`.
        prior_t: time of the prior (s).
        prior_mean: (2, 3 + B) prior mean of [p, v, a, e_1, …, e_B] per axis (px, px/s, px/s², 1).
        prior_cov: (2, 3 + B, 3 + B) prior covariance.
        lag_s: lag of the engines with a window (s).
        chunk: measurements per update of these.
        robust: kernel of the engines over the whole track (`robust.KERNELS`), or "none".
        memory: (B,) memory of the error states (s): those of sensors whose errors are coloured.

    Returns:
        The smoother.

    Raises:
        ConfigError: if there is no such engine.
    """
    if engine not in ENGINES:
        raise ConfigError(f"smoother must be one of {', '.join(ENGINES)}, not {engine!r}")
    prior = (prior_t, prior_mean, prior_cov)
    if engine.startswith("fixed-lag"):
        gtsam = engine == "fixed-lag"
        return FixedLagSmoother(*prior, lag_s=lag_s, chunk=chunk, use_gtsam=gtsam, memory=memory)
    return WholeTrackSmoother(*prior, use_gtsam=engine == "full", robust=robust, memory=memory)
