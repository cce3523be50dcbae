"""The event camera of a rig: the RGB camera's segments through another lens and by another clock."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from jeat_graph.config.section_tree import plain
from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.simulation.imaging.config import ImagingConfig
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.scenario import Scenario
from jeat_graph_sehn.simulation.segment import SegmentStep
from jeat_graph_sehn.simulation.streams import stream
from jeat_graph_sehn.simulation.world.camera import Camera
from jeat_graph_sehn.simulation.world.rig import DRAWN, Rig, RigConfig, draw_rig

# Event cameras of drawn rigs have one picture, for those of a set are of one size (px).
_DRAWN_PX = (640, 480)


class RigEventSource(RenderedSource):
    """Events and truth of a rig's event camera, in its own picture and on its own clock; a `SegmentSource`.

    With the same settings and seed, `RenderedSource` with `rgb` alone makes what the RGB camera sees.
    """

    def __init__(
        self,
        scenario: Scenario,
        imaging: ImagingConfig | None,
        seed: int,
        frames: int,
        world: str,
        rig: RigConfig | str,
    ) -> None:
        """Prepare; nothing is rendered yet.

        Args:
            scenario: road, traffic, light and the RGB camera, which is scaled to the picture's size.
            imaging: renderer and cameras; its picture is the RGB camera's.
            seed: of all segments.
            frames: times of truth a segment.
            world: as `RenderedSource` takes it.
            rig: the event camera; `drawn` draws one for each segment.

        Raises:
            ConfigError: what `RenderedSource` refuses, a rig that cannot be, or a clock that shows negative
                times, which no file of events holds.
        """
        super().__init__(scenario, imaging, seed, frames, world, "events")
        self.rig = rig
        if isinstance(rig, RigConfig) and rig.late_s != 0.0:
            raise ConfigError("late_s: rendered segments of both cameras begin together; leave it out")
        if self.rig_of(0).reading(np.zeros(1))[0] < 0.0:
            raise ConfigError(
                "rig: its event camera's clock begins below 0, and files of events hold no such times: give "
                "an offset_s of 0 or more"
            )

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the event camera's picture."""
        return _DRAWN_PX if isinstance(self.rig, str) else (self.rig.width, self.rig.height)

    def rig_of(self, index: int) -> Rig:
        """Return cameras and clocks of segment `index`.

        Raises:
            ConfigError: a rig that cannot be.
        """
        common = super()._camera_of(index)
        if not isinstance(self.rig, str):
            return Rig.beside(common, self.rig)
        if self.rig != DRAWN:
            raise ConfigError(f"rig: must be settings of a rig or {DRAWN!r}, not {self.rig!r}")
        drawn = draw_rig(stream(self.seed, f"segment.{index}.rig"), common)
        width, height = _DRAWN_PX
        own = replace(
            drawn,
            width=width,
            height=height,
            focal_px=drawn.focal_px * width / drawn.width,
            offset_s=abs(drawn.offset_s),
        )
        return Rig.beside(common, own)

    def rig_text(self, index: int) -> str:
        """Return the true `rig.yaml` of segment `index`.

        Raises:
            DataError: the cameras do not see the same road.
        """
        lens = self._world(index)[1].lens
        return self.rig_of(index).text(("rgb", "evt"), (lens.k1, lens.k2))

    def calibration(self) -> dict[str, Any]:
        """Return the event camera's calibration in the first segment."""
        return self.calibration_of(0)

    def calibration_of(self, index: int) -> dict[str, Any]:
        """Return the event camera's calibration in segment `index`, in the axes of the RGB camera's."""
        return self._with_lens(self._camera_of(index).to_dict(), self._world(index)[1])

    def settings(self) -> dict[str, Any]:
        """Return all settings as plain values."""
        rig = self.rig if isinstance(self.rig, str) else plain(dataclasses.asdict(self.rig))
        return super().settings() | {"rig": rig}

    def segment(self, index: int) -> Iterator[SegmentStep]:
        """Yield the truth and events of segment `index`, by the event camera's clock."""
        rig = self.rig_of(index)
        if isinstance(self.rig, str):
            self._same = None  # each is seen from a place of its own
        for step in super().segment(index):
            events = replace(step.events, t_us=_reading_us(rig, step.events.t_us))
            yield replace(step, t_us=int(_reading_us(rig, np.array([step.t_us]))[0]), events=events)

    def _camera_of(self, index: int) -> Camera:
        return self.rig_of(index).own


def _reading_us(rig: Rig, t_us: IntArray) -> IntArray:
    """What the event camera's clock shows (N,) at common times (N,) in µs."""
    return np.asarray(np.rint(1e6 * rig.reading(1e-6 * t_us.astype(np.float64))).astype(np.int64))
