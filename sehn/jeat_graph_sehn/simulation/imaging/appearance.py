"""Looks of the vehicles of one scene: shape, paint and lamps, the same for all of its time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.lamps import (
    BRAKE,
    COMMON_LAMPS,
    HEAD,
    INDICATOR,
    LAMPS,
    MARKER,
    NONE,
    STRENGTH,
    TAIL,
)
from jeat_graph_sehn.simulation.imaging.paint import PALETTE
from jeat_graph_sehn.simulation.imaging.shapes import shape_count, shape_of
from jeat_graph_sehn.simulation.world.scene import Scene
from jeat_graph_sehn.simulation.world.vehicles import KIND_NAMES, Fleet

_LONG_M = 13.0  # lorries from here on are articulated or have a trailer
_BLINK_HZ = (1.35, 1.65)  # UN R6: 60 to 120 a minute
_HAZARD, _LED = 0.5, 0.5  # shares of vehicles
_DEFECTIVE = 0.02  # share of lamps that do not work
# How often each colour of `PALETTE` is seen on roads: white, silver, grey and black are four fifths.
_COMMONNESS = np.array([0.26, 0.13, 0.19, 0.19, 0.09, 0.06, 0.02, 0.03, 0.02, 0.01])


class Appearance(NamedTuple):
    """Looks of V vehicles.

    Attributes:
        colour: (V, 3) albedo of the paint.
        shape: (V, PARTS, 9) see `shapes`.
        lamps: (V, LAMPS, 4) see `lamps`.
        lit: (V,) whether its lights are on in the dark.
        blink_hz: (V,) rate of its indicators.
        hazard: (V,) whether both flash while it stands where nobody should.
        led: (V,) whether its tail lamps are LED.
    """

    colour: FloatArray
    shape: FloatArray
    lamps: FloatArray
    lit: BoolArray
    blink_hz: FloatArray
    hazard: BoolArray
    led: BoolArray


def appearance_of(scene: Scene, rng: np.random.Generator, varied: bool) -> Appearance:
    """Draw the looks of a scene's vehicles: driving ones first, then parked ones.

    Args:
        scene: with its vehicles.
        rng: random stream of the paint.
        varied: shapes, dirt and lamps of all kinds, or one shape a kind and the same lamps for all.
    """
    palette = np.array(PALETTE)
    fleet = Fleet(
        np.concatenate([scene.fleet.kind, scene.parked_fleet.kind]),
        np.concatenate([scene.fleet.size, scene.parked_fleet.size]),
    )
    count = max(1, len(fleet))
    if not varied:
        colour = palette[rng.integers(0, len(palette), count)] * rng.uniform(0.85, 1.15, (count, 1))
        variant = np.zeros(count, dtype=np.int64)
        lamps = np.tile(np.array(COMMON_LAMPS), (count, 1, 1))
    else:
        colour = palette[rng.choice(len(palette), count, p=_COMMONNESS)] * rng.uniform(0.75, 1.2, (count, 1))
        dirt = rng.beta(1.2, 6.0, (count, 1))
        colour = colour * (1.0 - dirt) + dirt * np.array([0.16, 0.14, 0.11])
        variant = _variants(fleet, rng)
        lamps = _lamps(fleet, variant, rng)
    kinds = fleet.kind if len(fleet) else np.zeros(1, dtype=np.int64)
    shape = np.stack([shape_of(str(KIND_NAMES[k]), int(n)) for k, n in zip(kinds, variant, strict=True)])
    lit = rng.random(count) < scene.light.config.lit_share
    blink_hz = rng.uniform(*_BLINK_HZ, count)
    hazard, led = rng.random(count) < _HAZARD, rng.random(count) < _LED
    return Appearance(np.clip(colour, 0.015, 0.85), shape, lamps, lit, blink_hz, hazard, led)


def _variants(fleet: Fleet, rng: np.random.Generator) -> IntArray:
    draw = rng.random(len(fleet))
    out = np.zeros(max(1, len(fleet)), dtype=np.int64)
    for v, kind in enumerate(fleet.kind):
        name = str(KIND_NAMES[kind])
        if name == "truck":
            out[v] = (3 if draw[v] < 0.7 else 2) if fleet.size[v, 0] > _LONG_M else int(draw[v] < 0.3)
        else:
            out[v] = int(draw[v] * shape_count(name))
    return out


def _lamps(fleet: Fleet, variant: IntArray, rng: np.random.Generator) -> FloatArray:
    """Lamps at heights and distances that differ by kind and vehicle; one in fifty does not work."""
    out = np.zeros((max(1, len(fleet)), LAMPS, 4))
    for v, kind in enumerate(fleet.kind):
        name, high = str(KIND_NAMES[kind]), fleet.size[v, 2]
        across, strength = rng.uniform(0.33, 0.43), rng.uniform(0.6, 1.4)
        head = rng.uniform(0.6, 0.75) if name in ("car", "pickup") else rng.uniform(0.68, 0.95)
        tail = rng.uniform(0.75, 1.0) if name != "van" else rng.uniform(0.9, 1.3)
        rows = [(s * across, head, HEAD, strength) for s in (-1, 1)]
        if name == "motorcycle":
            rows = [(0.0, 0.75, HEAD, 0.7 * strength), (0.0, 0.8, TAIL, 0.8)]
        else:
            rows += [(s * rng.uniform(0.36, 0.44), tail, TAIL, strength) for s in (-1, 1)]
            if name in ("truck", "bus"):
                # A tipper's rear is lower than its cab.
                top = 0.7 * high if name == "truck" and variant[v] == 1 else high
                rows += [(s * 0.46, top - 0.12, MARKER, 1.0) for s in (-1, 1)]
            elif rng.random() < 0.8:
                rows.append((0.0, rng.uniform(0.62, 0.95) * high, BRAKE, 0.5))
        # Indicators are beside head and tail lamps, at one height for both ends.
        rows += [(s * (across + 0.05), 0.5 * (head + tail), INDICATOR, 1.0) for s in (-1, 1)]
        out[v, : len(rows)] = rows
    out[rng.random(out.shape[:2]) < _DEFECTIVE, 2:] = (NONE, 0.0)
    out[..., STRENGTH] *= out[..., 2] != NONE
    return out
