"""Kinds of vehicles and how large they are: the prior of a vehicle's length, width and height."""

from __future__ import annotations

from typing import NamedTuple


class VehicleClass(NamedTuple):
    """A kind of vehicle as fleets have it.

    Attributes:
        name: what it is called.
        share: of traffic.
        mean: length, width, height (m).
        spread: their standard deviations (m).
    """

    name: str
    share: float
    mean: tuple[float, float, float]
    spread: tuple[float, float, float]


#: Rough sizes of bodies without mirrors, wide enough that a vehicle of each kind lies within two deviations.
CLASSES = (
    VehicleClass("motorcycle", 0.01, (2.2, 0.8, 1.5), (0.2, 0.1, 0.15)),
    VehicleClass("car", 0.74, (4.4, 1.83, 1.55), (0.35, 0.08, 0.12)),
    VehicleClass("van", 0.12, (5.6, 2.0, 2.35), (0.6, 0.08, 0.3)),
    VehicleClass("truck", 0.07, (9.0, 2.5, 3.5), (1.8, 0.08, 0.4)),
    VehicleClass("truck", 0.06, (14.5, 2.52, 3.8), (2.2, 0.06, 0.3)),
)
