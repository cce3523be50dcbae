"""YOLOv8 and its like: a column (or a row) for each cell, of box and classes, and of what else a task has."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt

from jeat_graph.detection.models.exports import BOX, TURNED, class_channels
from jeat_graph.detection.models.layouts.numbers import (
    COCO,
    around_turned,
    best_class,
    cell_count,
    cell_counts,
    from_centre,
    rows_of,
)
from jeat_graph.detection.models.layouts.record import DecodedBoxes, Fit, Network, OutputLayout, Outputs

#: Cells of strides 8, 16 and 32 in the smallest input, of 32 px.
_FEWEST_CELLS = 21


def _fit_upright(network: Network) -> Fit:
    return Fit.NO if network.export.task == TURNED else _fit(network, turned=False)


def _fit_turned(network: Network) -> Fit:
    if network.export.task == TURNED:
        return _fit(network, turned=True)
    # Without a task in the notes it may be, if the user says so.
    return Fit.NO if network.export.declared_task else min(_fit(network, turned=True), Fit.POSSIBLE)


def _fit(network: Network, *, turned: bool) -> Fit:
    export = network.export
    if network.table is None or export.suppressed or export.rtdetr:
        return Fit.NO
    numbers, upright = _numbers(network)
    if numbers is None or numbers < BOX + 1 + turned:
        return Fit.NO
    own = BOX + (COCO if export.classes is None else export.classes) + (export.more or 0)
    if numbers == own and upright is not None:
        if export.classes is None:
            return Fit.EXACT if upright == cell_count(network.side) else Fit.FORM
        return Fit.NOTES if export.declared_task else Fit.EXACT
    # Rows as long as the cells are many, of other classes than the notes say, are refused by `classes`.
    across = network.table[1] == upright
    return Fit.FORM if across else Fit.POSSIBLE


def _numbers(network: Network) -> tuple[int | None, int | None]:
    """Return how many numbers a cell has, and how many cells there are; None where it cannot be known."""
    assert network.table is not None
    first, second = network.table
    counts = cell_counts(network.side)
    if second in counts:
        return first, second
    if first in counts:
        return second, first
    if first is not None and second is not None and second > first and second >= _FEWEST_CELLS:
        return first, second
    return None, None


def _classes(network: Network) -> int | None:
    numbers, _ = _numbers(network)
    return None if numbers is None else class_channels(numbers, network.export)


def _classes_turned(network: Network) -> int | None:
    numbers, _ = _numbers(network)
    if numbers is None:
        return None
    return numbers - BOX - 1 if network.export.task != TURNED else class_channels(numbers, network.export)


def _decode(outputs: Outputs, side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    rows = _a_row_each(rows_of(outputs))
    end = None if classes is None else BOX + classes
    return best_class(from_centre(rows[:, :BOX]), rows[:, BOX:end], distinct=False)


def _decode_turned(outputs: Outputs, side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    rows = _a_row_each(rows_of(outputs))
    return best_class(around_turned(rows[:, :BOX], rows[:, -1]), rows[:, BOX:-1], distinct=False)


def _a_row_each(rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return one row a box, also where the file has one column a box."""
    return rows.T if rows.shape[0] < rows.shape[1] else rows


LAYOUTS = (
    OutputLayout(
        name="yolov8",
        detectors="YOLOv8, v9, 11, 26 without its own suppression; of segmentations and poses their boxes",
        outputs="`[1, 4 + C, N]` or transposed; more behind the classes is passed over",
        fit=_fit_upright,
        decode=_decode,
        classes=_classes,
    ),
    OutputLayout(
        name="yolov8-obb",
        detectors="the same with turned boxes: upright ones around them",
        outputs="`[1, 4 + C + 1, N]`, the angle last",
        fit=_fit_turned,
        decode=_decode_turned,
        classes=_classes_turned,
    ),
)
