"""Arrays of one kind as bytes: whole numbers as narrow as they may be, what is everywhere the same once.

Lossless: what is read is what was written, to the last bit, and of the same kind.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

_ALIGN = 8
#: What is repeated in all may take so much memory; a state of 10,000 tracks takes a hundredth.
MOST_BYTES = 1 << 30
#: Narrower kinds of whole numbers, with the least and the greatest that they hold.
_NARROW = tuple((f"<i{size}", -(1 << 8 * size - 1), (1 << 8 * size - 1) - 1) for size in (1, 2, 4))


class NumberWriter:
    """Collects the bytes of arrays."""

    def __init__(self) -> None:
        self._blocks: list[bytes] = []
        self._kinds: dict[np.dtype[Any], int] = {}
        self._at = 0

    def arrays(self, values: Sequence[npt.NDArray[Any]], dtype: np.dtype[Any]) -> list[Any]:
        """Take arrays of one kind, and return what finds them again (plain data)."""
        if dtype.hasobject:
            raise TypeError("cannot be saved: an array of objects")
        flat = _joined(values, dtype)
        shapes = [value.shape for value in values]
        uniform = len(shapes) > 1 and len({shape[1:] for shape in shapes}) == 1 and all(shapes)
        sizes: Any = [[shape[0] for shape in shapes], shapes[0][1:]] if uniform else [shapes]
        return [self._kinds.setdefault(dtype, len(self._kinds)), sizes, self._parts(flat)]

    def kinds(self) -> list[Any]:
        """Describe the kinds of arrays, plain data."""
        return [kind.descr if kind.names else kind.str for kind in self._kinds]

    def block(self) -> bytes:
        """All bytes."""
        return b"".join(self._blocks)

    def _parts(self, flat: npt.NDArray[Any]) -> Any:
        """Write a flat array (N,), of records field by field."""
        words = _words(flat.dtype)
        if words is not None:
            # All words of one place side by side, and all of them judged at once.
            columns = np.ascontiguousarray(flat.view(np.int64).reshape(len(flat), len(words)).T)
            uniform = (columns == columns[:, :1]).all(axis=1).tolist()
            return [
                self._part(column[:1] if same else column, kind, len(flat))
                for column, kind, same in zip(columns, words, uniform, strict=True)
            ]
        if flat.dtype.names:
            raise TypeError("cannot be saved: records of fields that are not of 8 bytes")
        return self._part(flat[:1] if len(flat) > 1 and _all_equal(flat) else flat, flat.dtype, len(flat))

    def _part(self, stored: npt.NDArray[Any], kind: np.dtype[Any], count: int) -> list[Any]:
        """Write what is stored of `count` elements of a kind: all of them, or one."""
        name = kind.str
        if kind.kind == "i" and kind.itemsize > 1 and len(stored):
            low, high = int(stored.min()), int(stored.max())
            for narrow, least, greatest in _NARROW:
                if least <= low and high <= greatest:
                    stored, name = stored.astype(narrow), narrow
                    break
        return [self._write(stored), name, len(stored), count]

    def _write(self, stored: npt.NDArray[Any]) -> int:
        at, content = self._at, stored.tobytes()
        padding = -len(content) % _ALIGN
        self._blocks += [content, bytes(padding)] if padding else [content]
        self._at += len(content) + padding
        return at


def _joined(values: Sequence[npt.NDArray[Any]], dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """All elements one after another; records as bytes, since NumPy would compare all their fields."""
    if len(values) == 1:
        return values[0].ravel()
    if dtype.names is None:
        return np.concatenate(values, axis=None)
    opaque = np.dtype((np.void, dtype.itemsize))
    parts = [np.ascontiguousarray(value).ravel().view(opaque) for value in values]
    return np.concatenate(parts).view(dtype)


@functools.cache
def _words(kind: np.dtype[Any]) -> tuple[np.dtype[Any], ...] | None:
    """Kinds of the words of a record whose fields are all of 8 bytes, without gaps; None of any other."""
    fields = [kind[name] for name in kind.names or ()]
    if not fields or any(field.base.itemsize != _ALIGN for field in fields):
        return None
    words = tuple(field.base for field in fields for _ in range(int(np.prod(field.shape))))
    return words if _ALIGN * len(words) == kind.itemsize else None


def _all_equal(flat: npt.NDArray[Any]) -> bool:
    """Whether all elements (N,) have the same bytes."""
    if flat.dtype.itemsize == _ALIGN:
        bits = flat.view(np.int64)
        return bool(bits[-1] == bits[0] and (bits == bits[0]).all())
    content = flat.tobytes()
    return content == content[: flat.dtype.itemsize] * len(flat)


class NumberReader:
    """Reads what a `NumberWriter` wrote.

    Args:
        block: all bytes.
        kinds: as the writer described them.
    """

    def __init__(self, block: bytes, kinds: list[Any]) -> None:
        self._block = block
        self._spent = 0
        self._kinds = [_dtype(kind) for kind in kinds]

    def arrays(self, content: list[Any]) -> list[npt.NDArray[Any]]:
        """Return arrays from what `NumberWriter.arrays` returned.

        Raises:
            ValueError: they are not all there.
        """
        kind, sizes, parts = content
        flat = self._read(self._kinds[kind], parts)
        shapes = [(n, *sizes[1]) for n in sizes[0]] if len(sizes) == 2 else [tuple(s) for s in sizes[0]]
        counts = [int(np.prod(shape)) for shape in shapes]
        if sum(counts) != len(flat) or min(counts, default=0) < 0:
            raise ValueError("numbers are missing")
        ends = np.cumsum(counts).tolist()
        cut = zip(shapes, counts, ends, strict=True)
        return [flat[end - count : end].reshape(shape).copy() for shape, count, end in cut]

    def _read(self, kind: np.dtype[Any], parts: Any) -> npt.NDArray[Any]:
        words = _words(kind)
        if words is None or not isinstance(parts[0], list):
            return self._column(kind, *parts)
        columns = [self._column(word, *part) for word, part in zip(words, parts, strict=True)]
        out = np.empty((len(columns[0]), len(words)), dtype=np.int64)
        for k, column in enumerate(columns):
            out[:, k] = column.view(np.int64)
        return out.view(kind).ravel()

    def _column(self, kind: np.dtype[Any], at: int, stored: str, held: int, count: int) -> npt.NDArray[Any]:
        if held < 0 or at < 0:
            raise ValueError("numbers are missing")
        found = np.frombuffer(self._block, np.dtype(stored), held, at).astype(kind)
        return np.repeat(found, self.within(count, kind.itemsize)) if held == 1 else found

    def within(self, count: int, size: int = _ALIGN) -> int:
        """Return a number of things that one stands for, unless they take more memory than a state has.

        Args:
            count: how many.
            size: of each (bytes).

        Raises:
            ValueError: they and those before take too much.
        """
        self._spent += count * size
        if count < 0 or self._spent > MOST_BYTES:
            raise ValueError(f"more than {MOST_BYTES} bytes are needed")
        return count


def _dtype(described: Any) -> np.dtype[Any]:
    """Kind of array from its description: a name, or the names, kinds and shapes of a record's fields."""
    if isinstance(described, str):
        dtype = np.dtype(described)
    else:
        dtype = np.dtype([tuple(tuple(p) if isinstance(p, list) else p for p in f) for f in described])
    if dtype.hasobject:
        raise ValueError("an array of objects")
    return dtype
