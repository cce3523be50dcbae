"""Events that no vehicle makes: pixels that fire all the time, and lamps that flicker."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import IntArray
from jeat_graph_sehn.training.settings import EventChanges

#: A hot pixel fires so often (Hz), evenly in the logarithm: more than noise, less than a bus lets through.
_HOT_HZ = (10.0, 1000.0)
#: Lamps at the mains' 50 or 60 Hz flicker twice as often.
_FLICKER_HZ = (100.0, 120.0)
#: Radius of a lamp's picture (px), and how many events a pixel of it fires in each half of a period.
_LAMP_PX, _LAMP_EVENTS = (1.0, 5.0), (0.3, 2.0)
_US = 1e6


def draw_disturbances(
    rng: np.random.Generator, side: tuple[int, int], length_us: int, changes: EventChanges
) -> list[IntArray]:
    """Draw events of hot pixels and lamps.

    Args:
        rng: random numbers.
        side: width and height (px).
        length_us: of the time from 0 on (µs).
        changes: at most how many of each.

    Returns:
        Times (µs), columns, rows and polarities (N,), in no order.
    """
    parts = [_hot_pixel(rng, side, length_us) for _ in range(int(rng.integers(0, changes.hot_pixels + 1)))]
    parts += [_lamp(rng, side, length_us) for _ in range(int(rng.integers(0, changes.lamps + 1)))]
    if not parts:
        return [np.zeros(0, dtype=np.int64) for _ in range(4)]
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def _hot_pixel(rng: np.random.Generator, side: tuple[int, int], length_us: int) -> tuple[IntArray, ...]:
    """One polarity for most: what is wrong with the pixel is its threshold."""
    low, high = np.log(_HOT_HZ)
    count = int(rng.poisson(np.exp(rng.uniform(low, high)) * length_us / _US))
    x, y = (int(rng.integers(most)) for most in side)
    brighter = rng.random(count) < rng.choice([0.05, 0.95])
    columns = rng.integers(0, length_us, count), np.full(count, x), np.full(count, y)
    return *columns, brighter.astype(np.int64)


def _lamp(rng: np.random.Generator, side: tuple[int, int], length_us: int) -> tuple[IntArray, ...]:
    """A disc, all of whose pixels become brighter, then darker, at nearly one time."""
    radius = rng.uniform(*_LAMP_PX)
    middle = rng.random(2) * side
    rows, columns = np.mgrid[: side[1], : side[0]]
    y, x = np.nonzero((columns + 0.5 - middle[0]) ** 2 + (rows + 0.5 - middle[1]) ** 2 <= radius**2)
    half_us = _US / rng.choice(_FLICKER_HZ) / 2.0
    begins = np.arange(rng.uniform(0.0, 2.0 * half_us), length_us, half_us)
    each = rng.poisson(rng.uniform(*_LAMP_EVENTS), (len(begins), len(x)))
    half, pixel = (np.repeat(index.ravel(), each.ravel()) for index in np.indices(each.shape))
    # They fire while the light rises, a third of the half period.
    t = begins[half] + rng.uniform(0.0, half_us / 3.0, len(half))
    kept = t < length_us
    return t[kept].astype(np.int64), x[pixel[kept]], y[pixel[kept]], half[kept] % 2
