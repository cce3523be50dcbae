"""Embeddings: what a part of a picture looks like, as a vector in which similar objects lie close together.

They come from a network for re-identification. Only their directions count, and only those of one sensor are
compared with each other.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.boxes import detached
from jeat_graph.data.errors import DataError

EmbeddingArray: TypeAlias = npt.NDArray[np.float32]
#: Most numbers of an embedding; those of networks for re-identification have up to 2,048.
MOST_NUMBERS = 4096
_UNIT = 1e-5  # how far from 1 the rounded squares of a vector of unit length may be in sum


def unit_embeddings(values: npt.ArrayLike, count: int) -> EmbeddingArray:
    """Convert embeddings to unit length.

    Args:
        values: (M, E) one a detection; a row of NaN where there is none.
        count: number of detections M.

    Raises:
        DataError: another shape, more than `MOST_NUMBERS`, or a row that has no direction.
    """
    try:
        found = np.array(detached(values), dtype=np.float64)
    except (TypeError, ValueError):
        raise DataError("embeddings must have shape (M, E), all of them numbers") from None
    if found.size == 0 and count == 0:
        found = found.reshape(0, found.shape[1] if found.ndim == 2 else 1)
    if found.ndim != 2 or len(found) != count or not 1 <= found.shape[1] <= MOST_NUMBERS:
        raise DataError(
            f"embeddings must have shape ({count}, E), E from 1 to {MOST_NUMBERS}, not {found.shape}"
        )
    bad = find_bad_embedding(found)
    if bad is not None:
        raise DataError(f"box {bad}: an embedding must be finite and not all zero")
    with np.errstate(all="ignore"):  # what is missing is NaN and stays so, what has unit length stays too
        other = ~(
            np.abs(np.einsum("me,me->m", found, found) - 1.0) < _UNIT
        )  # the rest has unit length already
    # By the greatest first, so that no square is too large or too small.
    found[other] /= np.abs(found[other]).max(axis=1, keepdims=True)
    found[other] /= np.sqrt(np.einsum("me,me->m", found[other], found[other]))[:, None]
    return found.astype(np.float32)


def packed_embedding(values: npt.ArrayLike) -> str:
    """Return an embedding (E,) as a short text, its numbers rounded to half precision."""
    return base64.b64encode(np.asarray(values, dtype="<f2").tobytes()).decode("ascii")


def unpacked_embedding(text: str) -> FloatArray:
    """Return the embedding (E,) that `packed_embedding` made a text of; of an empty text no numbers."""
    return np.frombuffer(base64.b64decode(text), dtype="<f2").astype(np.float64)


def find_bad_embedding(values: FloatArray) -> int | None:
    """Return the first row of (M, E) numbers that has no direction and is not missing, or None."""
    missing = np.isnan(values).all(axis=1)
    good = missing | (np.isfinite(values).all(axis=1) & values.any(axis=1))
    return None if good.all() else int(np.argmin(good))


def missing_embeddings(count: int, numbers: int) -> EmbeddingArray:
    """Return embeddings (M, E) of detections that have none."""
    return np.full((count, numbers), np.nan, dtype=np.float32)


def spread_embeddings(found: EmbeddingArray | None, there: BoolArray) -> EmbeddingArray | None:
    """Return embeddings (R, E) of rows, those of which `there` (R,) is true in turn; None of none."""
    if found is None:
        return None
    rows = missing_embeddings(len(there), found.shape[1])
    rows[there] = found
    return rows


def join_embeddings(parts: Sequence[EmbeddingArray | None], counts: Sequence[int]) -> EmbeddingArray | None:
    """Join embeddings of several sets of detections; None where no set has any.

    Args:
        parts: (M_k, E) each, or None.
        counts: number of detections M_k of each.

    Raises:
        DataError: some have more numbers than others.
    """
    # A row is missing as a whole, and of what is missing nobody knows how long it would be.
    parts = [None if part is None or np.isnan(part[:, :1]).all() else part for part in parts]
    lengths = {part.shape[1] for part in parts if part is not None}
    if not lengths:
        return None
    if len(lengths) > 1:
        raise DataError(
            f"embeddings must have equally many numbers, not {' and '.join(map(str, sorted(lengths)))}"
        )
    numbers = lengths.pop()
    return np.concatenate(
        [
            missing_embeddings(count, numbers) if part is None else part
            for part, count in zip(parts, counts, strict=True)
        ]
    )
