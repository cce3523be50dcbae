"""Nested lists, tuples, mappings and arrays as one text and one block of bytes: plain data, no code.

For files that hold the state of a running program. Of objects only those of classes that the caller names are
taken, attribute by attribute; nothing in a file can name another class or run anything.

What is similar is packed together, column by column: the same attribute of many objects is one piece, and so
are many arrays of one kind. So the cost is that of the kinds of things there are, hardly of their number.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.packed_numbers import NumberReader, NumberWriter

_LISTS: dict[str, type[Any]] = {"list": list, "deque": deque, "tuple": tuple}
_PLAIN = frozenset((type(None), bool, int, float, str))


class Codec(NamedTuple):
    """How objects of one class are taken apart and put together.

    Attributes:
        kind: the class.
        apart: returns its attributes by name, the same names for all of the class.
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
    node = packer.column([tree])
    text = json.dumps({"kinds": packer.numbers.kinds(), "tree": node}, separators=(",", ":"))
    return text, packer.numbers.block()


def unpack(text: str, block: bytes, codecs: Mapping[str, Codec]) -> Any:
    """Turn back what `pack` made.

    Raises:
        DataError: the text or the bytes are damaged.
    """
    try:
        content = json.loads(text)
        (tree,) = _Unpacker(codecs, NumberReader(block, content["kinds"])).column(content["tree"])
    except DataError:
        raise
    except Exception as error:  # whatever garbage may raise, too deep nesting and too little memory among it
        raise DataError(f"is damaged: {type(error).__name__}: {error}") from None
    return tree


class _Packer:
    """Walks a tree column by column; a column is a list of things, a node what the text says of it."""

    def __init__(self, codecs: Mapping[str, Codec]) -> None:
        self._codecs = {codec.kind: (name, codec) for name, codec in codecs.items()}
        self.numbers = NumberWriter()
        self._known: dict[int, int] = {}
        self._held: list[Any] = []  # no other object gets the number of one that is known

    def column(self, values: Sequence[Any]) -> Any:
        """Return the node of some things."""
        kinds = {type(value) for value in values}
        if kinds <= _PLAIN:
            return _runs(values) if len(kinds) == 1 and len(values) > 1 else values
        if len(kinds) > 1:
            return self._mixed(values)
        (kind,) = kinds
        if kind is np.ndarray:
            dtype = values[0].dtype
            uniform = len(values) == 1 or all(value.dtype == dtype for value in values)
            return {"array": self.numbers.arrays(values, dtype)} if uniform else self._mixed(values)
        if kind in _LISTS.values():
            return self._lists(values, kind)
        if kind is dict:
            keys, items = [k for v in values for k in v], [i for v in values for i in v.values()]
            return {"dict": [[len(v) for v in values], self.column(keys), self.column(items)]}
        if kind is slice:
            return {"slice": [[v.start, v.stop] for v in values]}
        if issubclass(kind, np.generic):
            return [v.item() for v in values]
        if kind not in self._codecs:
            raise TypeError(f"cannot be saved: {kind.__name__}")
        return self._objects(values, *self._codecs[kind])

    def _mixed(self, values: Sequence[Any]) -> Any:
        """Things of several kinds: which is of which, and a column of each kind."""
        groups: dict[Any, list[Any]] = {}
        which = []
        for value in values:
            kind = type(value)
            label: Any = _PLAIN if kind in _PLAIN else (kind, getattr(value, "dtype", None))
            group = groups.setdefault(label, [])
            which.append(list(groups).index(label))
            group.append(value)
        return {"mixed": [which, [self.column(group) for group in groups.values()]]}

    def _lists(self, values: Sequence[Any], kind: type[Any]) -> Any:
        if kind is tuple and len({len(v) for v in values}) == 1:
            return {"row": [len(values), [self.column(items) for items in zip(*values, strict=True)]]}
        flat = [item for value in values for item in value]
        return {kind.__name__: [[len(v) for v in values], self.column(flat)]}

    def _objects(self, values: Sequence[Any], name: str, codec: Codec) -> Any:
        first, fresh = len(self._held), []
        for value in values:
            if id(value) not in self._known:
                self._known[id(value)] = len(self._held)
                self._held.append(value)
                fresh.append(value)
        places = [self._known[id(value)] for value in values]
        parts = [codec.apart(value) for value in fresh]
        names = list(parts[0]) if parts else []
        if any(list(part) != names for part in parts):
            raise TypeError(f"cannot be saved: objects of {name} with different attributes")
        columns = [[key, self.column([part[key] for part in parts])] for key in names]
        return {"object": [name, places, first, len(fresh), columns]}


def _runs(values: Sequence[Any]) -> Any:
    """Plain values, shorter where all are the same."""
    first = values[0]
    if values[-1] == first and all(value == first for value in values):
        return {"same": [len(values), first]}
    return values


class _Unpacker:
    """Makes columns of nodes, in the order in which they were made."""

    def __init__(self, codecs: Mapping[str, Codec], numbers: NumberReader) -> None:
        self._codecs = codecs
        self._numbers = numbers
        self._held: list[Any] = []

    def column(self, node: Any) -> list[Any]:
        """Return the things of a node."""
        if isinstance(node, list):
            return node
        ((kind, content),) = node.items()
        if kind == "array":
            return self._numbers.arrays(content)
        if kind == "same":
            return [content[1]] * self._numbers.within(content[0])
        if kind == "slice":
            return [slice(*bounds) for bounds in content]
        if kind == "mixed":
            which, nodes = content
            groups = [iter(self.column(part)) for part in nodes]
            return [next(groups[k]) for k in which]
        if kind == "row":
            count, nodes = content
            columns = [self.column(part) for part in nodes]
            rows = list(zip(*columns, strict=True)) if nodes else [()] * self._numbers.within(count)
            if len(rows) != count:
                raise ValueError("rows are missing")
            return rows
        if kind == "dict":
            lengths, keys, items = content
            pairs = list(zip(self.column(keys), self.column(items), strict=True))
            return [dict(part) for part in _cut(pairs, lengths)]
        if kind == "object":
            return self._objects(*content)
        lengths, flat = content
        return [_LISTS[kind](part) for part in _cut(self.column(flat), lengths)]

    def _objects(self, name: str, places: list[int], first: int, fresh: int, columns: list[Any]) -> list[Any]:
        if first != len(self._held):
            raise ValueError("objects are missing")
        self._held += [None] * self._numbers.within(fresh)
        codec = self._codecs[name]
        filled = {key: self.column(node) for key, node in columns}
        for k in range(fresh):
            self._held[first + k] = codec.together({key: values[k] for key, values in filled.items()})
        return [self._held[place] for place in places]


def _cut(items: list[Any], lengths: list[int]) -> list[list[Any]]:
    if sum(lengths) != len(items):
        raise ValueError("items are missing")
    ends = np.cumsum(lengths).tolist()
    return [items[end - length : end] for end, length in zip(ends, lengths, strict=True)]
