"""Small data sets that networks of a few thousand parameters learn in seconds."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.events import EventArray
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.io.events.dsec_writer import EventWriter
from jeat_graph.io.tables.truth_io import write_truth

SIZE = (64, 48)
FRAMES = 12


def boxes_at(t: float, segment: int) -> np.ndarray:
    """Two boxes (left, top, width, height) that move apart."""
    return np.array([[6.0 + 30.0 * t, 6.0 + segment, 14.0, 10.0], [40.0 - 25.0 * t, 28.0, 18.0, 12.0]])


def write_segment(folder, segment: int) -> None:
    """Pictures of bright boxes on a dark ground, events along their sides, and the truth."""
    import cv2

    rng = np.random.default_rng(segment)
    (folder / "frames").mkdir(parents=True)
    times = 0.1 + np.arange(FRAMES) * 0.05
    for k, t in enumerate(times):
        picture = rng.integers(10, 40, (SIZE[1], SIZE[0], 3)).astype(np.uint8)
        for left, top, width, height in boxes_at(t, segment).round().astype(int):
            picture[top : top + height, left : left + width] = 200
        cv2.imwrite(str(folder / "frames" / f"{k:06d}.png"), picture)
    rows = "".join(f"{k},{round(t * 1e6)}\n" for k, t in enumerate(times))
    (folder / "frames.csv").write_text("index,t_us\n" + rows, encoding="utf-8")
    boxes = np.concatenate([boxes_at(t, segment) for t in times])
    write_truth(
        GroundTruth(
            t=np.repeat(times, 2),
            object_id=np.tile([1, 2], FRAMES),
            boxes=boxes,
            motion=None,
            ignore=np.zeros(2 * FRAMES, dtype=bool),
            classes=None,
            distance=None,
            frames=times,
        ),
        folder / "gt.csv",
    )
    end_us = round(times[-1] * 1e6) + 1
    with EventWriter(folder / "events.h5", SIZE, "none") as writer:
        writer.append(_events(rng, segment, end_us), end_us)


def _events(rng: np.random.Generator, segment: int, end_us: int) -> EventArray:
    parts = []
    for start in range(0, end_us, 5000):
        for left, top, width, height in boxes_at(start / 1e6, segment):
            y = rng.integers(int(top), int(top + height), 24)
            right = rng.random(24) < 0.5
            x = np.where(right, left + width - 1, left).astype(int)
            parts.append(np.column_stack([rng.integers(start, start + 5000, 24), x, y, right]))
    table = np.concatenate(parts)
    table = table[(table[:, 0] < end_us) & (table[:, 1] >= 0) & (table[:, 1] < SIZE[0])]
    table = table[np.argsort(table[:, 0], kind="stable")]
    return EventArray(
        table[:, 0], *(table[:, k].astype(kind) for k, kind in ((1, "u2"), (2, "u2"), (3, "u1")))
    )
