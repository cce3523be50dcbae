"""Recordings whose every parameter is known."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth

SIGMA, RHO, LOG_SIGMA = 1.2, 0.03, 0.06
BIAS = (0.05, -0.04, 0.06, -0.03)
P_DETECT, CLUTTER = 0.85, 0.5


def recording(
    seed: int = 0,
    duration_s: float = 20.0,
    rate_hz: float = 20.0,
    lanes: int = 6,
    sensor: str = "rgb",
    bias: tuple[float, float, float, float] = BIAS,
) -> tuple[Detections, GroundTruth]:
    """Vehicles drive through a 1280 x 720 picture in lanes that do not overlap, one after the other."""
    rng = np.random.default_rng(seed)
    frames = np.arange(int(duration_s * rate_hz)) / rate_hz
    t, ids, boxes = [], [], []
    number = 0
    for lane in range(lanes):
        start = rng.uniform(-6.0, 0.0)
        while start < duration_s:
            speed = rng.uniform(150.0, 300.0)
            width, height = rng.uniform(40.0, 110.0), rng.uniform(40.0, 90.0)
            here = frames[(frames >= start) & (frames < start + (1280.0 - width) / speed)]
            left = speed * (here - start)
            top = np.full(len(here), 20.0 + 115.0 * lane)
            t.append(here)
            ids.append(np.full(len(here), number))
            boxes.append(np.column_stack([left, top, np.full(len(here), width), np.full(len(here), height)]))
            number += 1
            start += (1280.0 - width) / speed + rng.uniform(0.2, 1.0)
    every_t, every_id, every_box = (np.concatenate(part) for part in (t, ids, boxes))
    truth = GroundTruth(
        t=every_t,
        object_id=every_id.astype(np.int64),
        boxes=every_box,
        motion=None,
        ignore=np.zeros(len(every_t), dtype=bool),
        frames=frames,
    )
    return detect(rng, truth, sensor, bias), truth


def detect(rng: np.random.Generator, truth: GroundTruth, sensor: str, bias: tuple[float, ...]) -> Detections:
    """Detect with the module's noise, P_D and clutter; true boxes tend to have the higher scores."""
    frames = truth.frame_times()
    seen = rng.random(len(truth)) < P_DETECT
    box = truth.boxes[seen]
    side = box[:, 2:]
    centre = box[:, :2] + 0.5 * side + np.array(bias[:2]) * side
    centre += rng.normal(size=side.shape) * np.sqrt(SIGMA**2 + (RHO * side) ** 2)
    size = side * np.exp(np.array(bias[2:]) + LOG_SIGMA * rng.normal(size=side.shape))
    found = np.hstack([centre - 0.5 * size, size])
    count = rng.poisson(CLUTTER, len(frames))
    total = int(count.sum())
    w, h = rng.uniform(40.0, 110.0, total), rng.uniform(40.0, 90.0, total)
    false = np.column_stack([rng.uniform(0, 1280 - w), rng.uniform(0, 720 - h), w, h])
    rows_t = np.concatenate([truth.t[seen], np.repeat(frames, count), frames])
    empty = np.arange(len(rows_t)) >= len(found) + total
    return Detections.from_rows(
        t=rows_t,
        sensor=np.full(len(rows_t), sensor),
        boxes=np.vstack([found, false, np.full((len(frames), 4), np.nan)]),
        scores=np.concatenate(
            [rng.beta(6, 2, len(found)), rng.beta(2, 4, total), np.full(len(frames), np.nan)]
        ),
        empty=empty,
    )
