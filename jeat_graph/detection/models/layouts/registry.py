"""All layouts, found by the files of this folder; which one a network has, and what its outputs mean by it.

A file has `LAYOUTS`, its records. What decides is, in this order: the notes of the network's file, the shapes
of its outputs, their names (`record.Fit`). A layout that contradicts the notes or the shapes is refused, also
where the user asks for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.data.records import records_in
from jeat_graph.detection.models import layouts
from jeat_graph.detection.models.layouts.record import (
    SPREADS,
    DecodedBoxes,
    Fit,
    Network,
    OutputLayout,
    Outputs,
)
from jeat_graph.detection.models.onnx_head import Port

_RECORDS = "LAYOUTS"
_SIDES = 4


@cache
def all_layouts() -> dict[str, OutputLayout]:
    """Return all layouts by name, in the order of their files' names."""
    records = [record for of_file in records_in(layouts.__name__, _RECORDS) for record in of_file]
    return {record.name: record for record in records}


def recognise(network: Network) -> OutputLayout:
    """Return the layout that goes best with what is known of a network.

    Raises:
        DataError: none goes with it, or two go with it equally well.
    """
    fits = {record.name: record.fit(network) for record in all_layouts().values()}
    best = max(fits.values())
    found = [name for name, fit in fits.items() if fit == best]
    if best <= Fit.POSSIBLE:
        raise DataError(
            f"has outputs of no layout that is known: {shapes_of(network.outputs)}"
            f"{network.export.description}; say which with layout: one of {', '.join(all_layouts())}"
        )
    if len(found) > 1:
        raise DataError(
            f"has outputs of {' or '.join(found)}: {shapes_of(network.outputs)}{network.export.description}; "
            "say which with layout"
        )
    return all_layouts()[found[0]]


def asked_for(name: str, network: Network) -> OutputLayout:
    """Return the layout that a user asks for.

    Raises:
        DataError: what is known of the network contradicts it.
    """
    layout = all_layouts()[name]
    if layout.fit(network) == Fit.NO:
        raise DataError(
            f"cannot be of the layout {name}: its outputs are {shapes_of(network.outputs)}"
            f"{network.export.description}"
        )
    return layout


def decode(name: str, outputs: Outputs, side: tuple[int, int], classes: int | None = None) -> DecodedBoxes:
    """Turn outputs into boxes.

    Args:
        name: of a layout.
        outputs: by name, in the order of the file; spreads are read in every layout.
        side: width and height of the input (px).
        classes: how many numbers of a row are scores of classes; None: all behind the box.

    Raises:
        DataError: the outputs are not of that layout.
    """
    own = {key: value for key, value in outputs.items() if key != SPREADS}
    try:
        with np.errstate(invalid="ignore", over="ignore"):  # what is no number is counted by who asks
            found = all_layouts()[name].decode(own, side, classes)
        if SPREADS not in outputs:
            return found
        spreads = np.asarray(outputs[SPREADS], dtype=np.float64)
        return found._replace(spreads=spreads.reshape(_SIDES, len(found.scores)).T)
    except (ValueError, IndexError, KeyError, StopIteration) as error:
        shapes = ", ".join(f"{name} {list(value.shape)}" for name, value in outputs.items())
        raise DataError(f"the network's outputs {shapes} are not of the layout {name}: {error}") from None


def shapes_of(outputs: Sequence[Port]) -> str:
    """Say names and shapes of outputs, an open side as `?`."""
    return ", ".join(
        f"{port.name} [{', '.join('?' if side is None else str(side) for side in port.shape)}]"
        for port in outputs
    )
