"""YOLOX: a row for each cell of strides 8, 16, 32, of box, objectness and classes; decoded, or not."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from jeat_graph.detection.models.exports import BOX
from jeat_graph.detection.models.layouts.numbers import (
    COCO,
    cell_count,
    cells,
    room_beside_objectness,
    rows_of,
    with_objectness,
)
from jeat_graph.detection.models.layouts.record import (
    BGR_LETTERBOX,
    DecodedBoxes,
    Fit,
    Network,
    OutputLayout,
    Outputs,
)

#: A raw box may reach beyond the input, but is no larger than so many of its sides.
_LARGEST_BOX = 4.0


def _fit(network: Network) -> Fit:
    table, export = network.table, network.export
    if table is None or export.suppressed or export.rtdetr or table[0] != cell_count(network.side):
        return Fit.NO
    numbers = table[1]
    if numbers is None or numbers < BOX + 1:
        return Fit.NO
    if export.classes is not None:
        return Fit.EXACT if numbers == BOX + 1 + export.classes + export.behind else Fit.NO
    if numbers == BOX + COCO:  # of 80 classes without an objectness
        return Fit.POSSIBLE
    return Fit.EXACT if numbers == BOX + 1 + COCO else Fit.FORM


def _fit_raw(network: Network) -> Fit:
    return min(_fit(network), Fit.POSSIBLE)  # the values tell, not the shapes


def _decode(outputs: Outputs, side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    return with_objectness(rows_of(outputs), classes)


def _decode_raw(outputs: Outputs, side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    rows = rows_of(outputs).copy()
    places, strides = cells(side)
    rows[:, :2] = (rows[:, :2] + places) * strides[:, None]
    rows[:, 2:4] = np.exp(rows[:, 2:4]) * strides[:, None]
    return with_objectness(rows, classes)


def _settled(outputs: Outputs, side: tuple[int, int]) -> str:
    return RAW.name if is_raw(rows_of(outputs), side) else DECODED.name


def is_raw(rows: npt.NDArray[np.floating], side: tuple[int, int]) -> bool:
    """Whether YOLOX's boxes (N, 4) are still offsets in cells: then they do not lie where their cells do."""
    places, strides = cells(side)
    if len(rows) != len(places):
        return False
    good = np.isfinite(rows).all(axis=1)
    if not good.any():
        return False
    rows, places, strides = rows[good], places[good], strides[good]
    if rows[:, 2:4].max() > np.log(_LARGEST_BOX * max(side)):  # no logarithm of a size
        return False
    decoded = np.median(np.abs(rows[:, :2] / strides[:, None] - places - 0.5))
    return bool(np.median(np.abs(rows[:, :2] - 0.5)) < decoded or (rows[:, 2:4] < 0).any())


DECODED = OutputLayout(
    name="yolox",
    detectors="YOLOX",
    outputs="`[1, N, 5 + C]`, one row a cell",
    fit=_fit,
    decode=_decode,
    classes=room_beside_objectness,
    feed=BGR_LETTERBOX,
    least_score=0.3,
    settled=_settled,
)
RAW = OutputLayout(
    name="yolox-raw",
    detectors="YOLOX, not decoded (the values tell)",
    outputs="the same: offsets in cells, logarithms of sizes",
    fit=_fit_raw,
    decode=_decode_raw,
    classes=room_beside_objectness,
    feed=BGR_LETTERBOX,
    least_score=0.3,
)
LAYOUTS = (DECODED, RAW)
