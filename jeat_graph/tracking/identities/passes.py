"""Passes of the tracker over a recording: forward or backward in time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.progress import with_progress
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.tracking.engine import lacking
from jeat_graph.tracking.one_model import OneModel

if TYPE_CHECKING:
    from jeat_graph.tracking.model_tracker import ModelTracker


class Pass(NamedTuple):
    """What one pass says of N detections, in their order.

    Attributes:
        assigned: (N,) which of its tracks took each.
        real: (N,) posterior of that track then.
    """

    assigned: IntArray
    real: FloatArray


def took(tracker: ModelTracker, number: int) -> Pass:
    """Return which tracks took the detections of a tracker's last step, and their posteriors."""
    assigned = tracker.assigned(number)
    living, real = tracker._model.living(), tracker._model.fit()[2]
    out, found = np.zeros(number), assigned > 0
    out[found] = real[np.searchsorted(living, assigned[found])]
    return Pass(assigned, out)


def camera_moved(tracker: ModelTracker) -> FloatArray:
    """Return how far the camera's motion has taken a point at rest (2,) (px)."""
    model = tracker._model
    if not isinstance(model, OneModel):
        raise lacking(model.name, "does not say how the camera moved")
    return model.camera_moved()


def one_pass(
    detections: Detections, like: ModelTracker, constants: ModelConstants, *, backward: bool
) -> Pass:
    """Track a recording, whose boxes are in the common picture, and return who took what.

    Args:
        detections: all scans.
        like: a tracker with the configuration.
        constants: of the model.
        backward: from the last scan to the first, as if time went backward.
    """
    tracker = like.fresh_copy(smooths=False, constants=constants)
    assigned, real = np.zeros(len(detections), dtype=np.int64), np.zeros(len(detections))
    for rows, batch in with_progress(steps(detections, backward=backward), len(np.unique(detections.scan_t))):
        tracker.take_in(batch)
        assigned[rows], real[rows] = took(tracker, rows.stop - rows.start)
    return Pass(assigned, real)


def steps(detections: Detections, *, backward: bool = False) -> Iterator[tuple[slice, list[Scan]]]:
    """Yield the scans of each time with the rows of their detections; backward, the last time comes first."""
    starts = np.flatnonzero(np.diff(detections.scan_t, prepend=-np.inf) != 0)
    ends = np.append(starts, detections.num_scans)[1:]
    order = range(len(starts) - 1, -1, -1) if backward else range(len(starts))
    for k in order:
        rows = slice(int(detections.scan_start[starts[k]]), int(detections.scan_start[ends[k]]))
        batch = [detections.scan(j) for j in range(starts[k], ends[k])]
        if backward:
            t = float(detections.scan_t[0] + detections.scan_t[-1] - batch[0].t)
            batch = [replace(scan, t=t, camera_motion=None) for scan in batch]
        yield rows, batch
