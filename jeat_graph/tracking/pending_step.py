"""A step that has been taken, before the smoothers get it."""

from __future__ import annotations

from typing import NamedTuple

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Scan
from jeat_graph.tracking.engine import Recorded
from jeat_graph.tracking.identities.passes import Pass


class PendingStep(NamedTuple):
    """A step that the smoothers are to get when nothing can come before it any more.

    Attributes:
        record: the engine's, of N tracks.
        t: its time (s).
        ids: (N,) their identities.
        label: (N,) numbers of their classes, or None.
        share: (N,) of the votes that speak for these, or None.
        given: (N,) identities that the tables are to have in their place, or None.
        batch: where identities are decided with a lag, its scans, which tracks took their detections, and how
            far the camera had moved (2,) (px).
    """

    record: Recorded
    t: float
    ids: IntArray
    label: IntArray | None = None
    share: FloatArray | None = None
    given: IntArray | None = None
    batch: tuple[list[Scan], Pass, FloatArray] | None = None
