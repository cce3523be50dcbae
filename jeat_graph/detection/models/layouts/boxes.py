"""Boxes and scores in outputs of their own, as DETRs give them with their last step, and YOLO-NAS."""

from __future__ import annotations

import numpy as np

from jeat_graph.detection.models.exports import BOX
from jeat_graph.detection.models.layouts.numbers import COCO, best_class, in_px, labelled
from jeat_graph.detection.models.layouts.record import (
    RGB_STRETCHED,
    ROWS,
    DecodedBoxes,
    Fit,
    Network,
    OutputLayout,
    Outputs,
)

#: No larger numbers than this are shares of the picture.
_SHARES = 2.0


def _fit(network: Network) -> Fit:
    there = {"boxes", "scores"} <= network.names and network.last_side("boxes") in (BOX, None)
    return Fit.NAMES if there else Fit.NO


def _classes(network: Network) -> int | None:
    return COCO if network.export.classes is None else network.export.classes


def _decode(outputs: Outputs, side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    low = {name.lower(): np.asarray(value, dtype=np.float64) for name, value in outputs.items()}
    corners = low["boxes"].reshape(-1, BOX)
    if len(corners) and not (corners > _SHARES).any():
        corners = in_px(corners, side)
    if low["scores"].ndim == ROWS and low["scores"].shape[2] > 1:  # a score for each class (YOLO-NAS)
        return best_class(corners, low["scores"][0], distinct=False)
    labels = low["labels"].reshape(-1) if "labels" in low else np.zeros(len(corners))
    return labelled(corners, low["scores"].reshape(-1), labels)


LAYOUTS = (
    OutputLayout(
        name="boxes",
        detectors="RT-DETR and D-FINE exported with their last step, YOLO-NAS",
        outputs="`labels`, `boxes`, `scores`",
        fit=_fit,
        decode=_decode,
        classes=_classes,
        feed=RGB_STRETCHED,
        least_score=0.4,
    ),
)
