"""Which layout a network's outputs have: by its file's notes, and by the shapes that it gives at run time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.exports import export_of, noted_side
from jeat_graph.detection.models.layouts.numbers import cell_counts
from jeat_graph.detection.models.layouts.record import ROWS, SPREADS, Network, OutputLayout
from jeat_graph.detection.models.layouts.registry import asked_for, recognise
from jeat_graph.detection.models.model_settings import AUTO, ModelSettings
from jeat_graph.detection.models.onnx_head import OnnxHead, Port

#: Type of the input that takes the picture's size.
SIZES = "int64"
_PICTURE_SIDES = 4
# Sides of square inputs that are tried where a network of an open input gives as many rows whatever it is
# shown: multiples of the coarsest stride (px).
_STEP_PX, _STEPS = 32, 64


#: Runs a network: inputs to outputs, by name.
Run = Callable[[Mapping[str, npt.NDArray[Any]]], Mapping[str, npt.NDArray[Any]]]


class PictureInputs(NamedTuple):
    """Inputs of a network of pictures: the picture, and its size where the network takes that."""

    picture: Port
    sizes: Port | None

    def blank(self, side: tuple[int, int]) -> dict[str, npt.NDArray[Any]]:
        """Return inputs of nothing, of a width and height (px)."""
        return self.filled(np.zeros((1, 3, side[1], side[0]), dtype=np.float32), side)

    def filled(
        self, values: npt.NDArray[np.float32], size_px: tuple[int, int]
    ) -> dict[str, npt.NDArray[Any]]:
        """Return the inputs with a picture (1, 3, height, width) whose own size is `size_px`."""
        inputs: dict[str, Any] = {self.picture.name: values.astype(self.picture.kind)}
        if self.sizes is not None:
            inputs[self.sizes.name] = np.array([size_px], dtype=SIZES)
        return inputs


class Recognised(NamedTuple):
    """What a network of pictures takes and gives.

    Attributes:
        inputs: what it takes.
        outputs: names and shapes of what it gives.
        side: width and height of its input (px).
    """

    inputs: PictureInputs
    outputs: tuple[Port, ...]
    side: tuple[int, int]


def recognised(path: Path, head: OnnxHead, settings: ModelSettings, run: Run) -> Recognised:
    """Find what the file of a network of pictures leaves open by running it on nothing.

    Args:
        path: its file.
        head: what that says of itself.
        settings: how it is read.
        run: runs it; called only if the file leaves sides of its outputs open.

    Raises:
        DataError: it is no network of pictures, or cannot be run.
    """
    inputs = picture_inputs(head.inputs, path)
    _, _, height, width = inputs.picture.shape
    open_width, open_height = settings.open_side(noted_side(head.notes))
    side = (width or open_width, height or open_height)
    outputs = given_shapes(head.outputs, lambda: run(inputs.blank(side)))
    declared = settings.declared_side or noted_side(head.notes) is not None
    if outputs != head.outputs and not (width and height) and not declared:
        other = _fixed_side(outputs, side)
        if other is not None and outputs == given_shapes(head.outputs, lambda: run(inputs.blank(other))):
            side = other
    return Recognised(inputs, outputs, side)


def picture_inputs(inputs: tuple[Port, ...], path: Path) -> PictureInputs:
    """Return the picture's input, and that of its size, where there is one.

    Raises:
        DataError: the network takes something else.
    """
    pictures = [port for port in inputs if len(port.shape) == _PICTURE_SIDES and port.shape[1] in (3, None)]
    sizes = [port for port in inputs if port.kind == SIZES and len(port.shape) == 2]
    if len(pictures) != 1 or len(pictures) + len(sizes) != len(inputs):
        shapes = ", ".join(f"{port.name} {list(port.shape)}" for port in inputs)
        raise DataError(f"takes {shapes}; a detector of pictures takes one, [1, 3, height, width]", path)
    batch = pictures[0].shape[0]
    if batch not in (None, 1):
        raise DataError(f"takes {batch} pictures at once; export it for one (batch=1)", path)
    return PictureInputs(pictures[0], sizes[0] if sizes else None)


def given_shapes(
    outputs: tuple[Port, ...], run: Callable[[], Mapping[str, npt.NDArray[Any]]]
) -> tuple[Port, ...]:
    """Return outputs as the file declares them, or as the network gives them where sides are left open.

    Args:
        outputs: what the file declares.
        run: runs the network once, on nothing.
    """
    if all(port.shape and None not in port.shape[1:] for port in outputs):
        return outputs
    found = run()
    return tuple(port._replace(shape=tuple(found[port.name].shape)) for port in outputs)


def network_of(
    outputs: tuple[Port, ...], side: tuple[int, int], notes: Mapping[str, str], path: Path
) -> Network:
    """Return what is known of a network; spreads say nothing of its layout.

    Raises:
        DataError: its task gives no boxes.
    """
    outputs = tuple(port for port in outputs if port.name != SPREADS)
    try:
        return Network(outputs, side, export_of(outputs, notes))
    except DataError as error:
        raise DataError(str(error), path) from None


def layout_of(network: Network, asked: str, path: Path) -> tuple[OutputLayout, int | None]:
    """Return the layout that the user asks for, or the one that is recognised, and its number of classes.

    Raises:
        DataError: none is recognised, or what is known of the network contradicts it.
    """
    try:
        if asked == AUTO:
            layout = recognise(network)
        else:
            layout = asked_for(asked, network)
            network = Network(network.outputs, network.side, network.export._replace(asked=True))
        return layout, layout.classes(network)
    except DataError as error:
        raise DataError(str(error), path) from None


def _fixed_side(outputs: tuple[Port, ...], side: tuple[int, int]) -> tuple[int, int] | None:
    """Return the side of a square input that has as many cells as the outputs have rows, if `side` has not.

    Some files leave the size of their input open, and hold a network of one size all the same.
    """
    sides = [
        side for port in outputs if len(port.shape) == ROWS for side in port.shape[1:] if side is not None
    ]
    rows = max(sides, default=0)
    squares = [(_STEP_PX * k, _STEP_PX * k) for k in range(1, _STEPS + 1)]
    fitting = [one for one in (side, *squares) if rows in _row_counts(one)]
    return None if not fitting or fitting[0] == side else fitting[0]


def _row_counts(side: tuple[int, int]) -> list[int]:
    """Return how many rows a network may give, one or three for each cell of an input (px)."""
    return [times * count for times in (1, 3) for count in cell_counts(side)]
