"""DETR and its kin: logits of classes, and boxes by centre and size in shares of the picture."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.detection.models.exports import BOX
from jeat_graph.detection.models.layouts.numbers import best_class, from_centre, in_px, logistic
from jeat_graph.detection.models.layouts.record import (
    EVEN_PROBABILITY,
    RGB_IMAGENET,
    RGB_STRETCHED,
    ROWS,
    DecodedBoxes,
    Fit,
    Network,
    OutputLayout,
    Outputs,
)

_PAIRS = ({"logits", "pred_boxes"}, {"labels", "dets"})
_LOGITS, _BOXES = ("logits", "labels"), ("pred_boxes", "dets")
#: COCO's own 91 numbers and a class for "nothing".
_COCO_AND_NOTHING = 92


def _fit(network: Network) -> Fit:
    return min(_fit_names(network), Fit.POSSIBLE) if _has_nothing(network) else _fit_names(network)


def _fit_softmax(network: Network) -> Fit:
    return _fit_names(network) if _has_nothing(network) else min(_fit_names(network), Fit.POSSIBLE)


def _fit_names(network: Network) -> Fit:
    named = any(pair <= network.names for pair in _PAIRS)
    tables = all(
        len(port.shape) == ROWS for port in network.outputs if port.name.lower() in (*_LOGITS, *_BOXES)
    )
    return Fit.NAMES if named and tables and network.last_side(*_BOXES) in (BOX, None) else Fit.NO


def _has_nothing(network: Network) -> bool:
    return network.last_side(*_LOGITS) == _COCO_AND_NOTHING


def _classes(network: Network) -> int | None:
    return network.last_side(*_LOGITS)


def _decode(outputs: Outputs, side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    logits, corners = _queries(outputs, side)
    return best_class(corners, logistic(logits), distinct=True)


def _decode_softmax(outputs: Outputs, side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    logits, corners = _queries(outputs, side)
    shares = np.exp(logits - logits.max(axis=1, keepdims=True))
    return best_class(corners, (shares / shares.sum(axis=1, keepdims=True))[:, :-1], distinct=True)


def _queries(outputs: Outputs, side: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Return logits (K, C) and corners (K, 4) in px."""
    low = {name.lower(): np.asarray(value, dtype=np.float64)[0] for name, value in outputs.items()}
    logits, boxes = (next((low[name] for name in names if name in low), None) for names in (_LOGITS, _BOXES))
    if logits is None or boxes is None:
        raise ValueError("they must be called logits and pred_boxes, or labels and dets")
    return logits, in_px(from_centre(boxes), side)


LAYOUTS = (
    OutputLayout(
        name="detr",
        detectors="RT-DETR, D-FINE, DEIM, RF-DETR",
        outputs="`logits` and `pred_boxes`, or `labels` and `dets`",
        fit=_fit,
        decode=_decode,
        classes=_classes,
        feed=RGB_STRETCHED,
        least_score=0.4,
    ),
    OutputLayout(
        name="detr-softmax",
        detectors='DETR with a class for "nothing"',
        outputs="`logits`, `pred_boxes`",
        fit=_fit_softmax,
        decode=_decode_softmax,
        classes=_classes,
        feed=RGB_IMAGENET,
        least_score=0.5,
        even_score=EVEN_PROBABILITY,
    ),
)
