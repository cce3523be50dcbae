"""Kinds of vehicles and their dimensions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class VehicleKind:
    """Dimensions and speeds of one kind of vehicle.

    Attributes:
        name: class name in the files.
        size_m: mean length, width and height (m).
        spread_m: half range of length, width and height (m).
        speed: lowest and highest desired speed on an empty road (m/s); traffic keeps most below theirs.
        max_acceleration: m/s².
    """

    name: str
    size_m: tuple[float, float, float]
    spread_m: tuple[float, float, float]
    speed: tuple[float, float]
    max_acceleration: float


KINDS = (
    VehicleKind("car", (4.4, 1.80, 1.46), (0.4, 0.06, 0.05), (29.0, 42.0), 1.6),
    VehicleKind("suv", (4.7, 1.90, 1.72), (0.3, 0.06, 0.08), (28.0, 40.0), 1.5),
    VehicleKind("van", (5.6, 2.02, 2.45), (0.5, 0.05, 0.20), (26.0, 35.0), 1.2),
    VehicleKind("truck", (12.0, 2.50, 3.75), (3.5, 0.05, 0.25), (22.0, 25.0), 0.7),
    VehicleKind("bus", (12.3, 2.52, 3.40), (0.9, 0.03, 0.25), (24.0, 28.0), 0.8),
    VehicleKind("motorcycle", (2.15, 0.85, 1.50), (0.15, 0.08, 0.12), (29.0, 45.0), 2.4),
    VehicleKind("pickup", (5.3, 1.90, 1.82), (0.3, 0.07, 0.08), (27.0, 37.0), 1.4),
)
KIND_NAMES = np.array([kind.name for kind in KINDS])


@dataclass(frozen=True)
class FleetConfig:
    """How often each kind occurs; the weights need not sum to one."""

    car: float = number(0.55, "1", "weight of cars")
    suv: float = number(0.20, "1", "weight of SUVs")
    van: float = number(0.12, "1", "weight of vans")
    truck: float = number(0.13, "1", "weight of trucks")
    bus: float = number(0.0, "1", "weight of buses")
    motorcycle: float = number(0.0, "1", "weight of motorcycles")
    pickup: float = number(0.0, "1", "weight of pick-ups")

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, eq=False)
class Fleet:
    """Vehicles in columns.

    Attributes:
        kind: (V,) index into `KINDS`.
        size: (V, 3) length, width, height (m).
    """

    kind: IntArray
    size: FloatArray

    def __len__(self) -> int:
        return len(self.kind)


def draw_fleet(rng: np.random.Generator, count: int, config: FleetConfig) -> Fleet:
    """Draw `count` vehicles with kinds and dimensions at random."""
    weights = np.array([getattr(config, kind.name) for kind in KINDS])
    total = float(weights.sum())
    share = weights / total if total > 0.0 else np.full(len(KINDS), 1.0 / len(KINDS))
    kind = rng.choice(len(KINDS), size=count, p=share).astype(np.int64)
    mean = np.array([k.size_m for k in KINDS])[kind]
    spread = np.array([k.spread_m for k in KINDS])[kind]
    return Fleet(kind=kind, size=mean + spread * rng.uniform(-1.0, 1.0, size=(count, 3)))
