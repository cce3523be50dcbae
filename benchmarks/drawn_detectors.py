"""Draws two more detectors for a recording with truth: an ordinary one, and one precise but not accurate.

What joining sensors has to stand is a matter of kinds, not of examples, so each draw has its own parameters.

========  ====================================================================================================
`second`  P_D 0.8, boxes that jitter by 8 % of the size, good scores, and three still false things with scores
          as good
`third`   boxes that hardly jitter, but each object's lies off by an error that lasts and by one that wanders;
          it finds still false things, at the same pixels again and again, some of them `second`'s
========  ====================================================================================================

A draw may change one more thing (`WAYS`): the false things of `third` move, it sees only the nearer half or
the farther half of the objects, or its scores mean nothing.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.recordings import JudgedRecording
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.scan import Scan

SECOND, THIRD = "second", "third"
#: What is different of a draw, beside its parameters.
WAYS = ("still", "moving", "near", "far", "scores")
#: Of `second`: P_D, jitter (shares of the size), jitter of its false things, how many, and how often seen.
_SECOND_P, _SECOND_JITTER, _FALSE_JITTER, _FALSE, _FALSE_P = 0.8, 0.08, 0.05, 3, 0.7
#: Of `third`: the logarithm of its sides is off by this in the mean; time constant of its error (s).
_SMALLER, _WANDER_S = -0.08, 0.8
#: Truth belongs to a scan that is no farther from it than this (s).
_SAME_S = 1e-3
#: A false thing that moves crosses the picture in so long (s).
_CROSSING_S = 20.0


class Draw(NamedTuple):
    """The parameters of a draw.

    Attributes:
        way: of `WAYS`.
        seed: of what is drawn.
        jitter: of `third`'s boxes from scan to scan, as a share of the size.
        bias: standard deviation of its lasting error, as a share of the size.
        wander: of the error that wanders.
        junk: how many false things it finds beside those that it shares.
        shared: share of `second`'s false things that it finds too.
        p: its P_D.
    """

    way: str
    seed: int
    jitter: float
    bias: float
    wander: float
    junk: int
    shared: float
    p: float


def drawn_parameters(recording: str, number: int) -> Draw:
    """Draw the parameters of a draw from a recording's name and the draw's number."""
    name = int(hashlib.sha256(recording.encode()).hexdigest()[:8], 16)
    rng = np.random.default_rng([name, number])
    return Draw(
        WAYS[number % len(WAYS)],
        int(rng.integers(1, 1_000_000)),
        float(np.exp(rng.uniform(np.log(0.005), np.log(0.05)))),
        float(rng.uniform(0.0, 0.25)),
        float(rng.uniform(0.0, 0.15)),
        int(rng.integers(0, 13)),
        float(rng.uniform(0.0, 1.0)),
        float(rng.uniform(0.2, 0.9)),
    )


class _World:
    """What `second` and `third` see of a recording's objects, and what they see that is not there.

    Args:
        boxes: (N, 4) of all objects at all times, for their sizes and the part of the picture they are in.
        draw: its parameters.
    """

    def __init__(self, boxes: FloatArray, draw: Draw) -> None:
        self._rng, self._draw = np.random.default_rng(draw.seed), draw
        sizes = np.sqrt(boxes[:, 2] * boxes[:, 3])
        self._size = float(np.median(sizes))
        self._begin, self._end = boxes[:, :2].min(axis=0), (boxes[:, :2] + boxes[:, 2:]).max(axis=0)
        self._false = self._things(_FALSE)
        shared = self._rng.random(_FALSE) < draw.shared
        own = self._things(draw.junk)
        self._junk = np.concatenate([self._false[shared], own])
        self._junk_scores = self._rng.uniform(0.1, 0.45, len(self._junk))
        self._junk_speed = (
            self._rng.normal(size=(len(self._junk), 2)) * (self._end - self._begin) / _CROSSING_S
        )
        self._lasting: dict[int, tuple[FloatArray, float]] = {}
        self._wander: dict[int, tuple[FloatArray, float]] = {}

    def look(self, t: float, boxes: FloatArray, objects: IntArray) -> tuple[Scan, Scan]:
        """Return the scans of both at a time (s), given the objects (N,) and their boxes (N, 4)."""
        return self._second(t, boxes), self._third(t, boxes, objects)

    def _second(self, t: float, boxes: FloatArray) -> Scan:
        rng = self._rng
        seen = boxes[rng.random(len(boxes)) < _SECOND_P]
        false = self._false[rng.random(_FALSE) < _FALSE_P]
        found = [self._moved(seen, _SECOND_JITTER), self._moved(false, _FALSE_JITTER)]
        scores = [np.clip(rng.beta(9.0, 1.0, len(seen)), 0.5, 0.999), rng.uniform(0.6, 0.97, len(false))]
        return Scan(t, SECOND, np.concatenate(found), np.concatenate(scores))

    def _third(self, t: float, boxes: FloatArray, objects: IntArray) -> Scan:
        rng, draw = self._rng, self._draw
        errors = np.array([self._error(int(one), t) for one in objects]).reshape(-1, 5)
        seen = rng.random(len(boxes)) < draw.p
        if draw.way in ("near", "far"):
            larger = np.sqrt(boxes[:, 2] * boxes[:, 3]) > self._size
            seen &= larger == (draw.way == "near")
        scores = np.clip(errors[seen, 4] + rng.normal(0.0, 0.05, int(seen.sum())), 0.05, 0.99)
        again = rng.random(len(self._junk)) < _FALSE_P
        junk, level = self._junk[again].copy(), self._junk_scores[again]
        if draw.way == "moving":
            span = self._end - self._begin
            moved = junk[:, :2] - self._begin + t * self._junk_speed[again]
            junk[:, :2] = self._begin + np.mod(moved, span)
        level = np.clip(level + rng.normal(0.0, 0.04, len(level)), 0.03, 0.6)
        found = [
            self._moved(boxes[seen], draw.jitter, errors[seen, :4]),
            self._moved(junk, 0.5 * draw.jitter),
        ]
        scores = np.concatenate([scores, level])
        if draw.way == "scores":
            scores = rng.uniform(0.05, 0.95, len(scores))
        return Scan(t, THIRD, np.concatenate(found), scores)

    def _error(self, one: int, t: float) -> FloatArray:
        """Error of `third` on an object now: place in sizes (2), log size (2), and its mean score."""
        rng, draw = self._rng, self._draw
        if one not in self._lasting:
            error = rng.normal([0.0, 0.0, _SMALLER, _SMALLER], draw.bias)
            self._lasting[one] = error, float(rng.uniform(0.3, 0.8))
            self._wander[one] = rng.normal(0.0, draw.wander, 4), t
        wander, last = self._wander[one]
        keep = np.exp(-(t - last) / _WANDER_S)
        wander = keep * wander + np.sqrt(1.0 - keep * keep) * rng.normal(0.0, draw.wander, 4)
        self._wander[one] = wander, t
        error, score = self._lasting[one]
        return np.append(error + wander, score)

    def _things(self, count: int) -> FloatArray:
        """Draw false things (count, 4) within the part of the picture that objects are in."""
        side = self._size * np.exp(self._rng.normal(0.0, 0.4, count))
        sides = np.column_stack([1.2 * side, side / 1.2])
        room = np.maximum(self._end - sides, self._begin + 1.0) - self._begin
        return np.column_stack([self._begin + room * self._rng.random((count, 2)), sides])

    def _moved(self, boxes: FloatArray, jitter: float, errors: FloatArray | None = None) -> FloatArray:
        """Boxes (N, 4) with noise, and with errors (N, 4) in place (sizes) and log size."""
        noise = self._rng.normal(0.0, jitter, boxes.shape) + (0.0 if errors is None else errors)
        sides = boxes[:, 2:] * np.exp(noise[:, 2:])
        centre = boxes[:, :2] + boxes[:, 2:] * (0.5 + noise[:, :2])
        return np.column_stack([centre - 0.5 * sides, sides])


def with_drawn_detectors(one: JudgedRecording, draw: Draw) -> JudgedRecording:
    """Add what `second` and `third` see, at all times of the recording's scans.

    Returns:
        The recording with both; its truth as before.
    """
    counted = ~one.truth.ignore
    t, boxes, objects = one.truth.t[counted], one.truth.boxes[counted], one.truth.object_id[counted]
    world = _World(boxes, draw)
    new: list[Scan] = []
    for now in np.unique(one.detections.scan_t):
        here = np.abs(t - now) < _SAME_S
        new += world.look(float(now), boxes[here], objects[here])
    scans = sorted([*one.detections.scans(), *new], key=lambda scan: scan.t)
    return replace(one, name=f"{one.name}#{draw.seed}", detections=Detections.from_scans(scans))
