"""The same network with an input of another size: larger finds smaller vehicles, smaller is quicker."""

from __future__ import annotations

import json
from pathlib import Path

from jeat_graph.detection.models.onnx_head import CARD, read_onnx_head
from jeat_graph.training.export import write_onnx
from jeat_graph.training.making import looks_twice, read_network


def resized(source: Path, side: tuple[int, int], out: Path, second_look: bool = False) -> Path:
    """Write a network that `train` made once more, for another size; weights and card stay as they are.

    Args:
        source: the network; it is what comes back if it is of that size and looks as often.
        side: width and height of the input (px), whole multiples of 16; of 32 with a second look.
        out: the file to write.
        second_look: whether it looks at half the size, too.

    Raises:
        ConfigError: the package `onnx` is not installed.
        DataError: no file that `train` made.
    """
    head = read_onnx_head(source)
    net, card = read_network(source).eval(), json.loads(head.notes[CARD])
    if head.inputs[0].shape[2:] == (side[1], side[0]) and looks_twice(source) == second_look:
        return source
    card["judged_at"], card["side"] = card.get("side"), list(side)
    write_onnx(net, side, card, out, second_look=second_look)
    return out
