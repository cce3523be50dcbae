"""One track with every measurement that it took in, for whoever wants to smooth it in other ways."""

from __future__ import annotations

from dataclasses import dataclass

from jeat_graph.data.arrays import IntArray
from jeat_graph.smoothers.track_data import TrackData


@dataclass(frozen=True, eq=False)
class MeasuredTrack:
    """One confirmed track with all that it took in.

    Attributes:
        track_id: identity, as in the causal table.
        data: prior and measurements; its first key is the birth.
        sensor: (M,) index of the sensor of each measurement of `data`.
        birth_sensor: index of the sensor whose detection started the track.
    """

    track_id: int
    data: TrackData
    sensor: IntArray
    birth_sensor: int
