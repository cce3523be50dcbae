"""Which of a network's boxes are detections: of the wanted classes, good enough, and each thing once."""

from __future__ import annotations

import numpy as np

from jeat_graph.association.overlap import pairwise_iou
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.detection.models.layouts.record import DecodedBoxes

_CENTRES_PX = 1e-3
#: Boxes that are compared each with each; of more, the best. The others are hardly ever detections.
_MOST_COMPARED = 2000


def choose(
    found: DecodedBoxes,
    wanted: frozenset[int] | None,
    score: float,
    overlap: float,
    average: float = 1.0,
    across: float | None = None,
    apart: frozenset[int] = frozenset(),
) -> DecodedBoxes:
    """Return what is left, the best first.

    A thing that the network takes for a car and for a truck has a box of each class. Whichever is better
    stays, whether or not it is wanted: where a bicycle has the better box, there is no motorcycle.

    Args:
        found: all boxes.
        wanted: numbers of the classes that are kept, None for all.
        score: those below are left out.
        overlap: of two of one class that overlap by more (intersection over union) the better stays; not
            where the network has distinguished them itself (`found.distinct`).
        average: and becomes the mean, weighed by their scores, of all of its class that overlap it by at
            least so much: several cells of a network say where a vehicle is, each with an error of its own.
            So are spreads: such errors have most in common, and a mean of equal ones would be as large.
            1: it stays as it is. Source: box voting, Gidaris and Komodakis, "Object detection via a
            multi-region and semantic segmentation-aware CNN model" (2015).
        across: of two of different classes that overlap by more the better stays; by default as `overlap`.
        apart: numbers of classes that are never one thing with another class: people on vehicles.
    """
    import cv2

    keep = (found.scores >= score) & np.isfinite(found.corners).all(axis=1)
    with np.errstate(invalid="ignore"):  # infinite corners are left out already
        keep &= (found.corners[:, 2:] - found.corners[:, :2] > _CENTRES_PX).all(axis=1)
    found = found.taken(keep)
    corners, scores, classes = found.corners, found.scores, found.classes
    boxes = np.column_stack([corners[:, :2], corners[:, 2:] - corners[:, :2]])
    rows: IntArray = np.argsort(-scores, kind="stable")
    if not found.distinct and len(scores):
        places, marks = boxes.tolist(), scores.tolist()
        left = cv2.dnn.NMSBoxesBatched(places, marks, classes.tolist(), score, overlap)
        rows = np.asarray(left, dtype=np.int64).reshape(-1)
        rows = rows[np.argsort(-scores[rows], kind="stable")]
    rows = rows[_one_each(boxes[rows], classes[rows], overlap if across is None else across, apart)]
    if wanted is not None:
        rows = rows[np.isin(classes[rows], list(wanted))]
    chosen = found.taken(rows)
    if average < 1.0 and not found.distinct and len(rows):
        weights = _weights(boxes, scores, classes, rows, average)
        total = weights.sum(axis=1, keepdims=True)
        spreads = None if found.spreads is None else weights @ found.spreads / total
        chosen = chosen._replace(corners=weights @ corners / total, spreads=spreads)
    return chosen._replace(scores=np.clip(chosen.scores, 0.0, 1.0))


def _one_each(boxes: FloatArray, classes: IntArray, across: float, apart: frozenset[int]) -> BoolArray:
    """Return which boxes (M, 4), best first, are of no thing for which another class has a better one."""
    stay = np.ones(len(boxes), dtype=np.bool_)
    boxes, classes = boxes[:_MOST_COMPARED], classes[:_MOST_COMPARED]
    if not len(boxes) or (classes == classes[0]).all():
        return stay
    alone = np.isin(classes, list(apart))
    rivals = (classes[:, None] != classes[None]) & ~alone[:, None] & ~alone[None]
    same = (pairwise_iou(boxes, boxes) > across) & rivals
    for best in np.flatnonzero(same.any(axis=1)).tolist():
        if stay[best]:
            stay[best + 1 : len(boxes)] &= ~same[best, best + 1 :]
    return stay


def _weights(
    boxes: FloatArray, scores: FloatArray, classes: IntArray, rows: IntArray, average: float
) -> FloatArray:
    """Return the weights (M, N) by which boxes count for each that stays (rows, (M,))."""
    near = pairwise_iou(boxes[rows].astype(float), boxes.astype(float)) >= average
    weights = (near & (classes[rows][:, None] == classes[None])) * scores
    # Rounding may leave a box a hair short of overlapping itself.
    weights[np.arange(len(rows)), rows] = scores[rows]
    return np.asarray(weights)
