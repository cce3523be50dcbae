"""One frame of a segment with its events and truth, as the renderer or CARLA delivers it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.events import EventArray


@dataclass(frozen=True, eq=False)
class FrameTruth:
    """Vehicles in one frame, one row a vehicle, by ascending id.

    Attributes:
        object_id: (K,) identity, unique within the segment, from 1.
        class_name: (K,) text: car, suv, van, truck, bus, motorcycle, pickup.
        boxes: (K, 4) left, top, width, height (px) of the eight projected corners, clipped to the picture.
        visible: (K,) fraction of the vehicle's projected pixels that nothing nearer covers and that lie
            within the picture, from the depth buffer.
        motion: (K, 6) x, y, vx, vy, ax, ay of the centre of the unclipped box (px, px/s, px/s²).
        size: (K, 3) length, width, height (m).
        pose: (K, 6) x, y, z of the box's centre (m), roll, pitch, yaw (rad), in the camera file's world axes.
        velocity: (K, 3) m/s, same axes.
        ignore: (K,) true where a detector is not asked for the vehicle, for it is far or small.
        tight: (K, 4) left, top, width, height (px) of the outline of the body, clipped to the picture; the
            boxes of the corners are larger. The boxes themselves where it is not known.
        contrast: (K,) contrast-to-noise of the pixels that are seen against what is around them in the RGB
            picture; not a number where it is not known.
    """

    object_id: IntArray
    class_name: npt.NDArray[np.str_]
    boxes: FloatArray
    visible: FloatArray
    motion: FloatArray
    size: FloatArray
    pose: FloatArray
    velocity: FloatArray
    ignore: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    tight: FloatArray = field(default_factory=lambda: np.zeros((0, 4)))
    contrast: FloatArray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if not len(self.ignore):
            object.__setattr__(self, "ignore", np.zeros(len(self.object_id), dtype=bool))
        if not len(self.tight):
            object.__setattr__(self, "tight", self.boxes)
        if not len(self.contrast):
            object.__setattr__(self, "contrast", np.full(len(self.object_id), np.nan))

    def __len__(self) -> int:
        return len(self.object_id)


@dataclass(frozen=True, eq=False)
class SegmentStep:
    """One frame of a segment.

    Attributes:
        t_us: time stamp of the frame (µs from the beginning of the segment): the middle of its exposure.
        rgb: (H, W, 3) uint8 picture in the order red, green, blue.
        events: events since the step before, up to `t_us`; those of the first step begin at 0.
        truth: vehicles at `t_us`.
        mask: (H, W) uint16 identity of the vehicle that each pixel shows, 0 for none; None where masks are
            not asked for.
    """

    t_us: int
    rgb: npt.NDArray[np.uint8]
    events: EventArray
    truth: FrameTruth
    mask: npt.NDArray[np.uint16] | None = None


class SegmentSource(Protocol):
    """Makes segments; two calls with the same index give the same bytes (a game engine may not)."""

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the pictures."""
        ...

    def calibration(self) -> dict[str, Any]:
        """Return the camera's calibration as plain values, for a YAML file."""
        ...

    def calibration_of(self, index: int) -> dict[str, Any]:
        """Return the calibration of segment `index`; cameras may differ between segments."""
        ...

    def settings(self) -> dict[str, Any]:
        """Return all settings as plain values, for a YAML file; with the index they define a segment."""
        ...

    def segment(self, index: int) -> Iterator[SegmentStep]:
        """Yield the frames of segment `index`, which has traffic and noise of its own."""
        ...
