"""Draws false detections: some anywhere, some at fixed places again and again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.simulation.sensors.sequences import sticky_uniform


@dataclass(frozen=True)
class ClutterConfig:
    """False boxes of one detector."""

    per_scan: float = number(0.3, "boxes", "mean number of false boxes a scan")
    persistent_share: float = number(
        0.3, "1", "share of them at fixed places (the bush taken for a car)", 0.0, 1.0
    )
    places: int = number(5, "1", "number of fixed places", 1, 100)
    memory_s: float = number(0.8, "s", "mean time between changes of what shows at a place", open_low=True)
    size_px: float = number(32.0, "px", "median box size sqrt(w h)", 4.0)
    size_spread: float = number(0.5, "ln px", "std of its logarithm", 0.0, 2.0)

    def __post_init__(self) -> None:
        check(self)
        if self.per_scan * self.persistent_share > 0.95 * self.places:
            raise ConfigError("places: too few for persistent_share * per_scan false boxes a scan")


def draw_clutter(
    rng: np.random.Generator, times: FloatArray, picture: tuple[float, float], config: ClutterConfig
) -> tuple[IntArray, FloatArray]:
    """Draw the false boxes of all scans of one sensor.

    The independent ones are Poisson in number and uniform in the picture. Each fixed place shows its box
    as a two-state Markov chain over time.

    Args:
        rng: random stream.
        times: (K,) scans (s), ascending.
        picture: width and height (px).
        config: settings.

    Returns:
        Scan index (M,) and boxes (M, 4) left, top, width, height (px).
    """
    scans, places = len(times), config.places
    lasting = config.per_scan * config.persistent_share
    count = rng.poisson(config.per_scan - lasting, scans)
    anywhere = _draw_boxes(rng, int(count.sum()), picture, config)
    fixed = _draw_boxes(rng, places, picture, config)
    place = np.tile(np.arange(places), scans)
    when = np.repeat(np.arange(scans), places)
    shows = sticky_uniform(rng, place, times[when], config.memory_s) < lasting / places
    place, when = place[shows], when[shows]
    shaken = fixed[place]
    shaken[:, :2] += 0.05 * shaken[:, 2:] * rng.normal(size=(len(place), 2))
    shaken[:, 2:] *= np.exp(0.06 * rng.normal(size=(len(place), 2)))
    return np.concatenate([np.repeat(np.arange(scans), count), when]), np.concatenate([anywhere, shaken])


def _draw_boxes(
    rng: np.random.Generator, count: int, picture: tuple[float, float], config: ClutterConfig
) -> FloatArray:
    size = config.size_px * np.exp(config.size_spread * rng.normal(size=count))
    aspect = np.exp(0.2 * rng.normal(size=count))
    extent = np.stack([size * aspect, size / aspect], axis=1)
    centre = rng.uniform(0.0, 1.0, size=(count, 2)) * np.array(picture)
    return np.concatenate([centre - extent / 2.0, extent], axis=1)
