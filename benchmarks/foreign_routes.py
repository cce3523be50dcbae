"""Routes over flat ground: a crossing with a light, a street, a square, a roundabout, and who uses them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import FloatArray


@dataclass(frozen=True)
class Kind:
    """What moves.

    Attributes:
        size_m: length, width and height (m).
        speed: least and greatest usual speed (m/s).
        acceleration: greatest (m/s²).
        every_s: mean time between two on a route (s).
        pauses: whether it stops now and then, and nobody keeps a distance to it.
    """

    size_m: tuple[float, float, float]
    speed: tuple[float, float]
    acceleration: float
    every_s: float
    pauses: bool = False


CAR = Kind((4.4, 1.8, 1.5), (8.0, 14.0), 2.0, 3.5)
CYCLIST = Kind((1.8, 0.6, 1.8), (3.5, 6.0), 1.0, 12.0, pauses=True)
WALKER = Kind((0.45, 0.6, 1.75), (0.9, 1.7), 0.8, 16.0, pauses=True)


@dataclass(frozen=True)
class Route:
    """Straight pieces and arcs, one after the other.

    Attributes:
        start: x, y (m) and heading (rad, from +y towards +x).
        pieces: length (m) and curvature (1/m, positive to the right) of each.
        kind: who uses it.
        stop_m: where the stop line is along it; None: no light.
        phase: which green it has, 0 or 1.
    """

    start: tuple[float, float, float]
    pieces: tuple[tuple[float, float], ...]
    kind: Kind
    stop_m: float | None = None
    phase: int = 0

    @property
    def length_m(self) -> float:
        """Its whole length."""
        return sum(length for length, _ in self.pieces)

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pose (N, 3) x, y, heading, and curvature (N,), after s (N,) metres."""
        x, y, heading = self.start
        pose, bend = np.empty((len(s), 3)), np.zeros(len(s))
        begin = 0.0
        for k, (length, curvature) in enumerate(self.pieces):
            last = k == len(self.pieces) - 1
            here = (s >= begin) & ((s < begin + length) | last) if k else (s < begin + length) | last
            pose[here] = _along((x, y, heading), curvature, s[here] - begin)
            bend[here] = curvature
            x, y, heading = _along((x, y, heading), curvature, np.array([length]))[0]
            begin += length
        return pose, bend


def _along(start: tuple[float, float, float], curvature: float, s: FloatArray) -> FloatArray:
    """Poses (N, 3) after s (N,) metres of a circle of that curvature."""
    x, y, heading = start
    turned = heading + curvature * s
    if curvature == 0.0:
        return np.stack([x + s * math.sin(heading), y + s * math.cos(heading), turned], axis=1)
    right = (math.cos(heading) - np.cos(turned)) / curvature
    ahead = (np.sin(turned) - math.sin(heading)) / curvature
    return np.stack([x + right, y + ahead, turned], axis=1)


def crossing() -> list[Route]:
    """Two streets of two lanes each way about (0, 32) m, with a light, and who crosses them on foot."""
    out = []
    for lane in (1.8, 5.2):
        out.append(Route((lane, -10.0, 0.0), ((130.0, 0.0),), CAR, 32.0 - 9.0 + 10.0))
        out.append(Route((-lane, 120.0, math.pi), ((130.0, 0.0),), CAR, 120.0 - 32.0 - 9.0))
        out.append(Route((-60.0, 32.0 - lane, 0.5 * math.pi), ((120.0, 0.0),), CAR, 60.0 - 9.0, phase=1))
        out.append(Route((60.0, 32.0 + lane, -0.5 * math.pi), ((120.0, 0.0),), CAR, 60.0 - 9.0, phase=1))
    turn = 0.5 * math.pi * 4.0
    out.append(Route((8.6, -10.0, 0.0), ((29.4, 0.0), (turn, 0.25), (50.0, 0.0)), CAR))
    for side in (-10.5, 10.5):
        out.append(Route((side, 0.0, 0.0), ((70.0, 0.0),), WALKER))
        out.append(Route((-40.0, 32.0 + side, 0.5 * math.pi), ((80.0, 0.0),), WALKER))
    return out


def street() -> list[Route]:
    """A street along the view with pavements on both sides: cars, cyclists, walkers who hide each other."""
    out = [
        Route((1.6, -10.0, 0.0), ((100.0, 0.0),), CAR),
        Route((-1.6, 90.0, math.pi), ((100.0, 0.0),), CAR),
        Route((3.8, -5.0, 0.0), ((80.0, 0.0),), CYCLIST),
        Route((-3.8, 75.0, math.pi), ((80.0, 0.0),), CYCLIST),
    ]
    for side in (-1.0, 1.0):
        for across in (5.2, 6.4):
            out.append(Route((side * across, 3.0, 0.0), ((50.0, 0.0),), WALKER))
            out.append(Route((side * (across + 0.5), 53.0, math.pi), ((50.0, 0.0),), WALKER))
    out.append(Route((-9.0, 16.0, 0.5 * math.pi), ((18.0, 0.0),), WALKER))
    out.append(Route((9.0, 24.0, -0.5 * math.pi), ((18.0, 0.0),), WALKER))
    return out


def square() -> list[Route]:
    """A square that walkers cross in all directions."""
    out = []
    for k in range(14):
        angle = 2.0 * math.pi * k / 14.0
        x, y = -11.0 * math.sin(angle + 0.2), 20.0 - 11.0 * math.cos(angle + 0.2)
        out.append(Route((x, y, angle), ((22.0, 0.0),), WALKER))
    return out


def roundabout() -> list[Route]:
    """A roundabout about (0, 40) m, through which two streams go straight on, each about half of the ring."""
    arm, radius, onto, turn = 40.0, 12.0, 8.0, 0.9
    pieces = (
        (arm, 0.0),
        (onto * turn, 1.0 / onto),
        (2.0 * turn * radius, -1.0 / radius),
        (onto * turn, 1.0 / onto),
        (arm, 0.0),
    )
    slow = Kind(CAR.size_m, (6.0, 10.0), CAR.acceleration, 5.0)
    return [Route((2.0, -15.0, 0.0), pieces, slow), Route((-2.0, 95.0, math.pi), pieces, slow)]
