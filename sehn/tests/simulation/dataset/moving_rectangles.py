"""A tiny source of pictures: rectangles that move to the right, with events at their front edges."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from jeat_graph.data.events import EventArray
from jeat_graph_sehn.simulation.segment import FrameTruth, SegmentStep

PERIOD_US = 50_000


@dataclass(frozen=True)
class MovingRectangles:
    """Vehicles of 10 x 6 px at 40 px/s, one a row of the picture.

    `fail_at` is the segment in which the source breaks down after two frames; with `dies`, its whole process.
    `wait_at` is the segment in which it says so after two frames, and waits for whoever ends the process.
    """

    seed: int = 0
    frames: int = 4
    vehicles: int = 2
    with_events: bool = True
    with_labels: bool = True
    fail_at: int | None = None
    dies: bool = False
    wait_at: int | None = None

    @property
    def size_px(self) -> tuple[int, int]:
        return 64, 48

    def calibration(self) -> dict[str, Any]:
        return {"width": 64, "height": 48, "fx": 50.0, "position_m": [0.0, 0.0, 5.0]}

    def calibration_of(self, index: int) -> dict[str, Any]:
        return self.calibration()

    def settings(self) -> dict[str, Any]:
        return {"source": "rectangles", "seed": self.seed, "frames": self.frames, "vehicles": self.vehicles}

    def segment(self, index: int) -> Iterator[SegmentStep]:
        rng = np.random.default_rng([self.seed, index])
        start = rng.uniform(0.0, 30.0, self.vehicles)
        for k in range(self.frames):
            if index == self.wait_at and k == 2:
                print("waiting", flush=True)
                time.sleep(1e6)
            if index == self.fail_at and k == 2:
                if self.dies:
                    os._exit(9)
                raise RuntimeError("the power is gone")
            t_us = PERIOD_US * (k + 1) + int(rng.integers(-500, 500))
            truth = self._truth(start + 40.0 * t_us / 1e6)
            rgb = rng.integers(0, 20, (48, 64, 3), dtype=np.uint8)
            for left, top, width, height in truth.boxes.astype(int):
                rgb[top : top + height, left : left + width] = (200, 150, 100)
            yield SegmentStep(t_us, rgb, self._events(rng, t_us, truth), truth)

    def _truth(self, left: np.ndarray) -> FrameTruth:
        n = self.vehicles
        top = 2.0 + 8.0 * np.arange(n)
        boxes = np.stack([left, top, np.full(n, 10.0), np.full(n, 6.0)], axis=1)
        centre = boxes[:, :2] + boxes[:, 2:] / 2
        motion = np.concatenate([centre, np.tile([40.0, 0.0, 0.0, 0.0], (n, 1))], axis=1)
        return FrameTruth(
            object_id=np.arange(1, n + 1),
            class_name=np.array(["car", "truck", "van", "suv"])[np.arange(n) % 4],
            boxes=boxes,
            visible=np.where(np.arange(n) % 2 == 0, 1.0, 0.05),
            motion=motion,
            size=np.tile([4.0, 2.0, 1.5], (n, 1)),
            pose=np.stack([left / 2, np.full(n, 30.0), np.full(n, 0.75), *np.zeros((3, n))], axis=1),
            velocity=np.tile([20.0, 0.0, 0.0], (n, 1)),
        )

    def _events(self, rng: np.random.Generator, t_us: int, truth: FrameTruth) -> EventArray:
        if not self.with_events or not len(truth):
            return EventArray.empty()
        n = 30
        box = truth.boxes[rng.integers(0, len(truth), n)]
        return EventArray(
            np.sort(rng.integers(t_us - PERIOD_US + 1000, t_us + 1, n)),
            (box[:, 0] + 9).astype(np.uint16),
            (box[:, 1] + rng.integers(0, 6, n)).astype(np.uint16),
            rng.integers(0, 2, n).astype(np.uint8),
            rng.random(n) < 0.9 if self.with_labels else None,
        )


if __name__ == "__main__":
    import sys
    from functools import partial

    from jeat_graph_sehn.simulation.dataset.protocol import Protocol
    from jeat_graph_sehn.simulation.dataset.recording import record_dataset

    factory = partial(MovingRectangles, wait_at=int(sys.argv[3]))
    record_dataset(factory, sys.argv[1], Protocol(int(sys.argv[2]), video="png"))
