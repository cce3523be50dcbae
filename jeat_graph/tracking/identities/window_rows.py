"""Detections in a window, and which pieces of tracks go on with identities that were decided."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.tracking.identities import saved_parts


class WindowRows(NamedTuple):
    """Detections, in order of time.

    Attributes:
        number: (N,) of all, from 0.
        t: (N,) time (s).
        sensor: (N,) as the tracker counts them.
        boxes: (N, 4) left, top, right, bottom (px), as they came.
        causal: (N,) causal track that took each.
        odds: (N,) log odds that this track is real then: of the causal pass, once decided of both.
        owner: (N,) identity that was decided, 0 for nobody's, -1 before it is.
        camera: (N, 2) how far the camera's motion had taken what is at rest (px).
        box_std: (N, 4) standard deviations of the sides by the detector (px), NaN where unknown.
    """

    number: IntArray
    t: FloatArray
    sensor: IntArray
    boxes: FloatArray
    causal: IntArray
    odds: FloatArray
    owner: IntArray
    camera: FloatArray
    box_std: FloatArray

    def take(self, rows: IntArray | BoolArray) -> WindowRows:
        """Return some of them."""
        return WindowRows(
            self.number[rows],
            self.t[rows],
            self.sensor[rows],
            self.boxes[rows],
            self.causal[rows],
            self.odds[rows],
            self.owner[rows],
            self.camera[rows],
            self.box_std[rows],
        )

    @classmethod
    def of_state(cls, state: dict[str, Any], sensors: int, first: int, first_s: float) -> WindowRows:
        """Return rows that were decided, by name of their column.

        Args:
            state: the columns.
            sensors: how many the tracker counts.
            first: number of the first detection that is not decided.
            first_s: its time (s).

        Raises:
            DataError: they are none.
        """
        ints, floats = saved_parts.ints, saved_parts.floats
        number = ints(state["number"], most=first - 1)
        count = len(number)
        rows = cls(
            number,
            floats(state["t"], count),
            ints(state["sensor"], count, most=sensors - 1),
            floats(state["boxes"], count, 4),
            ints(state["causal"], count),
            floats(state["odds"], count),
            ints(state["owner"], count, least=1),
            floats(state["camera"], count, 2),
            floats(state["box_std"], count, 4, unknown=True),
        )
        sound = (
            (rows.boxes[:, 2:] >= rows.boxes[:, :2]).all()
            and not (rows.box_std < 0.0).any()
            and (np.diff(number) > 0).all()
            and (np.diff(rows.t) >= 0.0).all()
        )
        if not sound or rows.t.max(initial=-np.inf) > first_s:
            raise saved_parts.damaged("detections")
        return rows

    @classmethod
    def none(cls) -> WindowRows:
        """Return no rows."""
        none = np.zeros(0, dtype=np.int64)
        sides, camera = np.zeros((0, 4)), np.zeros((0, 2))
        return cls(none, np.zeros(0), none, sides, none, np.zeros(0), none, camera, sides)


def continuing(rows: WindowRows, assigned: IntArray) -> IntArray:
    """Return which track took each row (N,), below 0 where that is an identity that was decided.

    A track continues the identity whose last detection is the track's own last one that is decided.
    """
    known, code = np.unique(assigned, return_inverse=True)
    code = code.reshape(-1)
    decided = np.flatnonzero(rows.owner > 0)
    last = np.full(len(known), -1)
    last[code[decided]] = decided  # in order of time: the last one counts
    owners, which = np.unique(rows.owner[decided], return_inverse=True)
    last_of_owner = np.full(len(owners), -1)
    last_of_owner[which.reshape(-1)] = decided
    identity = np.zeros(len(known), dtype=np.int64)
    goes_on = np.isin(last, last_of_owner) & (last >= 0) & (known > 0)
    identity[goes_on] = rows.owner[last[goes_on]]
    out = np.where(identity[code] > 0, -identity[code], assigned)
    return np.where(rows.owner > 0, -rows.owner, out)


def one_piece_an_identity(piece: IntArray, owner: IntArray) -> IntArray:
    """Return pieces (N,), numbered by their first rows, with those of one identity made one."""
    of = np.zeros(int(piece.max(initial=-1)) + 1, dtype=np.int64)
    np.maximum.at(of, piece, owner)
    first = np.arange(len(of))
    order = np.arange(len(of))[::-1]
    lowest = {int(of[k]): int(k) for k in order}
    for k in np.flatnonzero(of > 0).tolist():
        first[k] = lowest[int(of[k])]
    return np.unique(first[piece], return_inverse=True)[1].reshape(-1).astype(np.int64)
