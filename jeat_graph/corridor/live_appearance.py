"""What vehicles look like while they drive: each less the mean of the last ones at its camera."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.embeddings import packed_embedding, unpacked_embedding

#: The mean is that of about so many of the last vehicles: light changes over the day.
_MEMORY = 300
#: Vehicles are compared once so many have been seen at both cameras, so that the means are known.
_LEAST = 30


class CameraAppearance:
    """The mean embedding of the last vehicles at a camera.

    Args:
        numbers: of an embedding, as they were learnt; 0 if none was.

    Attributes:
        other_numbers: of an embedding that has come and cannot be compared; 0 if none has.
    """

    def __init__(self, numbers: int) -> None:
        self._numbers = numbers
        self._count = 0
        self._mean = np.zeros(numbers)
        self.other_numbers = 0

    @property
    def known(self) -> bool:
        """Whether enough vehicles have been seen."""
        return self._count >= _LEAST

    def add(self, packed: str) -> None:
        """Take in the embedding of a vehicle; an empty one is none."""
        one = unpacked_embedding(packed)
        if not self._numbers or not len(one):
            return
        if len(one) != self._numbers:
            self.other_numbers = len(one)
            return
        self._count += 1
        self._mean += (one - self._mean) / min(self._count, _MEMORY)

    def centred(self, packed: Sequence[str]) -> FloatArray:
        """Return embeddings (N, E) less the mean, of unit length; NaN where there is none."""
        out = np.full((len(packed), self._numbers), np.nan)
        for k, text in enumerate(packed):
            one = unpacked_embedding(text)
            if len(one) == self._numbers:
                out[k] = one - self._mean
        length = np.linalg.norm(out, axis=1, keepdims=True)
        return np.where(length > 1e-9, out / np.maximum(length, 1e-9), np.nan)

    def state(self) -> list[Any]:
        """Return what `set_state` takes: plain data."""
        return [self._count, packed_embedding(self._mean)]

    def set_state(self, state: Sequence[Any]) -> None:
        """Go on from what `state` returned; the mean is rounded."""
        mean = unpacked_embedding(state[1])
        if len(mean) == self._numbers:
            self._count, self._mean = int(state[0]), mean
