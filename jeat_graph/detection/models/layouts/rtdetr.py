"""RT-DETR of Ultralytics: centre and size in shares of the picture, then score and class, or all classes."""

from __future__ import annotations

from jeat_graph.detection.models.exports import BOX, ROW
from jeat_graph.detection.models.layouts.numbers import (
    COCO,
    are_few,
    best_class,
    from_centre,
    in_px,
    labelled,
    rows_of,
)
from jeat_graph.detection.models.layouts.record import (
    RGB_STRETCHED,
    DecodedBoxes,
    Fit,
    Network,
    OutputLayout,
    Outputs,
)


def _fit(network: Network) -> Fit:
    table, export = network.table, network.export
    if table is None or table[1] is None or table[1] < BOX + 1 or not are_few(table[0], network.side):
        return Fit.NO
    if not export.rtdetr:
        return Fit.POSSIBLE
    widths = (ROW, BOX + (COCO if export.classes is None else export.classes))
    return Fit.NOTES if table[1] in widths else Fit.NO


def _classes(network: Network) -> int | None:
    return COCO if network.export.classes is None else network.export.classes


def _decode(outputs: Outputs, side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    rows = rows_of(outputs)
    corners = in_px(from_centre(rows[:, :BOX]), side)
    numbers = rows[:, BOX + 1 :]
    # Two classes have as many numbers as a score and a class, which is a whole number.
    if rows.shape[1] == ROW and not (classes == 2 and (numbers % 1.0 != 0.0).any()):
        return labelled(corners, rows[:, BOX], rows[:, BOX + 1])
    return best_class(corners, rows[:, BOX:], distinct=True)


LAYOUTS = (
    OutputLayout(
        name="rtdetr",
        detectors="RT-DETR of Ultralytics",
        outputs="`[1, K, 6]` or `[1, K, 4 + C]`",
        fit=_fit,
        decode=_decode,
        classes=_classes,
        feed=RGB_STRETCHED,
        least_score=0.4,
    ),
)
