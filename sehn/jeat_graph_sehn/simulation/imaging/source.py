"""Makes the pictures, events and truth of a segment with the built-in renderer."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.config.section_tree import plain
from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.events import EventArray
from jeat_graph_sehn.simulation.imaging.config import ImagingConfig, RenderConfig
from jeat_graph_sehn.simulation.imaging.contrast import contrast_to_noise, tight_boxes
from jeat_graph_sehn.simulation.imaging.event_camera import EventCamera
from jeat_graph_sehn.simulation.imaging.lens import Lens
from jeat_graph_sehn.simulation.imaging.lens_config import LensConfig
from jeat_graph_sehn.simulation.imaging.lens_events import LensEventCamera
from jeat_graph_sehn.simulation.imaging.lens_views import Blocked, photograph
from jeat_graph_sehn.simulation.imaging.renderer import Renderer
from jeat_graph_sehn.simulation.imaging.rgb_camera import choose_exposure, develop, electrons
from jeat_graph_sehn.simulation.imaging.scaling import scaled_camera
from jeat_graph_sehn.simulation.imaging.truth import ImageViews, frame_truth
from jeat_graph_sehn.simulation.imaging.visibility import buffers
from jeat_graph_sehn.simulation.lens_variety import vary_insects, vary_lens, vary_wet
from jeat_graph_sehn.simulation.scenario import Scenario
from jeat_graph_sehn.simulation.segment import SegmentStep
from jeat_graph_sehn.simulation.streams import stream
from jeat_graph_sehn.simulation.variety import vary
from jeat_graph_sehn.simulation.world.camera import Camera
from jeat_graph_sehn.simulation.world.scene import Scene
from jeat_graph_sehn.simulation.world.surroundings import FIXED, Surroundings

# Settings that came after the first recordings: they are stated where they are not as they were then.
_LATER = (
    *("wet", "indicator_candela", "lamp_flicker", "lamp_flicker_hz", "led_pulse_hz", "led_pulse_share"),
    "insects_hz",
)
_BEFORE = 2  # periods before the first frame, so that it has all the events of its own before it
FIXED_WORLD, VARIED, NEAR = "fixed", "varied", "near"
WORLDS = (FIXED_WORLD, VARIED, NEAR)
SENSORS = ("pictures", "rgb", "events")


class RenderedSource:
    """Pictures of a simulated highway; a `SegmentSource`."""

    def __init__(
        self,
        scenario: Scenario,
        imaging: ImagingConfig | None = None,
        seed: int = 0,
        frames: int = 100,
        world: str = "fixed",
        sensors: str = "pictures",
        traffic: int = 0,
        masks: bool = False,
    ) -> None:
        """Prepare; nothing is rendered yet.

        Args:
            scenario: road, traffic, light and camera; its camera is scaled to the picture's size.
            imaging: renderer and cameras.
            seed: of all segments.
            frames: RGB frames a segment.
            world: `fixed`, the same road and camera in all segments; `varied`, one a segment; or `near`, one
                a segment, with the camera beside the road and turned to it.
            sensors: `pictures` for both; `rgb` leaves events out, `events` makes black pictures.
            traffic: other numbers have the same worlds with other vehicles and other noise in them.
            masks: whether each step has a mask of its vehicles.

        Raises:
            ConfigError: a negative seed, no frames, or no such world or sensors.
        """
        if seed < 0:
            raise ConfigError(f"seed: must not be negative, got {seed}")
        if frames < 1:
            raise ConfigError(f"frames: must be at least 1, got {frames}")
        if world not in WORLDS:
            raise ConfigError(f"world: must be one of {', '.join(WORLDS)}, not {world!r}")
        if sensors not in SENSORS:
            raise ConfigError(f"sensors: must be one of {', '.join(SENSORS)}, not {sensors!r}")
        self.world, self.sensors, self.traffic, self.masks = world, sensors, traffic, masks
        self.scenario = scenario
        self.imaging = imaging or ImagingConfig()
        self.seed = seed
        self.frames = frames
        render = self.imaging.render
        self.camera_config = scaled_camera(scenario.camera, render.width, render.height)
        self.camera = Camera.mounted(self.camera_config)
        self._same: Renderer | None = None  # of any segment, where all have one place in common

    @property
    def _drawn(self) -> bool:
        """Whether each segment has a world of its own."""
        return self.world != FIXED_WORLD

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the pictures."""
        return self.camera.width, self.camera.height

    def calibration(self) -> dict[str, Any]:
        """Return the camera's calibration as plain values."""
        return self._with_lens(self.camera.to_dict(), self.imaging)

    def settings(self) -> dict[str, Any]:
        """Return all settings as plain values; with the index they define a segment."""
        return {
            "source": "rendered",
            "seed": self.seed,
            "frames": self.frames,
            "world": self.world,
            "sensors": self.sensors,
            **({"traffic": self.traffic} if self.traffic else {}),
            **({"masks": True} if self.masks else {}),
            "scenario": plain(dataclasses.asdict(self.scenario)),
            "imaging": _stated(self.imaging),
        }

    @staticmethod
    def _with_lens(calibration: dict[str, Any], imaging: ImagingConfig) -> dict[str, Any]:
        lens = imaging.lens
        return calibration | ({"k1": lens.k1, "k2": lens.k2} if lens.k1 or lens.k2 else {})

    def calibration_of(self, index: int) -> dict[str, Any]:
        """Return the calibration of segment `index`, which has a camera of its own in varied worlds."""
        scene, imaging, _ = self._build(index)
        return self._with_lens(scene.camera.to_dict(), imaging)

    def scene(self, index: int) -> Scene:
        """Build the scene of segment `index`, with traffic of its own, and a world where they vary."""
        return self._build(index)[0]

    def _world(self, index: int) -> tuple[Scenario, ImagingConfig, Surroundings]:
        """Settings of segment `index`: drawn where worlds vary."""
        s, imaging, around = self.scenario, self.imaging, FIXED
        if self._drawn:
            # Each light has worlds and traffic of its own, so that a net cannot learn one from the other.
            light = f"{s.light.ambient_lux:g}.{s.light.lamp_candela:g}.{s.light.lit_share:g}"
            rng = stream(self.seed, f"segment.{index}.world.{light}")
            s, imaging, around = vary(rng, s, imaging, near=self.world == NEAR)
            rng = stream(self.seed, f"segment.{index}.lens.{light}")
            imaging = replace(imaging, lens=vary_lens(rng, imaging.lens, s.camera))
            imaging = replace(imaging, render=vary_insects(rng, vary_wet(rng, imaging.render)))
        return s, imaging, around

    def _camera_of(self, index: int) -> Camera:
        """The camera through which segment `index` is seen."""
        s, imaging, _ = self._world(index)
        return Camera.mounted(scaled_camera(s.camera, imaging.render.width, imaging.render.height))

    def _build(self, index: int) -> tuple[Scene, ImagingConfig, Scenario]:
        s, imaging, around = self._world(index)
        seed = self._segment_seed(index)
        duration = (self.frames + _BEFORE) / imaging.rgb.rate_hz + 1.0
        camera = scaled_camera(s.camera, imaging.render.width, imaging.render.height)
        scene = Scene.build(seed, duration, s.road, s.fleet, s.traffic, s.light, camera)
        return replace(scene, around=around, camera=self._camera_of(index)), imaging, s

    def frame_times_us(self, index: int) -> IntArray:
        """Times of the frames of a segment (µs): nominal ones with jitter, the first after two periods."""
        config = self.imaging.rgb
        period = 1.0 / config.rate_hz
        rng = stream(self.seed, f"segment.{index}.clock")
        jitter = np.clip(config.jitter_s * rng.standard_normal(self.frames), -0.4 * period, 0.4 * period)
        return np.round(1e6 * (period * np.arange(_BEFORE, _BEFORE + self.frames) + jitter)).astype(np.int64)

    def segment(self, index: int) -> Iterator[SegmentStep]:
        """Yield the frames of segment `index`."""
        scene, config, scenario = self._build(index)
        seed, camera = self._segment_seed(index), scene.camera
        lens = None
        if config.lens != LensConfig():
            lens = Lens(config.lens, camera, stream(seed, "lens"))
            scene = replace(scene, camera=lens.canvas)
        renderer = Renderer(scene, config.render, seed, self._drawn, like=self._same)
        if lens is None and not self._drawn:
            self._same = renderer
        exposure = choose_exposure(config.rgb, renderer.background.whole)
        eye: EventCamera | LensEventCamera | None = None
        if self.sensors != "rgb":
            if lens is None:
                eye = EventCamera(renderer, config, self.seed, seed, exposure.scale(config.rgb))
            else:
                eye = LensEventCamera(renderer, lens, config, self.seed, seed)
        noise = stream(seed, "rgb.noise")
        least = scenario.truth.min_side_px * camera.width / scenario.camera.width
        black = np.zeros((camera.height, camera.width, 3), dtype=np.uint8)
        blocked = Blocked.of(renderer.background, lens)
        for t_us in self.frame_times_us(index):
            time = np.array([1e-6 * t_us])
            events = EventArray.empty(labelled=True) if eye is None else eye.advance(int(t_us))
            rgb, radiance = black, None
            if self.sensors != "events":
                radiance, seen = photograph(renderer, lens, float(time[0]), exposure, config.rgb)
                charge = electrons(seen, exposure.time_s, config.rgb, noise)
                rgb = develop(charge, exposure.gain, config.rgb)
            look, moments = renderer.seen_at(float(time[0]))
            _, instance, visible = buffers(moments, look, blocked.depth, blocked.cover)
            tight = tight_boxes(moments, (scene.camera.width, scene.camera.height))
            contrast = np.full(len(look.number), np.nan)
            if radiance is not None:
                contrast = contrast_to_noise(
                    radiance, instance, look.number, tight, exposure.time_s, config.rgb
                )
            if lens is not None:
                tight = lens.boxes(tight, float(time[0]))
            states = scene.states_at(time, far_m=config.render.far_m)
            row = np.searchsorted(look.number, states.object_id)
            views = ImageViews(visible[row], tight[row], contrast[row])
            seen_by = camera if lens is None else lens.camera_at(float(time[0]))
            truth = frame_truth(states, seen_by, views, least, scenario.truth.range_m)
            mask = _mask(instance, lens, float(time[0])) if self.masks else None
            yield SegmentStep(t_us=int(t_us), rgb=rgb, events=events, truth=truth, mask=mask)

    def _segment_seed(self, index: int) -> int:
        other = f".traffic.{self.traffic}" if self.traffic else ""
        return int(stream(self.seed, f"segment.{index}{other}").integers(0, 2**62))


def _mask(instance: IntArray, lens: Lens | None, time_s: float) -> npt.NDArray[np.uint16]:
    """Identities as the pixels see them; those of a segment fit in 16 bit."""
    seen = instance if lens is None else lens.nearest(instance, time_s)
    return seen.astype(np.uint16)


def _stated(imaging: ImagingConfig) -> dict[str, Any]:
    """Return settings as plain values; of the lens and of water only if there is any."""
    tree = plain(dataclasses.asdict(imaging))
    assert isinstance(tree, dict)
    if imaging.lens == LensConfig():
        del tree["lens"]
    for name in _LATER:
        if getattr(imaging.render, name) == getattr(RenderConfig(), name):
            del tree["render"][name]
    return tree
