"""YOLOv5 and YOLOv7: three rows for each cell, of box, objectness and classes."""

from __future__ import annotations

from jeat_graph.detection.models.exports import BOX
from jeat_graph.detection.models.layouts.numbers import (
    MORE_STRIDES,
    STRIDES,
    cell_count,
    room_beside_objectness,
    rows_of,
    with_objectness,
)
from jeat_graph.detection.models.layouts.record import DecodedBoxes, Fit, Network, OutputLayout, Outputs

_A_CELL = 3


def _fit(network: Network) -> Fit:
    table, export = network.table, network.export
    if table is None or export.suppressed or export.rtdetr:
        return Fit.NO
    rows, numbers = table
    counts = [_A_CELL * cell_count(network.side, strides) for strides in (STRIDES, MORE_STRIDES)]
    if rows not in counts or numbers is None or numbers < BOX + 1:
        return Fit.NO
    if export.classes is not None and numbers != BOX + 1 + export.classes + export.behind:
        return Fit.NO
    return Fit.EXACT


def _decode(outputs: Outputs, side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    return with_objectness(rows_of(outputs), classes)


LAYOUTS = (
    OutputLayout(
        name="yolov5",
        detectors="YOLOv5, YOLOv7",
        outputs="`[1, N, 5 + C]`, three rows a cell",
        fit=_fit,
        decode=_decode,
        classes=room_beside_objectness,
    ),
)
