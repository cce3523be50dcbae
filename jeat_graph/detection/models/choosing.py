"""Which of a network's boxes are detections: of the wanted classes, good enough, and each thing once."""

from __future__ import annotations

import ast
from collections.abc import Mapping

import numpy as np

from jeat_graph.association.overlap import pairwise_iou
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.models.layouts import DecodedBoxes

#: Vehicles among the 80 classes of COCO, and in its own numbering up to 90.
_COCO_80 = {2: "car", 3: "motorcycle", 5: "bus", 7: "truck"}
_COCO_90 = {3: "car", 4: "motorcycle", 6: "bus", 8: "truck"}
_VEHICLES = {"car", "motorcycle", "motorbike", "bus", "truck", "van", "vehicle", "trailer", "lorry"}
_CENTRES_PX = 1e-3


def class_names(notes: Mapping[str, str]) -> dict[int, str]:
    """Return the names that YOLO exports write into their notes, `{0: 'car', …}`; none without them."""
    try:
        names = ast.literal_eval(notes.get("names", "{}"))
        return {int(number): str(name) for number, name in dict(names).items()}
    except (ValueError, SyntaxError, TypeError):
        return {}


def wanted_classes(
    asked: tuple[str, ...], count: int | None, names: Mapping[int, str]
) -> tuple[frozenset[int] | None, str]:
    """Return the numbers of the classes that are kept, None for all, and a few words that say so.

    Args:
        asked: names or numbers that the user gave; `all` for all.
        count: how many classes the network has, if known.
        names: their names, if known.

    Raises:
        ConfigError: a name that is not known.
    """
    known = dict(names)
    if not known and count == 80:
        known = _COCO_80
    elif not known and count in (91, 92):
        known = _COCO_90
    if asked == ("all",):
        return None, "all classes"
    if asked:
        by_name = {name.lower(): number for number, name in known.items()}
        unknown = [one for one in asked if not one.isdecimal() and one.lower() not in by_name]
        if unknown:
            raise ConfigError(
                f"classes: {unknown[0]!r} is none of the network's; give its number, or one of "
                f"{', '.join(sorted(by_name)) or 'none: the file has no names'}"
            )
        numbers = frozenset(int(one) if one.isdecimal() else by_name[one.lower()] for one in asked)
        return numbers, f"classes {', '.join(asked)}"
    vehicles = {number: name for number, name in known.items() if name.lower() in _VEHICLES}
    if not vehicles:
        return None, "all classes"
    return frozenset(vehicles), f"classes {', '.join(vehicles.values())}"


def choose(
    found: DecodedBoxes, wanted: frozenset[int] | None, score: float, overlap: float, average: float = 1.0
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return corners (M, 4), scores (M,) and classes (M,) of what is left.

    Args:
        found: all boxes.
        wanted: numbers of the classes that are kept, None for all.
        score: those below are left out.
        overlap: of two that overlap by more (intersection over union), of any class, the better stays.
        average: and becomes the mean, weighed by their scores, of all that overlap it by at least so much:
            several cells of a network say where a vehicle is, each with an error of its own. 1: it stays as
            it is. Source: box voting, Gidaris and Komodakis, "Object detection via a multi-region and
            semantic segmentation-aware CNN model" (2015).
    """
    import cv2

    keep = (found.scores >= score) & np.isfinite(found.corners).all(axis=1)
    with np.errstate(invalid="ignore"):  # infinite corners are left out already
        keep &= (found.corners[:, 2:] - found.corners[:, :2] > _CENTRES_PX).all(axis=1)
    if wanted is not None:
        keep &= np.isin(found.classes, list(wanted))
    corners, scores, classes = found.corners[keep], found.scores[keep], found.classes[keep]
    if not found.distinct and len(scores):
        boxes = np.column_stack([corners[:, :2], corners[:, 2:] - corners[:, :2]])
        rows = np.asarray(cv2.dnn.NMSBoxes(boxes.tolist(), scores.tolist(), score, overlap)).reshape(-1)
        best = scores[rows]
        corners = _averaged(corners, boxes, scores, rows, average) if average < 1.0 else corners[rows]
        scores, classes = best, classes[rows]
    return corners, np.clip(scores, 0.0, 1.0), classes


def _averaged(
    corners: FloatArray, boxes: FloatArray, scores: FloatArray, rows: IntArray, average: float
) -> FloatArray:
    """Return the mean corners (M, 4) of what overlaps each box that stays (rows, (M,))."""
    weights = (pairwise_iou(boxes[rows].astype(float), boxes.astype(float)) >= average) * scores
    # Rounding may leave a box a hair short of overlapping itself.
    weights[np.arange(len(rows)), rows] = scores[rows]
    mean: FloatArray = weights @ corners / weights.sum(axis=1, keepdims=True)
    return mean
