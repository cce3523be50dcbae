"""The same network with an input of another size: larger finds smaller vehicles, smaller is quicker."""

from __future__ import annotations

import json
from pathlib import Path

from jeat_graph.detection.models.onnx_head import CARD, read_onnx_head
from jeat_graph.training.export import write_onnx
from jeat_graph.training.making import read_network


def resized(source: Path, side: tuple[int, int], out: Path) -> Path:
    """Write a network that `train` made once more, for another size; weights and card stay as they are.

    Args:
        source: the network; it is what comes back if it is of that size.
        side: width and height of the input (px), whole multiples of 16.
        out: the file to write.

    Raises:
        ConfigError: the package `onnx` is not installed.
        DataError: no file that `train` made.
    """
    head = read_onnx_head(source)
    if head.inputs[0].shape[2:] == (side[1], side[0]):
        return source
    card = json.loads(head.notes[CARD])
    card["judged_at"], card["side"] = card.get("side"), list(side)
    write_onnx(read_network(source).eval(), side, card, out)
    return out
