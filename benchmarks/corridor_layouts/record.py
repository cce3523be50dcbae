"""What a layout of several cameras along a road says of itself, and the passages that it gives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jeat_graph.corridor.passages import Passages
from jeat_graph.data.arrays import FloatArray, IntArray

#: Standard deviations of a passage's time (s), and of the ln of its speed.
_SIGMA_T, _SIGMA_SPEED = 0.05, 0.02


@dataclass(frozen=True, eq=False)
class CameraPair:
    """Passages at two cameras, with who is who.

    Attributes:
        name: of the recording and the pair.
        distance_m: from line to line along the road.
        distance_sd_m: its standard deviation.
        offset_s: clock of the second less that of the first, which is to be found.
        before, after: passages; their `track_id` are rows of `first` and `second`.
        first, second: true identities of the rows.
    """

    name: str
    distance_m: float
    distance_sd_m: float
    offset_s: float
    before: Passages
    after: Passages
    first: IntArray
    second: IntArray


@dataclass(frozen=True)
class CorridorLayout:
    """A layout.

    Attributes:
        name: of the layout.
        holds: what it is, with its source.
        recognise: whether a folder, or a file, is of this layout.
        pairs: yields the pairs of cameras of a folder.
    """

    name: str
    holds: str
    recognise: Callable[[Path], bool]
    pairs: Callable[[Path], Iterator[CameraPair]]


def passages_of(camera: str, t: FloatArray, speed: FloatArray, lane: IntArray) -> Passages:
    """Return passages in order of time; their `track_id` are the rows of what was given.

    Args:
        camera: its name.
        t: (N,) times by the camera's clock (s).
        speed: (N,) m/s, positive.
        lane: (N,) numbers of the lanes, −1 where unknown.
    """
    order = np.argsort(t, kind="stable")
    names = np.unique(lane[lane >= 0])
    code = np.where(lane >= 0, np.searchsorted(names, lane), -1)
    count = len(t)
    return Passages(
        camera,
        "line",
        order,
        t[order],
        np.full(count, _SIGMA_T),
        np.log(speed[order]),
        np.full(count, _SIGMA_SPEED),
        code[order],
        np.full(count, np.nan),
        np.full(count, np.nan),
        np.full(count, -1),
        tuple(map(str, names.tolist())),
        (),
        (float(t.min(initial=np.inf)), float(t.max(initial=-np.inf))),
    )
