"""Boxes and tracks as `supervision.Detections`; a user's own detections with the tracks that took them."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray, TextArray
from jeat_graph.data.interop import to_xyxy

#: What stands in `class_id` and in `tracker_id` where there is none.
NO_CLASS, NO_TRACK = -1, -1


def supervision_of(
    boxes: FloatArray,
    confidence: FloatArray,
    classes: TextArray | None,
    tracker_id: npt.NDArray[np.int64] | None = None,
    class_ids: Mapping[str, int] | None = None,
) -> Any:
    """Make `supervision.Detections`.

    Args:
        boxes: (M, 4) left, top, width, height (px).
        confidence: (M,) scores or probabilities.
        classes: (M,) names, kept in `data["class_name"]`, or None: then all have `class_id` 0.
        tracker_id: (M,) identities, or None.
        class_ids: number of each class, where it is known. Else a name that is a number is its own, others
            are counted in the order of the alphabet, and what has no class has -1.

    Raises:
        ImportError: the package `supervision` is not installed.
    """
    import supervision

    class_id = np.zeros(len(boxes), dtype=int)
    data: dict[str, Any] = {}
    if classes is not None:
        ids = numbered(classes.tolist(), class_ids or {})
        class_id = np.array([ids[name] for name in classes.tolist()], dtype=int)
        data = {"class_name": classes.copy()}
    return supervision.Detections(
        xyxy=to_xyxy(boxes),
        confidence=confidence.copy(),
        class_id=class_id,
        tracker_id=None if tracker_id is None else tracker_id.astype(int),
        data=data,
    )


def numbered(names: Sequence[str], known: Mapping[str, int]) -> dict[str, int]:
    """Return a number for each class: that which is known, its name if that is one, else the next free one.

    Args:
        names: of classes, in any order, also several times; empty text where there is none.
        known: numbers that are known already.
    """
    out = dict(known) | {"": NO_CLASS}
    fresh = sorted(set(names) - set(out))
    out |= {name: int(name) for name in fresh if name.isdecimal()}
    taken = set(out.values())
    free = (k for k in itertools.count() if k not in taken)
    return out | {name: next(free) for name in fresh if name not in out}


class OwnDetections(NamedTuple):
    """A user's `supervision.Detections`, and which track took each of them.

    Attributes:
        detections: as they were given.
        assigned: (R,) identity of the track, 0 where none took it.
    """

    detections: Any
    assigned: IntArray

    def of(self, track_id: IntArray) -> OwnDetections:
        """Return those that some tracks took."""
        rows = np.flatnonzero(np.isin(self.assigned, track_id))
        return OwnDetections(self.detections[rows], self.assigned[rows])

    def with_tracks(self, track_id: IntArray) -> Any:
        """Return all of them, with masks, data and whatever else they have, and with `tracker_id`.

        Args:
            track_id: (N,) tracks that are reported; of a detection that none of these took it is -1.
        """
        out = self.detections[np.arange(len(self.assigned))]
        out.tracker_id = np.where(np.isin(self.assigned, track_id), self.assigned, NO_TRACK).astype(int)
        return out
