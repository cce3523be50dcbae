"""One interface for all smoothers, so that the configuration chooses among them."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import RecordArray
from jeat_graph.data.errors import ConfigError
from jeat_graph.smoothers.fixed_lag import FixedLagSmoother
from jeat_graph.smoothers.gtsam.full import smooth_full
from jeat_graph.smoothers.gtsam.linear_graph import load_gtsam
from jeat_graph.smoothers.measurements import (
    COINCIDENT_S,
    check_measurements,
    concatenate_measurements,
)
from jeat_graph.smoothers.robust import robust_weights
from jeat_graph.smoothers.rts import smooth_rts
from jeat_graph.smoothers.track_data import Prior, SmoothedTrack, TrackData

#: Names of the engines: GTSAM with a lag, our own RTS with a lag, GTSAM and RTS over the whole track.
ENGINES = ("fixed-lag", "fixed-lag-rts", "full", "rts")


class TrackSmoother(Protocol):
    """The smoother of one track.

    Attributes:
        rebuilds: how often GTSAM failed and the track was solved anew from our arrays.
        fallbacks: how often our own RTS pass had to stand in for GTSAM.
        too_late: measurements refused because the states they belong to were final.
        waiting: measurements set aside until there are enough to solve for.
    """

    rebuilds: int
    fallbacks: int
    too_late: int
    waiting: int

    def feed(self, measured: RecordArray) -> None:
        """Take in measurements z = p + h e + w: (M,) records, see `measurements.measurements`."""

    def departed(self) -> list[SmoothedTrack]:
        """Return the states that have become final since the last call, and forget them.

        Each piece comes from one solve; its last state is not final, and begins the next piece.
        """

    def current(self) -> SmoothedTrack:
        """Return the states that are not final yet, given all measurements so far."""

    def finish(self) -> list[SmoothedTrack]:
        """Return all states not yet returned by `departed`, in such pieces, and close."""

    def close(self) -> None:
        """Free everything; the smoother takes no more measurements."""


class WholeTrackSmoother:
    """Keeps the measurements of a track and solves for all of it when asked; nothing is final before.

    Args:
        prior: what is known of the state before the measurements.
        use_gtsam: whether GTSAM does the solving, or our own RTS pass.
        robust: kernel that weighs down outliers (`robust.KERNELS`), or "none".
        correlation_time: (B,) correlation times of the error states (s).

    Attributes:
        rebuilds: how often GTSAM failed.
        fallbacks: how often the RTS pass gave the result instead; the same number.
        too_late: measurements refused because they were older than the prior.
        waiting: 0, as all of them are solved for at the end.
    """

    def __init__(
        self,
        prior: Prior,
        *,
        use_gtsam: bool = True,
        robust: str = "none",
        correlation_time: npt.ArrayLike = (),
    ) -> None:
        self.rebuilds = self.fallbacks = self.too_late = self.waiting = 0
        self._prior = prior
        self._use_gtsam, self._robust = use_gtsam, robust
        self._correlation_time = np.asarray(correlation_time, dtype=np.float64)
        self._parts: list[RecordArray] = []

    def feed(self, measured: RecordArray) -> None:
        """Take in measurements (M,), in any order; see `TrackSmoother.feed`.

        Raises:
            DataError: records of another kind, numbers that are not finite, variances or densities <= 0,
                error states that do not exist.
        """
        check_measurements(measured, len(self._correlation_time))
        late = measured["t"] < self._prior.t - COINCIDENT_S
        if late.any():
            self.too_late += int(np.count_nonzero(late))
            measured = measured[~late]
        self._parts.append(measured)

    def data(self) -> TrackData:
        """Return the prior and all measurements so far."""
        measured = concatenate_measurements(self._parts)
        return TrackData.from_measurements(self._prior, measured, self._correlation_time)

    def departed(self) -> list[SmoothedTrack]:
        """Return nothing: no state is final before the track ends."""
        return []

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

    def finish(self) -> list[SmoothedTrack]:
        """Return the whole track in one piece, and close."""
        result = self.current()
        self.close()
        return [result]

    def close(self) -> None:
        """Forget the measurements."""
        self._parts = []


def load_engine(engine: str) -> None:
    """Load what an engine needs, now rather than in the middle of a live run: GTSAM takes a while."""
    if engine in ("fixed-lag", "full"):
        load_gtsam()


def make_smoother(
    engine: str,
    prior: Prior,
    *,
    lag_s: float = 1.0,
    chunk: int = 24,
    robust: str = "none",
    correlation_time: npt.ArrayLike = (),
) -> TrackSmoother:
    """Make the smoother of one track.

    Args:
        engine: one of `ENGINES`.
        prior: what is known of the state before the measurements.
        lag_s: lag of the engines with a window (s).
        chunk: measurements per update of these.
        robust: kernel of the engines over the whole track (`robust.KERNELS`), or "none".
        correlation_time: (B,) correlation times of the error states (s), one a sensor with coloured errors.

    Returns:
        The smoother.

    Raises:
        ConfigError: if there is no such engine.
    """
    if engine not in ENGINES:
        raise ConfigError(f"smoother must be one of {', '.join(ENGINES)}, not {engine!r}")
    if engine.startswith("fixed-lag"):
        gtsam = engine == "fixed-lag"
        return FixedLagSmoother(
            prior, lag_s=lag_s, chunk=chunk, use_gtsam=gtsam, correlation_time=correlation_time
        )
    return WholeTrackSmoother(
        prior, use_gtsam=engine == "full", robust=robust, correlation_time=correlation_time
    )
