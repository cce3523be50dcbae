"""Numbers of an ONNX file that lie in other files: where, so that nothing beside its own folder is read.

A tensor says `data_location` EXTERNAL and names a file, relative to the network's own. Engines open what is
named, so a stranger's network could have them read any file of this machine, or wait at a pipe for ever.
Tensors stand in the graph, in attributes of its nodes, in their own graphs, in functions and in what training
left. Source: https://github.com/onnx/onnx/blob/main/docs/ExternalData.md
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.protobuf import fields

# Numbers of the fields that hold tensors, or what holds tensors.
_MODEL = {7: "graph", 20: "training", 25: "function"}
_TRAINING = {1: "graph", 2: "graph"}
_FUNCTION = {7: "node", 11: "attribute"}
_GRAPH = {1: "node", 5: "tensor", 15: "sparse"}
_NODE = {5: "attribute"}
_ATTRIBUTE = {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"}
_SPARSE = {1: "tensor", 2: "tensor"}
_PARTS = {
    "model": _MODEL,
    "training": _TRAINING,
    "function": _FUNCTION,
    "graph": _GRAPH,
    "node": _NODE,
    "attribute": _ATTRIBUTE,
    "sparse": _SPARSE,
}
# Of a tensor: where its numbers are, pairs of text, and the place that they name.
_EXTERNAL, _LOCATION = 13, 14
_ELSEWHERE = 1
_KEY, _VALUE = 1, 2
# A graph within a graph within a graph: no network has more.
_DEEPEST = 60


def check_external(model: memoryview, path: Path) -> None:
    """Refuse a network whose numbers lie outside its folder, or in what is no file.

    Args:
        model: its bytes.
        path: where it lies.

    Raises:
        DataError: names the place that it asks for.
        ValueError: the bytes are no ONNX.
    """
    # An engine may go by the name that it is given, or by where a link leads.
    folders = {path.parent.resolve(), path.resolve().parent}
    for location in sorted(set(_locations(model, "model", 0))):
        try:
            places = {folder: (folder / location).resolve() for folder in folders}
            inside = all(place.is_relative_to(folder) for folder, place in places.items())
            regular = inside and any(place.is_file() for place in places.values())
        except (OSError, ValueError, RuntimeError):
            inside = regular = False
        if not inside:
            raise DataError(f"has numbers in {location!r}, outside its own folder: not read", path)
        if not regular:
            raise DataError(f"has numbers in {location!r}, which is no file beside it", path)


def _locations(message: memoryview, kind: str, depth: int) -> Iterator[str]:
    """Yield the places of numbers that lie elsewhere, of a message and what it holds."""
    if depth > _DEEPEST:
        raise ValueError("graphs in graphs without an end")
    if kind == "tensor":
        found = list(fields(message))
        if (_LOCATION, _ELSEWHERE) in [(number, value) for number, value in found if isinstance(value, int)]:
            yield next(filter(None, map(_place, (v for n, v in found if n == _EXTERNAL))), "")
        return
    for number, value in fields(message):
        below = _PARTS[kind].get(number)
        if below is not None and isinstance(value, memoryview):
            yield from _locations(value, below, depth + 1)


def _place(pair: int | memoryview) -> str | None:
    """Return what a pair of key and value says of the place; None if it says something else."""
    if isinstance(pair, int):
        return None
    words = {n: bytes(v).decode() for n, v in fields(pair) if isinstance(v, memoryview)}
    return words.get(_VALUE, "") if words.get(_KEY) == "location" else None
