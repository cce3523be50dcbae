"""NanoDet: classes, and distributions of the distances from a cell's middle to the sides, in strides."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.detection.models.exports import BOX
from jeat_graph.detection.models.layouts.numbers import (
    COCO,
    MORE_STRIDES,
    STRIDES,
    best_class,
    cell_count,
    cells,
    in_full,
)
from jeat_graph.detection.models.layouts.record import (
    BGR_IMAGENET,
    DecodedBoxes,
    Fit,
    Network,
    OutputLayout,
    Outputs,
)

#: Bins of the distances.
_BINS = (8, 16)


def _fit(network: Network) -> Fit:
    shapes = network.tables
    if len(shapes) != len(network.outputs):
        return Fit.NO
    if network.table is not None:
        rows, numbers = network.table
        counts = [cell_count(network.side, strides) for strides in (STRIDES, MORE_STRIDES)]
        classes = COCO if network.export.classes is None else network.export.classes
        fits = rows in counts and numbers in [classes + BOX * bins for bins in _BINS]
        return Fit.EXACT if fits else Fit.NO
    for strides in (STRIDES, MORE_STRIDES):
        counts = sorted(2 * [cell_count(network.side, (stride,)) for stride in strides])
        if sorted(shape[1] or 0 for shape in shapes) == counts:
            return Fit.FORM
    return Fit.NO


def _classes(network: Network) -> int | None:
    if network.table is not None:
        return COCO if network.export.classes is None else network.export.classes
    return next((shape[2] for shape in network.tables), None)


def _decode(outputs: Outputs, side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    of_classes, distances = _parts(outputs, [in_full(value)[0] for value in outputs.values()], classes)
    strides = STRIDES if len(of_classes) == cell_count(side) else MORE_STRIDES
    places, steps = cells(side, strides)
    parts = distances.reshape(len(distances), 4, -1)
    shares = np.exp(parts - parts.max(axis=2, keepdims=True))
    reach = (shares * np.arange(parts.shape[2])).sum(axis=2) / shares.sum(axis=2) * steps[:, None]
    centre = (places + 0.5) * steps[:, None]
    corners = np.column_stack([centre - reach[:, :2], centre + reach[:, 2:]])
    return best_class(corners, of_classes, distinct=False)


def _parts(
    outputs: Outputs, arrays: Sequence[npt.NDArray[Any]], classes: int | None
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return scores of classes (N, C) and distances (N, 4 R), the finest stride first."""
    if len(arrays) == 1:
        widths = [arrays[0].shape[1] - BOX * bins for bins in _BINS]
        count = classes if classes in widths else next(width for width in widths if width >= 1)
        return arrays[0][:, :count], arrays[0][:, count:]
    half = len(arrays) // 2
    # Grouped by kind, or in pairs: the two kinds differ in their last side.
    kinds = sorted({array.shape[1] for array in arrays})
    is_distance = ["dis" in name.lower() or "reg" in name.lower() for name in outputs]
    if sum(is_distance) != half:
        is_distance = [array.shape[1] == min(kinds) for array in arrays]
    picked = [[a for a, d in zip(arrays, is_distance, strict=True) if d is kind] for kind in (False, True)]
    of_classes, distances = (np.concatenate(sorted(group, key=len, reverse=True)) for group in picked)
    return of_classes, distances


LAYOUTS = (
    OutputLayout(
        name="nanodet",
        detectors="NanoDet and NanoDet-Plus",
        outputs="classes `[1, n, C]` and distances `[1, n, 4 R]`, one a stride or all in one",
        fit=_fit,
        decode=_decode,
        classes=_classes,
        feed=BGR_IMAGENET,
        least_score=0.35,
    ),
)
