"""Streams of scans as no sensor should send them, from a seed: what a hostile tester would write down.

A stream is a list of steps for `Tracker.step`. Vehicles cross the picture; between their scans stand gaps of
an hour, bursts, duplicates, boxes at the bounds of what is allowed, times one ulp apart, arrays of every
layout, and scans that must be refused.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.boxes import LARGEST_PX, SMALLEST_PX

REFUSED_SHARE = 0.15
#: Boxes of a burst, and how many in a hundred scans are one.
BURST, LARGE_BURST, BURST_SHARE = 300, 2000, 0.03
#: Bounds of boxes that are still within the bounds when rounded to 32 bits.
BOUNDS_32 = np.array([[-LARGEST_PX, -LARGEST_PX, 2 * SMALLEST_PX, 2 * SMALLEST_PX], [0.99 * LARGEST_PX] * 4])


class Step(NamedTuple):
    """One call of the tracker: a scan, and whether it must be refused."""

    scan: tuple[Any, ...]
    bad: bool


def stream(seed: int, sensors: tuple[str, ...], length: int, burst: int = BURST) -> list[Step]:
    """Make a stream of `length` steps, with now and then a burst of so many boxes."""
    rng = np.random.default_rng(seed)
    place, speed = rng.uniform(100, 900, (5, 2)), rng.normal(0, 80, (5, 2))
    t = float(rng.choice([0.0, -3.5, 1.7e9]))
    steps: list[Step] = []
    while len(steps) < length:
        before = t
        t = later(rng, t)
        place = place + speed * min(t - before, 1.0)
        sensor = str(rng.choice(sensors))
        if len(steps) and rng.random() < REFUSED_SHARE:
            steps.append(Step(refused(rng, t, before, sensor), bad=True))
        boxes = seen(rng, place, burst)
        scores = rng.choice([0.0, 1.0, 0.5, rng.random()], len(boxes))
        steps.append(Step((t, sensor, *laid_out(rng, boxes, scores)), bad=False))
    return steps[:length]


def settings(seed: int, sensors: tuple[str, ...], preset: str) -> list[str]:
    """Settings that a user may add: what is known of sensors, of the picture, and what is reported."""
    rng = np.random.default_rng(seed)
    drawn = [
        f"output.min_existence={rng.choice([0.0, 0.5, 0.999])}",
        f"output.clip={rng.choice(['true', 'false'])}",
        f"input.picture={rng.choice(['given', 'seen'])}",
        f"smoother.lag_s={rng.choice([1e-3, 0.1, 1.0, 1e4])}",
        f"smoother.output_rate_hz={rng.choice([0.0, 1.0, 20.0])}",
    ]
    if preset == "paper":
        return drawn + of_the_paper(rng)
    for name in sensors:
        drawn.append(f"sensors.{name}.even_score={rng.choice(['null', '1e-9', '0.5', '1.0'])}")
    return drawn


def of_the_paper(rng: np.random.Generator) -> list[str]:
    """Settings of the paper's own method."""
    return [
        f"paper.jerk_px={rng.choice([1e-3, 200.0, 1e4])}",
        f"paper.adaptation_rate={rng.choice([0.0, 0.1, 1.0])}",
        f"paper.score_floor={rng.choice([1e-3, 0.1, 1.0])}",
        f"paper.gate_probability={rng.choice([0.5, 0.99, 1.0 - 1e-12])}",
        f"paper.confirm_hits={rng.choice([1, 5, 50])}",
        f"paper.confirm_age_s={rng.choice([0.0, 0.5])}",
        f"paper.max_gap_confirmed_s={rng.choice([0.0, 0.5, 1e4])}",
        f"paper.max_gap_tentative_s={rng.choice([0.0, 0.2, 1e4])}",
    ]


def later(rng: np.random.Generator, t: float) -> float:
    """The next time: as a sensor's clock gives it, or nearly the same, or much later."""
    kind = rng.random()
    if kind < 0.7:
        return t + float(rng.choice([0.01, 0.05, 0.033]))
    if kind < 0.8:
        return float(np.nextafter(t, np.inf))
    if kind < 0.97:
        return t + float(rng.choice([1e-9, 1e-7, 1e-6, 3e-6, 1e-4]))
    return t + float(rng.choice([2.0, 60.0, 3600.0]))


def seen(rng: np.random.Generator, place: np.ndarray, burst: int) -> np.ndarray:
    """Boxes (M, 4) of the vehicles and of what is not there."""
    found = place[rng.random(len(place)) < 0.8]
    boxes = np.column_stack([found + rng.normal(0, 2, found.shape), np.full((len(found), 2), [60.0, 40.0])])
    kind = rng.random()
    if kind < 0.05:
        return boxes[:0]
    if kind < 0.10:
        return np.concatenate([boxes, boxes])
    if kind < 0.10 + BURST_SHARE:
        wild = np.column_stack([rng.uniform(-200, 1500, (burst, 2)), rng.lognormal(3, 1, (burst, 2))])
        return np.concatenate([boxes, wild])
    if kind < 0.20:
        big, small = LARGEST_PX, SMALLEST_PX
        wild = np.array([[-big, 0, 1, 1], [0, 0, big, big], [5, 5, small, small], [3000, -900, 40, 30]])
        return np.concatenate([boxes, wild[rng.random(4) < 0.5]])
    return boxes


def laid_out(rng: np.random.Generator, boxes: np.ndarray, scores: np.ndarray) -> tuple[Any, Any]:
    """The same numbers in another form."""
    forms = [
        lambda: (boxes.tolist(), scores.tolist()),
        lambda: (np.asfortranarray(boxes), scores[::-1][::-1]),
        lambda: (boxes.astype(">f8"), scores.astype(">f8")),
        lambda: (np.repeat(boxes, 2, axis=0)[::2], np.repeat(scores, 3)[::3]),
        lambda: (np.clip(boxes, BOUNDS_32[0], BOUNDS_32[1]).astype(np.float32), scores.astype(np.float32)),
        lambda: (boxes.astype(np.longdouble), scores.astype(np.float16)),
        lambda: (np.maximum(np.rint(boxes), [-np.inf, -np.inf, 1, 1]).astype(np.int64), scores > 0.5),
        lambda: (boxes.astype(object), tuple(scores.tolist())),
        lambda: (read_only(boxes), read_only(scores)),
        lambda: (boxes, scores),
    ]
    return forms[int(rng.integers(len(forms)))]()


def read_only(values: np.ndarray) -> np.ndarray:
    """A copy that nobody can write to."""
    copy = values.copy()
    copy.flags.writeable = False
    return copy


def refused(rng: np.random.Generator, t: float, before: float, sensor: str) -> tuple[Any, ...]:
    """A scan that no tracker should take."""
    good = [[10.0, 10.0, 5.0, 5.0]]
    choices: list[tuple[Any, ...]] = [
        (float("nan"), sensor, good, [0.5]),
        (before - 1.0, sensor, good, [0.5]),
        (t, "nobody", good, [0.5]),
        (t, sensor, [[0, 0, -1, 1]], [0.5]),
        (t, sensor, [[0, 0, 0, 1]], [0.5]),
        (t, sensor, [[float("inf"), 0, 1, 1]], [0.5]),
        (t, sensor, [[0, 0, 1e154, 1]], [0.5]),
        (t, sensor, [[0, 0, 1, 1e-160]], [0.5]),
        (t, sensor, good, [1.5]),
        (t, sensor, good, [float("nan")]),
        (t, sensor, [[1.0, 2.0, 3.0]], [0.5]),
        (t, sensor, good, [0.5, 0.5]),
        (t, sensor, [["a", "b", "c", "d"]], [0.5]),
        (float("inf"), sensor, good, [0.5]),
        (t, sensor, [[10.0, 10.0, 5.0, 5.0 + 1j]], [0.5]),
        (t, sensor, good, [-1e-300]),
        (t, sensor, [[1, 2, 3, 4], [5, 6, 7]], [0.5, 0.5]),
        (t, sensor, np.zeros((1, 4, 1)) + 5.0, [0.5]),
    ]
    return choices[int(rng.integers(len(choices)))]
