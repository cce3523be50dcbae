"""Independent random streams, one a purpose, from one seed."""

from __future__ import annotations

import zlib

import numpy as np


def stream(seed: int, purpose: str) -> np.random.Generator:
    """Return the generator for one purpose of one seed.

    The child seed is chosen by the purpose's name instead of by counting children, so that a new stream
    does not shift the others: a sensor added to a scenario leaves the traffic as it was.

    Args:
        seed: non-negative seed of the recording.
        purpose: what the numbers are for, such as `traffic` or `rgb.clutter`.
    """
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(zlib.crc32(purpose.encode()),)))
