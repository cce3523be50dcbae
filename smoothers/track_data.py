"""What goes into a smoother and what comes out of it: arrays of one track, in px and s.

The axes x and y are independent (`filters/motion.py` says why), so a state is two blocks [p, v, a].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.errors import DataError

#: Measurements closer than this (s) share one state. Within a microsecond nothing on a road moves,
#: while the process noise of such a step, of order Δ⁵, would only spoil the arithmetic.
COINCIDENT_S = 1e-6


@dataclass(frozen=True, eq=False)
class TrackData:
    """The prior and the accepted measurements of one track, in order of time.

    A *key* is a time at which the track has a state of its own. Key 0 is the time of the prior; every
    other key is the time of one measurement or of several coincident ones.

    Attributes:
        prior_mean: (2, 3) mean of [p, v, a] at key 0, per axis (px, px/s, px/s²).
        prior_cov: (2, 3, 3) its covariance.
        t: (K,) times of the keys (s), strictly ascending.
        q: (K,) root spectral density of the jerk over the interval that ends at the key (px/s^2.5);
            q[0] has no meaning.
        key: (M,) the key that each measurement belongs to, ascending.
        z: (M, 2) measured centres (px).
        r: (M, 2) variances of the measurements (px²), just as the filter used them.

    Raises:
        DataError: if a shape is wrong, a number is not finite, or a variance or density not positive.
    """

    prior_mean: FloatArray
    prior_cov: FloatArray
    t: FloatArray
    q: FloatArray
    key: IntArray
    z: FloatArray
    r: FloatArray

    def __post_init__(self) -> None:
        keys, rows = len(self.t), len(self.z)
        shapes = {
            "prior_mean": (2, 3),
            "prior_cov": (2, 3, 3),
            "t": (keys,),
            "q": (keys,),
            "key": (rows,),
            "z": (rows, 2),
            "r": (rows, 2),
        }
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value.shape != shape:
                raise DataError(f"{name} must have shape {shape}, not {value.shape}")
            if not np.isfinite(value).all():
                raise DataError(f"{name} must be finite")
        if keys == 0:
            raise DataError("a track needs at least the time of its prior")
        if np.any(self.q[1:] <= 0) or np.any(self.r <= 0):
            raise DataError("spectral densities and variances must be positive")
        if np.any(np.diff(self.t) <= 0):
            raise DataError("the times of the keys must ascend")

    def __len__(self) -> int:
        return len(self.t)

    @staticmethod
    def from_measurements(
        prior_t: float,
        prior_mean: npt.ArrayLike,
        prior_cov: npt.ArrayLike,
        t: npt.ArrayLike,
        z: npt.ArrayLike,
        r: npt.ArrayLike,
        q: npt.ArrayLike,
    ) -> TrackData:
        """Sort measurements by time and give coincident ones a common key.

        Args:
            prior_t: time of the prior (s); no measurement may be older.
            prior_mean: (2, 3) prior mean per axis. If the track was born from a detection that the
                prior already contains, that detection must not be among the measurements again.
            prior_cov: (2, 3, 3) prior covariance.
            t: (M,) times (s), in any order.
            z: (M, 2) centres (px).
            r: (M, 2) variances (px²).
            q: (M,) root spectral density of the jerk since the measurement before (px/s^2.5).

        Returns:
            The data of the track.

        Raises:
            DataError: if a measurement is older than the prior, or an array is not valid.
        """
        times = np.asarray(t, dtype=np.float64).reshape(-1)
        order = np.argsort(times, kind="stable")
        times = times[order]
        if len(times) and times[0] < prior_t - COINCIDENT_S:
            raise DataError(f"a measurement at {times[0]} s is older than the track's prior at {prior_t} s")
        key, first = group_times(times, prior_t)
        return TrackData(
            prior_mean=np.asarray(prior_mean, dtype=np.float64),
            prior_cov=np.asarray(prior_cov, dtype=np.float64),
            t=np.concatenate([[prior_t], times[first]]),
            q=np.concatenate([[0.0], np.asarray(q, dtype=np.float64).reshape(-1)[order][first]]),
            key=key,
            z=np.asarray(z, dtype=np.float64).reshape(-1, 2)[order],
            r=np.asarray(r, dtype=np.float64).reshape(-1, 2)[order],
        )

    def fused(self, weights: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Fuse the measurements of each key into one, by adding their information; this is exact.

        Args:
            weights: (M,) factor on the information of each measurement, 1 where None.

        Returns:
            (K, 2) fused centres (px, 0 where there is none) and (K, 2) their information (1/px²).
        """
        return fuse(self.key, self.z, self.r, len(self.t), weights)


@dataclass(frozen=True, eq=False)
class SmoothedTrack:
    """Smoothed states of one track at its keys.

    Attributes:
        t: (K,) times (s), ascending.
        q: (K,) root spectral density of the jerk over the interval that ends at the key (px/s^2.5).
        mean: (K, 2, 3) means of [p, v, a] per axis (px, px/s, px/s²).
        cov: (K, 2, 3, 3) covariances.
        gain: (K, 2, 3, 3) smoother gains G_k = P_k Fᵀ (F P_k Fᵀ + Q)⁻¹ from a key to the next, with P_k
            the filtered covariance; they carry the covariance of neighbouring states, see `cross`. The
            last is zero, or leads to the piece that follows when a trajectory comes in pieces.
    """

    t: FloatArray
    q: FloatArray
    mean: FloatArray
    cov: FloatArray
    gain: FloatArray

    def __len__(self) -> int:
        return len(self.t)

    def cross(self) -> FloatArray:
        """Covariances (K - 1, 2, 3, 3) of the states at k and k + 1 given all measurements, G_k P_{k+1}.

        Source: Shumway, Stoffer, Journal of Time Series Analysis 3(4), 1982 (lag-one covariance).
        """
        return np.asarray(self.gain[:-1] @ self.cov[1:])

    def select(self, part: slice) -> SmoothedTrack:
        """Return the keys of a slice."""
        return SmoothedTrack(self.t[part], self.q[part], self.mean[part], self.cov[part], self.gain[part])

    @staticmethod
    def empty() -> SmoothedTrack:
        """Return a trajectory without keys."""
        block = np.zeros((0, 2, 3, 3))
        return SmoothedTrack(np.zeros(0), np.zeros(0), np.zeros((0, 2, 3)), block, block)

    @staticmethod
    def concatenate(parts: Sequence[SmoothedTrack]) -> SmoothedTrack:
        """Join consecutive pieces of one trajectory."""
        if len(parts) < 2:
            return parts[0] if parts else SmoothedTrack.empty()
        return SmoothedTrack(
            np.concatenate([part.t for part in parts]),
            np.concatenate([part.q for part in parts]),
            np.concatenate([part.mean for part in parts]),
            np.concatenate([part.cov for part in parts]),
            np.concatenate([part.gain for part in parts]),
        )


def group_times(times: FloatArray, latest: float) -> tuple[IntArray, IntArray]:
    """Assign ascending times to keys, coincident ones to the same key.

    A key takes the time of its first measurement, so a chain of close stamps does not drift.

    Args:
        times: (M,) ascending times (s).
        latest: time of the key before, key 0 (s).

    Returns:
        (M,) the key of each time, counted from key 0, and (J,) index of each new key's first time.
    """
    gaps = np.diff(times, prepend=latest)
    if np.all(gaps > COINCIDENT_S):
        everything = np.arange(len(times), dtype=np.int64)
        return everything + 1, everything
    key = np.empty(len(times), dtype=np.int64)
    first: list[int] = []
    for i, t in enumerate(times.tolist()):
        if t - latest > COINCIDENT_S:
            first.append(i)
            latest = t
        key[i] = len(first)
    return key, np.asarray(first, dtype=np.int64)


def fuse(
    key: IntArray, z: FloatArray, r: FloatArray, keys: int, weights: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Add up the information of measurements by key.

    Args:
        key: (M,) key of each measurement.
        z: (M, 2) centres (px).
        r: (M, 2) variances (px²).
        keys: number of keys, K.
        weights: (M,) factor on the information of each, 1 where None.

    Returns:
        (K, 2) fused centres (px, 0 where there is none), (K, 2) their information (1/px²).
    """
    info = 1.0 / r if weights is None else weights[:, None] / r
    total = np.zeros((keys, 2))
    centre = np.zeros((keys, 2))
    np.add.at(total, key, info)
    np.add.at(centre, key, info * z)
    np.divide(centre, total, out=centre, where=total > 0)
    return centre, total


def check_measurements(
    t: npt.ArrayLike, z: npt.ArrayLike, r: npt.ArrayLike, q: npt.ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Convert and check measurements of one track.

    Args:
        t: (M,) times (s).
        z: (M, 2) centres (px).
        r: (M, 2) variances (px²).
        q: (M,) root spectral densities of the jerk (px/s^2.5).

    Returns:
        The four as float64 arrays.

    Raises:
        DataError: wrong shapes, numbers that are not finite, variances or densities <= 0.
    """
    times = np.asarray(t, dtype=np.float64)
    centres, variances = np.asarray(z, dtype=np.float64), np.asarray(r, dtype=np.float64)
    density = np.asarray(q, dtype=np.float64)
    rows = times.size
    if times.shape != (rows,) or density.shape != (rows,):
        raise DataError(f"times and densities must have shape ({rows},)")
    if centres.shape != (rows, 2) or variances.shape != (rows, 2):
        raise DataError(f"centres and variances must have shape ({rows}, 2)")
    if not _all_valid(times, centres, variances, density):
        raise DataError("measurements must be finite, their variances and spectral densities positive")
    return times, centres, variances, density


@njit(cache=True)
def _all_valid(t: FloatArray, z: FloatArray, r: FloatArray, q: FloatArray) -> bool:
    """Whether all is finite and `r`, `q` positive; compiled, as live callers feed one row at a time."""
    for i in range(len(t)):
        if not (np.isfinite(t[i]) and np.isfinite(q[i]) and q[i] > 0.0):
            return False
        for axis in range(2):
            if not (np.isfinite(z[i, axis]) and np.isfinite(r[i, axis]) and r[i, axis] > 0.0):
                return False
    return True
