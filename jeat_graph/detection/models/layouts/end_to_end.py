"""Networks that suppress by themselves: a row for each detection, of corners, score and class."""

from __future__ import annotations

import numpy as np

from jeat_graph.detection.models.exports import BOX, ROW, TURNED
from jeat_graph.detection.models.layouts.numbers import COCO, are_few, around_turned, labelled, rows_of
from jeat_graph.detection.models.layouts.record import DecodedBoxes, Fit, Network, OutputLayout, Outputs

# Boxes that score this are something, and no larger numbers than this are shares of the picture.
_SOMETHING, _SHARES = 0.05, 2.0


def _fit_upright(network: Network) -> Fit:
    return Fit.NO if network.export.task == TURNED else _fit(network)


def _fit_turned(network: Network) -> Fit:
    if network.export.task == TURNED:
        return _fit(network)
    return Fit.NO if network.export.declared_task else min(_fit(network, 1), Fit.POSSIBLE)


def _fit(network: Network, beside: int = 0) -> Fit:
    table, export = network.table, network.export
    if table is None or export.rtdetr or export.suppressed is False:
        return Fit.NO
    rows, numbers = table
    own = ROW + (export.more or 0) + beside
    if numbers is None or numbers < ROW + beside:
        return Fit.NO
    if export.suppressed:
        return Fit.NOTES if numbers == own else Fit.NO
    return Fit.FORM if numbers == own and are_few(rows, network.side) else Fit.POSSIBLE


def _classes(network: Network) -> int | None:
    return COCO if network.export.classes is None else network.export.classes


def _decode(outputs: Outputs, side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    rows = rows_of(outputs)
    _check_width(rows.shape[1], ROW)
    there = rows[:, BOX] > _SOMETHING
    if there.any() and (np.abs(rows[there, :BOX]) <= _SHARES).all():
        raise ValueError("its boxes are shares of the picture; of RT-DETR? then say layout: rtdetr")
    return labelled(rows[:, :BOX], rows[:, BOX], rows[:, BOX + 1])


def _decode_turned(outputs: Outputs, side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    rows = rows_of(outputs)
    _check_width(rows.shape[1], ROW + 1)
    return labelled(around_turned(rows[:, :BOX], rows[:, ROW]), rows[:, BOX], rows[:, BOX + 1])


def _check_width(numbers: int, least: int) -> None:
    if numbers < least:
        raise ValueError(f"a row needs {least} numbers")


LAYOUTS = (
    OutputLayout(
        name="end-to-end",
        detectors="YOLOv10, YOLO26 and others that suppress by themselves (`nms=True`)",
        outputs="`[1, K, 6]` or more: corners, score, class",
        fit=_fit_upright,
        decode=_decode,
        classes=_classes,
    ),
    OutputLayout(
        name="end-to-end-obb",
        detectors="the same with turned boxes",
        outputs="`[1, K, 7]`: centre, size, score, class, angle",
        fit=_fit_turned,
        decode=_decode_turned,
        classes=_classes,
    ),
)
