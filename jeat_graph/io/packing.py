"""Nested lists, tuples, mappings and arrays as one text and one block of bytes: plain data, no code.

For files that hold the state of a running program. Of objects only those of classes that the caller names are
taken, attribute by attribute; nothing in a file can name another class or run anything.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import DataError

_KINDS = {"list": list, "tuple": tuple, "deque": deque}
_ALIGN = 8


class Codec(NamedTuple):
    """How objects of one class are taken apart and put together.

    Attributes:
        kind: the class.
        apart: returns its attributes by name.
        together: makes an object of them.
    """

    kind: type[Any]
    apart: Callable[[Any], dict[str, Any]]
    together: Callable[[dict[str, Any]], Any]


def plain_codec(kind: type[Any]) -> Codec:
    """Codec of a class whose objects are their attributes: a named tuple, a data class, or any other."""
    if hasattr(kind, "_fields"):
        return Codec(kind, lambda one: one._asdict(), lambda values: kind(**values))

    def together(values: dict[str, Any]) -> Any:
        one = object.__new__(kind)
        for name, value in values.items():
            object.__setattr__(one, name, value)
        return one

    return Codec(kind, lambda one: dict(vars(one)), together)


def pack(tree: Any, codecs: Mapping[str, Codec]) -> tuple[str, bytes]:
    """Turn nested data into a text and a block of bytes.

    Args:
        tree: None, flags, numbers, text, lists, tuples, deques, mappings, slices, arrays without objects, and
            objects of the named classes. An object that stands in several places is kept once.
        codecs: classes by the name that they have in the text.

    Raises:
        TypeError: something else.
    """
    packer = _Packer(codecs)
    node = packer.node(tree)
    # Each kind of array is described once: of records there are many, and their fields are many words.
    kinds = [kind.descr if kind.names else kind.str for kind in packer.kinds]
    text = json.dumps({"kinds": kinds, "tree": node}, separators=(",", ":"))
    return text, b"".join(packer.blocks)


def unpack(text: str, block: bytes, codecs: Mapping[str, Codec]) -> Any:
    """Turn back what `pack` made.

    Raises:
        DataError: the text or the bytes are damaged.
    """
    try:
        content = json.loads(text)
        return _Unpacker(block, codecs, content["kinds"]).tree(content["tree"])
    except (ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise DataError(f"is damaged: {type(error).__name__}: {error}") from None


class _Packer:
    """Collects the bytes of the arrays while a tree is walked."""

    def __init__(self, codecs: Mapping[str, Codec]) -> None:
        self._codecs = {codec.kind: (name, codec) for name, codec in codecs.items()}
        self.blocks: list[bytes] = []
        self.kinds: dict[np.dtype[Any], int] = {}
        self._at = 0
        self._known: dict[int, int] = {}
        self._held: list[Any] = []  # no other object gets the number of one that is known

    def node(self, value: Any) -> Any:
        kind = type(value)
        if value is None or kind in (bool, int, float, str):
            return value
        if kind is np.ndarray:
            return {"array": self._array(value)}
        if kind in (list, tuple, deque):
            return {kind.__name__: [self.node(item) for item in value]}
        if kind is dict:
            return {"dict": [[self.node(k), self.node(v)] for k, v in value.items()]}
        if kind is slice:
            return {"slice": [value.start, value.stop]}
        if isinstance(value, np.generic):
            return value.item()
        if kind not in self._codecs:
            raise TypeError(f"cannot be saved: {kind.__name__}")
        if id(value) in self._known:
            return {"again": self._known[id(value)]}
        self._known[id(value)] = len(self._held)
        self._held.append(value)
        name, codec = self._codecs[kind]
        parts = codec.apart(value)
        return {"object": [name, {key: self.node(part) for key, part in parts.items()}]}

    def _array(self, value: npt.NDArray[Any]) -> list[Any]:
        if value.dtype.hasobject:
            raise TypeError("cannot be saved: an array of objects")
        content = np.ascontiguousarray(value).tobytes()
        at = self._at
        padding = -len(content) % _ALIGN
        self.blocks.append(content + bytes(padding))
        self._at += len(content) + padding
        return [self.kinds.setdefault(value.dtype, len(self.kinds)), value.shape, at]


class _Unpacker:
    """Makes a tree of a text that was read, in the order in which it was written."""

    def __init__(self, block: bytes, codecs: Mapping[str, Codec], kinds: list[Any]) -> None:
        self._block = block
        self._codecs = codecs
        self._kinds = [_dtype(kind) for kind in kinds]
        self._held: list[Any] = []

    def tree(self, node: Any) -> Any:
        if not isinstance(node, dict):
            return node
        ((kind, content),) = node.items()
        if kind == "array":
            return self._array(*content)
        if kind in _KINDS:
            return _KINDS[kind](self.tree(item) for item in content)
        if kind == "dict":
            return {self.tree(key): self.tree(value) for key, value in content}
        if kind == "slice":
            return slice(*content)
        if kind == "again":
            return self._held[content]
        name, parts = content
        place = len(self._held)
        self._held.append(None)
        one = self._codecs[name].together({key: self.tree(part) for key, part in parts.items()})
        self._held[place] = one
        return one

    def _array(self, kind: int, shape: list[int], at: int) -> npt.NDArray[Any]:
        count = int(np.prod(shape))
        return np.frombuffer(self._block, self._kinds[kind], count, at).reshape(shape).copy()


def _dtype(described: Any) -> np.dtype[Any]:
    """Kind of array from its description: a name, or the names, kinds and shapes of a record's fields."""
    if isinstance(described, str):
        dtype = np.dtype(described)
    else:
        dtype = np.dtype([tuple(tuple(p) if isinstance(p, list) else p for p in f) for f in described])
    if dtype.hasobject:
        raise ValueError("an array of objects")
    return dtype
