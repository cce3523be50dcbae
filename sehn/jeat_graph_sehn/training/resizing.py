"""The same network with an input of another size: larger finds smaller vehicles, smaller is quicker."""

from __future__ import annotations

from pathlib import Path

from jeat_graph.detection.models.onnx_head import read_onnx_head
from jeat_graph_sehn.training.export import write_onnx
from jeat_graph_sehn.training.making import SECOND_LOOK, card_of, read_network


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
    card = card_of(source)
    twice = bool(card.pop(SECOND_LOOK, False))
    if input_side(source) == side and twice == second_look:
        return source
    card["judged_at"], card["side"] = card.get("side"), list(side)
    write_onnx(read_network(source).eval(), side, card, out, second_look=second_look)
    return out


def input_side(source: Path) -> tuple[int, int]:
    """Return the width and height (px) of a network's first input."""
    height, width = read_onnx_head(source).inputs[0].shape[2:]
    return width or 0, height or 0
