"""The state of all tracks of the engine `paper`: structures of arrays, one row a track."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray

#: The side of a box is e^s, s no more than this: an estimate may run away while nobody sees the vehicle.
MOST_LOG_SIZE = 12.0


@dataclass(frozen=True, eq=False)
class PaperTracks:
    """N tracks in the order of their identities. A step makes new arrays and never writes into old ones.

    The axes x and y are independent and equally noisy, so both have the same covariance; so have width and
    height.

    Attributes:
        track_id: (N,) identities, ascending.
        mean: (N, 2, 3) per axis position, velocity and acceleration (px, px/s, px/s²).
        cov: (N, 3, 3) their covariance, of either axis.
        size_mean: (N, 2, 2) of width and height the logarithm and its rate (ln px, 1/s).
        size_cov: (N, 2, 2) their covariance, of either.
        scale: (N, S) factor on the noise of each sensor (paper eq. 6).
        t_birth: (N,) time of the first detection (s).
        t_update: (N,) time of the last one (s).
        hits: (N,) detections so far.
        confirmed: (N,) whether the track is confirmed.
        used: (N,) bit s is set where a detection of sensor s was taken in the last step.
    """

    track_id: IntArray
    mean: FloatArray
    cov: FloatArray
    size_mean: FloatArray
    size_cov: FloatArray
    scale: FloatArray
    t_birth: FloatArray
    t_update: FloatArray
    hits: IntArray
    confirmed: BoolArray
    used: IntArray

    def __len__(self) -> int:
        return len(self.track_id)

    @staticmethod
    def none(sensors: int) -> PaperTracks:
        """Return no tracks, for so many sensors."""
        whole = np.zeros(0, dtype=np.int64)
        return PaperTracks(
            track_id=whole,
            mean=np.zeros((0, 2, 3)),
            cov=np.zeros((0, 3, 3)),
            size_mean=np.zeros((0, 2, 2)),
            size_cov=np.zeros((0, 2, 2)),
            scale=np.ones((0, sensors)),
            t_birth=np.zeros(0),
            t_update=np.zeros(0),
            hits=whole,
            confirmed=np.zeros(0, dtype=np.bool_),
            used=whole,
        )

    def take(self, rows: BoolArray | IntArray) -> PaperTracks:
        """Return some of the tracks."""
        return PaperTracks(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    def join(self, more: PaperTracks) -> PaperTracks:
        """Return these tracks and those behind them."""
        pairs = {f.name: (getattr(self, f.name), getattr(more, f.name)) for f in fields(self)}
        return PaperTracks(**{name: np.concatenate(pair) for name, pair in pairs.items()})

    def with_sensors(self, sensors: int) -> PaperTracks:
        """Return the same tracks with room for the noise of further sensors."""
        new = np.ones((len(self), sensors - self.scale.shape[1]))
        return replace(self, scale=np.concatenate([self.scale, new], axis=1))


def together(tracks: PaperTracks) -> tuple[FloatArray, FloatArray]:
    """Return states as means (N, 2, 5) and covariances (N, 2, 5, 5): motion, then size, of each axis."""
    mean = np.concatenate([tracks.mean, tracks.size_mean], axis=2)
    covariance = np.zeros((len(tracks), 2, mean.shape[2], mean.shape[2]))
    motion = tracks.mean.shape[2]
    covariance[:, :, :motion, :motion] = tracks.cov[:, None]
    covariance[:, :, motion:, motion:] = tracks.size_cov[:, None]
    return mean, covariance


@dataclass(frozen=True, eq=False)
class Found:
    """The M detections of all sensors at one time.

    Attributes:
        z: (M, 2) box centres (px).
        log_size: (M, 2) logarithms of width and height.
        sensor: (M,) index of each one's sensor.
        noise: (M,) variance R_base g(p) of a centre along either axis, before the track's factor (px²).
        log_size_var: (M,) variance of a logarithm.
        place: (M,) of each one's sensor among the names of all in alphabetical order.
    """

    z: FloatArray
    log_size: FloatArray
    sensor: IntArray
    noise: FloatArray
    log_size_var: FloatArray
    place: IntArray

    def __len__(self) -> int:
        return len(self.z)
