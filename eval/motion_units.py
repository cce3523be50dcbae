"""Is the motion of a truth that of the picture? Metres of the road in its place are said, and not judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jeat_graph.data.notes import note
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.eval.pairing import RELATIVE_BOX

# So far from a box, in its own sizes, may an object's centre lie: the picture's edge cuts boxes.
_BESIDE = 0.5
# Where fewer of the places are in their boxes, they are in another unit.
_LEAST_SHARE = 0.5


def motion_in_picture(truth: GroundTruth, title: str) -> GroundTruth:
    """Return truth without its motion, and say so, where its x, y are no places of the picture (px).

    Errors against metres would be those of units. They used to vanish: a place outside its box counts as cut
    off by the picture's edge.

    Args:
        truth: the truth.
        title: what it is called in the note.
    """
    if truth.motion is None or float(np.abs(truth.boxes).max(initial=0.0)) <= RELATIVE_BOX:
        return truth  # boxes in units of the picture's size are refused later
    place = truth.motion[:, :2]
    known = np.isfinite(place).all(axis=1) & ~truth.ignore
    if not known.any():
        return truth
    low = truth.boxes[:, :2] - _BESIDE * truth.boxes[:, 2:]
    high = low + (1.0 + 2.0 * _BESIDE) * truth.boxes[:, 2:]
    inside = np.asarray(((place >= low) & (place <= high)).all(axis=1))
    within = float(inside[known].mean())
    if within >= _LEAST_SHARE:
        return truth
    note(
        f"{title}: x, y lie in {100.0 * within:.0f} % of their boxes, so they are no px of the picture "
        "(metres?): motion is not judged, positions are judged by the boxes; give metres of the road as "
        "--road FILE"
    )
    return replace(truth, motion=None)
