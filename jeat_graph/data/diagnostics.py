"""Diagnostics of a run: how well each detection fitted the track that took it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError

#: Degrees of freedom of `Diagnostics.nis`: the centre's two coordinates.
NIS_FREEDOM = 2


@dataclass(frozen=True, eq=False)
class Diagnostics:
    """Updates of tracks by detections, one row an update, tentative tracks included.

    Attributes:
        t: (N,) time (s).
        track_id: (N,) identity.
        sensor: (N,) index into `sensors`.
        nis: (N,) normalised innovation squared of the centre, χ² with 2 degrees of freedom if the filter is
            consistent; NaN where the detection started the track.
        noise_scale: (N,) the sensor's noise scale s (paper eq. 5) with which the detection was weighed, that
            is before the detection itself adapted it.
        existence: (N,) the track's probability of being a vehicle after the step; NaN if it ended in it.
        sensors: names of the sensors.

    Raises:
        DataError: if the columns differ in length.
    """

    t: FloatArray
    track_id: IntArray
    sensor: IntArray
    nis: FloatArray
    noise_scale: FloatArray
    existence: FloatArray
    sensors: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("track_id", "sensor", "nis", "noise_scale", "existence"):
            if getattr(self, name).shape != self.t.shape:
                raise DataError(f"{name} must have shape {self.t.shape}, not {getattr(self, name).shape}")

    def __len__(self) -> int:
        return len(self.t)

    @staticmethod
    def concatenate(parts: Sequence[Diagnostics]) -> Diagnostics:
        """Stack tables that name the same sensors, in the order given."""
        if not parts:
            empty, none = np.zeros(0), np.zeros(0, dtype=np.int64)
            return Diagnostics(empty, none, none, empty, empty, empty)
        if any(part.sensors != parts[0].sensors for part in parts):
            raise DataError("tables of different sensors cannot be joined")
        return Diagnostics(
            t=np.concatenate([part.t for part in parts]),
            track_id=np.concatenate([part.track_id for part in parts]),
            sensor=np.concatenate([part.sensor for part in parts]),
            nis=np.concatenate([part.nis for part in parts]),
            noise_scale=np.concatenate([part.noise_scale for part in parts]),
            existence=np.concatenate([part.existence for part in parts]),
            sensors=parts[0].sensors,
        )

    def take(self, rows: npt.ArrayLike) -> Diagnostics:
        """Return the rows chosen by an index or mask array."""
        index = np.asarray(rows)
        return Diagnostics(
            t=self.t[index],
            track_id=self.track_id[index],
            sensor=self.sensor[index],
            nis=self.nis[index],
            noise_scale=self.noise_scale[index],
            existence=self.existence[index],
            sensors=self.sensors,
        )
