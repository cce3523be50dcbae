"""What goes into a smoother and what comes out of it: arrays of one track, in px and s.

The axes x and y are independent (`filters/motion.py` says why), so a state is two blocks
[p, v, a, e_1, …, e_B]: the motion, and the error states of the coloured sensors (`transitions.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.data.errors import DataError
from jeat_graph.smoothers.measurements import (
    COINCIDENT_S,
    by_time,
    check_measurements,
    group_times,
    measurements,
)

__all__ = ["COINCIDENT_S", "MOTION", "Prior", "SmoothedTrack", "TrackData"]

#: Components of the motion: position, velocity, acceleration.
MOTION = 3


class Prior(NamedTuple):
    """What is known of a track's state before its measurements.

    Attributes:
        t: time (s).
        mean: (2, 3 + B) mean of [p, v, a, e_1, …, e_B] per axis (px, px/s, px/s², 1).
        cov: (2, 3 + B, 3 + B) covariance.
    """

    t: float
    mean: FloatArray
    cov: FloatArray


@dataclass(frozen=True, eq=False)
class TrackData:
    """The prior and the accepted measurements of one track, in order of time.

    A *key* is a time at which the track has a state of its own. Key 0 is the time of the prior; every
    other key is the time of one measurement or of several coincident ones.

    Attributes:
        prior_mean: (2, 3 + B) mean of [p, v, a, e_1, …, e_B] at key 0, per axis (px, px/s, px/s², 1).
        prior_cov: (2, 3 + B, 3 + B) its covariance.
        t: (K,) times of the keys (s), strictly ascending.
        jerk: (K,) root spectral density of the jerk over the interval that ends at the key (px/s^2.5);
            q[0] has no meaning.
        key: (M,) the key that each measurement belongs to, ascending.
        z: (M, 2) measured centres z = p + coloured_std · e + w (px).
        r: (M, 2) variances of the white part w (px²), just as the filter used them.
        coloured_std: (M, 2) standard deviation of the coloured part (px), 0 for white errors.
        error: (M,) index of the error state e of each measurement, or -1.
        correlation_time: (B,) correlation time of each error state (s).

    Raises:
        DataError: if a shape is wrong, a number is not finite, a variance, density or correlation time not
            positive, or an error state does not exist.
    """

    prior_mean: FloatArray
    prior_cov: FloatArray
    t: FloatArray
    jerk: FloatArray
    key: IntArray
    z: FloatArray
    r: FloatArray
    coloured_std: FloatArray
    error: IntArray
    correlation_time: FloatArray

    def __post_init__(self) -> None:
        keys, rows, size = len(self.t), len(self.z), self.size
        shapes = {
            "prior_mean": (2, size),
            "prior_cov": (2, size, size),
            "t": (keys,),
            "jerk": (keys,),
            "key": (rows,),
            "z": (rows, 2),
            "r": (rows, 2),
            "coloured_std": (rows, 2),
            "error": (rows,),
            "correlation_time": (size - MOTION,),
        }
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value.shape != shape:
                raise DataError(f"{name} must have shape {shape}, not {value.shape}")
            if not np.isfinite(value).all():
                raise DataError(f"{name} must be finite")
        if keys == 0:
            raise DataError("a track needs at least the time of its prior")
        if np.any(self.jerk[1:] <= 0) or np.any(self.r <= 0) or np.any(self.correlation_time <= 0):
            raise DataError("spectral densities, variances and correlation times must be positive")
        if np.any(np.diff(self.t) <= 0):
            raise DataError("the times of the keys must ascend")
        if np.any(self.error < -1) or np.any(self.error >= len(self.correlation_time)):
            raise DataError(
                f"error states are numbered from 0 to {len(self.correlation_time) - 1}, or -1 for none"
            )

    def __len__(self) -> int:
        return len(self.t)

    @property
    def size(self) -> int:
        """Components of a state, per axis: 3 + B."""
        return MOTION + len(self.correlation_time)

    @staticmethod
    def from_measurements(
        prior: Prior, measured: RecordArray, correlation_time: npt.ArrayLike = ()
    ) -> TrackData:
        """Sort measurements by time and give coincident ones a common key.

        Args:
            prior: what is known before; no measurement may be older. If the track was born from a detection
                that the prior already contains, that detection must not be among the measurements again.
            measured: (M,) records (`measurements.measurements`), in any order.
            correlation_time: (B,) correlation times of the error states (s).

        Returns:
            The data of the track.

        Raises:
            DataError: if a measurement is older than the prior, or an array is not valid.
        """
        times = np.asarray(correlation_time, dtype=np.float64).reshape(-1)
        check_measurements(measured, len(times))
        rows = by_time(measured)
        if len(rows) and rows["t"][0] < prior.t - COINCIDENT_S:
            raise DataError(
                f"a measurement at {rows['t'][0]} s is older than the track's prior at {prior.t} s"
            )
        key, first = group_times(rows["t"], prior.t)
        return TrackData(
            prior_mean=np.asarray(prior.mean, dtype=np.float64),
            prior_cov=np.asarray(prior.cov, dtype=np.float64),
            t=np.concatenate([[prior.t], rows["t"][first]]),
            jerk=np.concatenate([[0.0], rows["jerk"][first]]),
            key=key,
            z=rows["z"].copy(),
            r=rows["r"].copy(),
            coloured_std=rows["coloured_std"].copy(),
            error=rows["error"].copy(),
            correlation_time=times,
        )

    @property
    def prior(self) -> Prior:
        """What is known of the state at key 0 before its measurements."""
        return Prior(float(self.t[0]), self.prior_mean, self.prior_cov)

    def measurements(self) -> RecordArray:
        """Return the measurements alone (M,), each with the time and the jerk of its key."""
        key = self.key
        return measurements(self.t[key], self.z, self.r, self.jerk[key], self.coloured_std, self.error)


@dataclass(frozen=True, eq=False)
class SmoothedTrack:
    """Smoothed states of one track at its keys.

    Attributes:
        t: (K,) times (s), ascending.
        jerk: (K,) root spectral density of the jerk over the interval that ends at the key (px/s^2.5).
        mean: (K, 2, 3 + B) means of [p, v, a, e_1, …, e_B] per axis (px, px/s, px/s², 1).
        cov: (K, 2, 3 + B, 3 + B) covariances.
        gain: (K, 2, 3 + B, 3 + B) smoother gains G_k = P_k Fᵀ (F P_k Fᵀ + Q)⁻¹ from a key to the next,
            with P_k the filtered covariance; they carry the covariance of neighbouring states, see
            `cross`. The last is zero, or leads to the piece that follows when a trajectory comes in pieces.
    """

    t: FloatArray
    jerk: FloatArray
    mean: FloatArray
    cov: FloatArray
    gain: FloatArray

    def __len__(self) -> int:
        return len(self.t)

    def cross(self) -> FloatArray:
        """Covariances (K - 1, 2, 3 + B, 3 + B) of the states at k and k + 1 given all measurements.

        It is G_k P_{k+1}.
        Source: Shumway, Stoffer, Journal of Time Series Analysis 3(4), 1982 (lag-one covariance).
        """
        return np.asarray(self.gain[:-1] @ self.cov[1:])

    def motion(self) -> tuple[FloatArray, FloatArray]:
        """Return means (K, 2, 3) and covariances (K, 2, 3, 3) of position, velocity and acceleration."""
        return self.mean[:, :, :MOTION], self.cov[:, :, :MOTION, :MOTION]

    def select(self, part: slice) -> SmoothedTrack:
        """Return the keys of a slice."""
        return SmoothedTrack(self.t[part], self.jerk[part], self.mean[part], self.cov[part], self.gain[part])

    @staticmethod
    def empty(size: int = MOTION) -> SmoothedTrack:
        """Return a trajectory without keys, of states with `size` components per axis."""
        block = np.zeros((0, 2, size, size))
        return SmoothedTrack(np.zeros(0), np.zeros(0), np.zeros((0, 2, size)), block, block)

    @staticmethod
    def concatenate(parts: Sequence[SmoothedTrack]) -> SmoothedTrack:
        """Join consecutive pieces of one trajectory; those without keys do not count."""
        full = [part for part in parts if len(part)]
        if len(full) < 2:
            return full[0] if full else SmoothedTrack.empty()
        return SmoothedTrack(
            np.concatenate([part.t for part in full]),
            np.concatenate([part.jerk for part in full]),
            np.concatenate([part.mean for part in full]),
            np.concatenate([part.cov for part in full]),
            np.concatenate([part.gain for part in full]),
        )
