"""What an ONNX file says of itself: inputs, outputs and notes, without a library for ONNX.

An ONNX file is a Protocol Buffers message; of its fields only those few are looked at.
Source: https://github.com/onnx/onnx/blob/main/onnx/onnx.proto
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.onnx_external import check_external
from jeat_graph.detection.models.protobuf import fields

# Numbers of the fields: ModelProto, GraphProto, TensorProto, ValueInfoProto, TypeProto and below.
_GRAPH, _NOTES = 7, 14
_INITIALIZER, _INPUT, _OUTPUT = 5, 11, 12
_TENSOR_NAME = 8
_NAME, _TYPE, _TENSOR, _KIND, _SHAPE, _DIMENSION, _VALUE = 1, 2, 1, 1, 2, 1, 1
_KINDS = {1: "float32", 2: "uint8", 6: "int32", 7: "int64", 10: "float16", 11: "float64"}
_MOST_BYTES = 1 << 31
#: Note of a network that `train` made: its card.
CARD = "card"


class Port(NamedTuple):
    """An input or output of a network.

    Attributes:
        name: its name.
        shape: its sides; None where the file leaves one open.
        kind: type of its numbers, such as `float32`.
    """

    name: str
    shape: tuple[int | None, ...]
    kind: str


class OnnxHead(NamedTuple):
    """Inputs without a value of their own, outputs, and the notes of whoever made the file."""

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    notes: dict[str, str]


def read_onnx_head(path: str | Path) -> OnnxHead:
    """Read what a file says of itself.

    Raises:
        DataError: no such file, no ONNX, or one whose numbers lie outside its folder.
    """
    place = Path(path)
    if not place.is_file():
        raise DataError("no such file of a network", place)
    if place.stat().st_size > _MOST_BYTES:
        raise DataError("is larger than an ONNX file can be (2 GiB)", place)
    try:
        model = memoryview(place.read_bytes())
        notes: dict[str, str] = {}
        inputs: list[Port] = []
        outputs: list[Port] = []
        valued: set[str] = set()
        for number, value in fields(model):
            if number == _NOTES and isinstance(value, memoryview):
                pair = {n: bytes(v).decode() for n, v in fields(value) if isinstance(v, memoryview)}
                notes[pair.get(1, "")] = pair.get(2, "")
            if number == _GRAPH and isinstance(value, memoryview):
                for part, content in fields(value):
                    if part in (_INPUT, _OUTPUT) and isinstance(content, memoryview):
                        (inputs if part == _INPUT else outputs).append(_port(content))
                    elif part == _INITIALIZER and isinstance(content, memoryview):
                        valued.add(_text(content, _TENSOR_NAME))
        check_external(model, place)
    except (ValueError, IndexError, UnicodeDecodeError):
        raise DataError("is not an ONNX file that can be read", place) from None
    inputs = [port for port in inputs if port.name not in valued]
    if not inputs or not outputs:
        raise DataError("is not an ONNX file: it has no inputs or no outputs", place)
    return OnnxHead(tuple(inputs), tuple(outputs), notes)


def _port(message: memoryview) -> Port:
    shape: list[int | None] = []
    kind = "float32"
    for _, kind_of in _messages(message, _TYPE):
        for _, tensor in _messages(kind_of, _TENSOR):
            for number, value in fields(tensor):
                if number == _KIND and isinstance(value, int):
                    kind = _KINDS.get(value, "unknown")
                if number == _SHAPE and isinstance(value, memoryview):
                    for _, dimension in _messages(value, _DIMENSION):
                        sizes = [v for n, v in fields(dimension) if n == _VALUE and isinstance(v, int)]
                        shape.append(sizes[0] if sizes and sizes[0] > 0 else None)
    return Port(_text(message, _NAME), tuple(shape), kind)


def _messages(message: memoryview, wanted: int) -> Iterator[tuple[int, memoryview]]:
    return ((n, v) for n, v in fields(message) if n == wanted and isinstance(v, memoryview))


def _text(message: memoryview, wanted: int) -> str:
    return next((bytes(v).decode() for _, v in _messages(message, wanted)), "")
