"""Does this table belong to this truth? Wrong pairs are refused with a sentence that says what is wrong."""

from __future__ import annotations

import numpy as np

from jeat_graph.arrays import FloatArray
from jeat_graph.errors import DataError
from jeat_graph.trajectories import GroundTruth, Trajectories

# In other units, step and duration of a clock both differ: by one factor if both record at one rate, else by
# factors that are at least both large. Frames against seconds is a factor of the frame rate, 10 or more.
UNIT_RATIO = 8.0
UNIT_RATIO_OTHER_RATE = 15.0
SAME_FACTOR = 3.0
BOTH_LARGE = 5.0


def check_truth(truth: GroundTruth) -> None:
    """Refuse truth without frames, or without identities.

    Raises:
        DataError: no frame at all; or one identity twice in a frame (as when all are -1).
    """
    if not len(truth.frame_times()):
        raise DataError("the truth has no frames, so there is nothing to judge by")
    rows = np.flatnonzero(~truth.ignore)
    order = rows[np.lexsort((truth.t[rows], truth.object_id[rows]))]
    twice = (np.diff(truth.object_id[order]) == 0) & (np.diff(truth.t[order]) == 0)
    if not twice.any():
        return
    row = order[int(np.argmax(twice))]
    if len(np.unique(truth.object_id[rows])) == 1:
        raise DataError(
            f"the truth has no identities: every object_id is {truth.object_id[row]}; "
            "tracks can only be judged by boxes that carry the identity of their object"
        )
    raise DataError(f"the truth has object {truth.object_id[row]} twice at t = {truth.t[row]:g} s")


def check_pair(truth: GroundTruth, table: Trajectories, *, max_age_s: float = 0.15) -> None:
    """Refuse a table that cannot be about the same scene and clock as the truth. An empty table is fine.

    Args:
        truth: the truth, already checked.
        table: the tracks.
        max_age_s: how long after its last row a causal table still says something (s).

    Raises:
        DataError: different units of time, no common times, or boxes that are not in pixels.
    """
    if not len(table):
        return
    frames = truth.frame_times()
    instants = np.unique(table.t)
    if not np.isfinite(instants).all():
        raise DataError("the tracks have a time that is not finite")
    _check_units(frames, instants)
    if instants[0] > frames[-1] + max_age_s or instants[-1] < frames[0] - max_age_s:
        raise DataError(
            f"no common timestamps: the truth covers {frames[0]:g} to {frames[-1]:g} s, "
            f"the tracks {instants[0]:g} to {instants[-1]:g} s; are they of the same recording?"
        )
    if len(truth):
        largest = float(np.abs(table.boxes).max())
        typical = float(np.median(truth.boxes[:, 2:]))
        if largest <= 2.0 < typical / 2.0:
            raise DataError(
                f"the tracks' boxes lie within {largest:g} px, the truth's are about {typical:.0f} px large: "
                "are the tracks' boxes relative to the picture's size instead of in pixels?"
            )


def _check_units(frames: FloatArray, instants: FloatArray) -> None:
    """Refuse clocks whose step and duration both differ by more than rates and lengths of recordings do."""
    if len(frames) < 3 or len(instants) < 3:
        return
    step = np.median(np.diff(instants)) / np.median(np.diff(frames))
    span = (instants[-1] - instants[0]) / (frames[-1] - frames[0])
    ratio = float(np.sqrt(step * span))
    one_factor = 1.0 / SAME_FACTOR < step / span < SAME_FACTOR
    both_large = min(step, span) > BOTH_LARGE or max(step, span) < 1.0 / BOTH_LARGE
    limit = UNIT_RATIO if one_factor else UNIT_RATIO_OTHER_RATE if both_large else np.inf
    if not 1.0 / limit < ratio < limit:
        slow, fast = ("tracks", "truth") if ratio > 1.0 else ("truth", "tracks")
        raise DataError(
            f"different units of time: the tracks' clock runs {ratio:.3g} times the truth's "
            f"(tracks {instants[0]:g} to {instants[-1]:g}, truth {frames[0]:g} to {frames[-1]:g}); "
            f"the {slow} seem to be in milliseconds or frames where the {fast} are in seconds"
        )
