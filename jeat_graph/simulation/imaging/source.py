"""Segments from our own renderer."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np

from jeat_graph.config.section_tree import plain
from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import ConfigError
from jeat_graph.simulation.imaging.config import ImagingConfig
from jeat_graph.simulation.imaging.event_camera import EventCamera
from jeat_graph.simulation.imaging.renderer import Renderer
from jeat_graph.simulation.imaging.rgb_camera import choose_exposure, develop, electrons, expose
from jeat_graph.simulation.imaging.scaling import scaled_camera
from jeat_graph.simulation.imaging.truth import frame_truth
from jeat_graph.simulation.imaging.visibility import buffers
from jeat_graph.simulation.scenario import Scenario
from jeat_graph.simulation.segment import SegmentStep
from jeat_graph.simulation.streams import stream
from jeat_graph.simulation.world.camera import Camera
from jeat_graph.simulation.world.scene import Scene


class RenderedSource:
    """Pictures of a simulated highway; a `SegmentSource`."""

    def __init__(
        self, scenario: Scenario, imaging: ImagingConfig | None = None, seed: int = 0, frames: int = 100
    ) -> None:
        """Prepare; nothing is rendered yet.

        Args:
            scenario: road, traffic, light and camera; its camera is scaled to the picture's size.
            imaging: renderer and cameras.
            seed: of all segments.
            frames: RGB frames a segment.

        Raises:
            ConfigError: a negative seed, or no frames.
        """
        if seed < 0:
            raise ConfigError(f"seed: must not be negative, got {seed}")
        if frames < 1:
            raise ConfigError(f"frames: must be at least 1, got {frames}")
        self.scenario = scenario
        self.imaging = imaging or ImagingConfig()
        self.seed = seed
        self.frames = frames
        render = self.imaging.render
        self.camera_config = scaled_camera(scenario.camera, render.width, render.height)
        self.camera = Camera.mounted(self.camera_config)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the pictures."""
        return self.camera.width, self.camera.height

    def calibration(self) -> dict[str, Any]:
        """Return the camera's calibration as plain values."""
        return self.camera.to_dict()

    def settings(self) -> dict[str, Any]:
        """Return all settings as plain values; with the index they define a segment."""
        return {
            "source": "rendered",
            "seed": self.seed,
            "frames": self.frames,
            "scenario": plain(dataclasses.asdict(self.scenario)),
            "imaging": plain(dataclasses.asdict(self.imaging)),
        }

    def scene(self, index: int) -> Scene:
        """Build the scene of segment `index`, with traffic of its own."""
        s = self.scenario
        duration = (self.frames + 1) / self.imaging.rgb.rate_hz + 1.0
        return Scene.build(
            self._segment_seed(index), duration, s.road, s.fleet, s.traffic, s.light, self.camera_config
        )

    def frame_times_us(self, index: int) -> IntArray:
        """Times of the frames of segment `index` (µs): the nominal ones with jitter, ascending."""
        config = self.imaging.rgb
        period = 1.0 / config.rate_hz
        rng = stream(self.seed, f"segment.{index}.clock")
        jitter = np.clip(config.jitter_s * rng.standard_normal(self.frames), -0.4 * period, 0.4 * period)
        return np.round(1e6 * (period * np.arange(1, self.frames + 1) + jitter)).astype(np.int64)

    def segment(self, index: int) -> Iterator[SegmentStep]:
        """Yield the frames of segment `index`."""
        scene = self.scene(index)
        seed = self._segment_seed(index)
        config = self.imaging
        renderer = Renderer(scene, config.render, seed)
        exposure = choose_exposure(config.rgb, renderer.background.whole)
        scale = exposure.scale(config.rgb)
        event_camera = EventCamera(renderer, config, self.seed, seed, scale)
        noise = stream(seed, "rgb.noise")
        ground = renderer.background
        least = self.scenario.truth.min_side_px * self.camera.width / self.scenario.camera.width
        for t_us in self.frame_times_us(index):
            time = np.array([1e-6 * t_us])
            events = event_camera.advance(int(t_us))
            radiance = expose(renderer, float(time[0]), exposure.time_s, config.rgb.readout_s)
            charge = electrons(radiance, exposure.time_s, config.rgb, noise)
            look = renderer.plan(float(time[0]), float(time[0])).look
            moments = renderer.moments(time, look)
            _, _, visible = buffers(moments, look, ground.front_depth, ground.front_cover)
            states = scene.states_at(time, far_m=self.scenario.truth.horizon_m)
            seen = visible[np.searchsorted(look.number, states.object_id)]
            yield SegmentStep(
                t_us=int(t_us),
                rgb=develop(charge, exposure.gain, config.rgb),
                events=events,
                truth=frame_truth(states, self.camera, seen, least),
            )

    def _segment_seed(self, index: int) -> int:
        return int(stream(self.seed, f"segment.{index}").integers(0, 2**62))
