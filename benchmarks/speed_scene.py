"""Synthetic detections for timing: many small boxes on straight paths over one large picture.

Every tracker under test must be able to hold its tracks, so that all of them do the same work: boxes move
a small part of their width between frames, are seldom missed, and clutter has low scores. A box that leaves
the picture comes back as a new object on the other side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import FloatArray

# A 4K picture, on which a thousand boxes find room without covering each other for long.
WIDTH_PX = 3840.0
HEIGHT_PX = 2160.0


@dataclass(frozen=True, eq=False)
class Frame:
    """Detections of one scan.

    Attributes:
        t: time (s).
        boxes: (M, 4) left, top, width, height (px).
        scores: (M,) confidence in [0, 1].
    """

    t: float
    boxes: FloatArray
    scores: FloatArray


class SpeedScene:
    """Objects on straight paths, seen by any number of simulated detectors.

    Args:
        num_objects: how many objects are in the picture at any time.
        seed: of the paths.
    """

    def __init__(self, num_objects: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.num_objects = num_objects
        # A jittered grid spreads the first positions, so that few boxes overlap at the start.
        columns = int(np.ceil(np.sqrt(num_objects * WIDTH_PX / HEIGHT_PX)))
        rows = int(np.ceil(num_objects / columns))
        cell = rng.permutation(columns * rows)[:num_objects]
        grid = np.stack((cell % columns, cell // columns), axis=1) + rng.uniform(0.2, 0.8, (num_objects, 2))
        self._span = np.array([WIDTH_PX, HEIGHT_PX])
        self._start = grid / np.array([columns, rows]) * self._span
        # Mostly along the picture, as traffic runs; both directions.
        speed = rng.uniform(40.0, 160.0, num_objects) * rng.choice((-1.0, 1.0), num_objects)
        self._velocity = np.stack((speed, 0.2 * speed * rng.uniform(-1.0, 1.0, num_objects)), axis=1)
        width = rng.uniform(30.0, 60.0, num_objects)
        self._size = np.stack((width, width * rng.uniform(0.7, 0.9, num_objects)), axis=1)

    def boxes(self, t: float) -> FloatArray:
        """True boxes (num_objects, 4) left, top, width, height at time `t` (s)."""
        centre = (self._start + self._velocity * t) % self._span
        return np.concatenate((centre - 0.5 * self._size, self._size), axis=1)

    def scan(
        self, t: float, rng: np.random.Generator, p_detect: float = 0.95, clutter_share: float = 0.03
    ) -> Frame:
        """Detect the objects at one time.

        Args:
            t: time (s).
            rng: source of the detector's noise.
            p_detect: probability that an object is detected.
            clutter_share: expected number of false boxes, as a share of the number of objects.
        """
        true = self.boxes(t)
        centre = true[:, :2] + 0.5 * true[:, 2:]
        seen = rng.random(len(true)) < p_detect
        size = true[seen, 2:] * np.exp(0.03 * rng.standard_normal((int(seen.sum()), 2)))
        centre = centre[seen] + 0.02 * size * rng.standard_normal(size.shape)
        num_false = rng.poisson(clutter_share * self.num_objects)
        false_size = rng.uniform(25.0, 60.0, (num_false, 2))
        false_centre = rng.random((num_false, 2)) * self._span
        size = np.concatenate((size, false_size))
        centre = np.concatenate((centre, false_centre))
        scores = np.concatenate((rng.uniform(0.75, 0.97, int(seen.sum())), rng.uniform(0.2, 0.45, num_false)))
        order = rng.permutation(len(scores))
        boxes = np.concatenate((centre - 0.5 * size, size), axis=1)
        return Frame(t=t, boxes=np.ascontiguousarray(boxes[order]), scores=scores[order])


def make_frames(num_objects: int, num_frames: int, rate_hz: float, seed: int) -> list[Frame]:
    """Frames of one sensor at `rate_hz`, from time 0."""
    scene = SpeedScene(num_objects, seed)
    rng = np.random.default_rng((seed, 1))
    return [scene.scan(k / rate_hz, rng) for k in range(num_frames)]
