"""Does this table belong to this truth? Wrong pairs are refused with a sentence that says what is wrong."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.resampling import MAX_AGE_S

# In other units, step and duration of a clock both differ: by one factor if both record at one rate, else by
# factors that are at least both large. Frames against seconds is a factor of the frame rate, 10 or more.
UNIT_RATIO = 8.0
UNIT_RATIO_OTHER_RATE = 15.0
SAME_FACTOR = 3.0
BOTH_LARGE = 5.0
# Boxes in units of the picture's size have no corner beyond about this; a vehicle in pixels is larger.
RELATIVE_BOX = 2.0
# So many boxes in so many frames, and no identity twice: these are numbers of rows.
ROWS_OF_THEIR_OWN = 10
FRAMES_OF_THEIR_OWN = 3


def check_truth(truth: GroundTruth) -> None:
    """Refuse truth without frames, or without identities.

    Raises:
        DataError: no frame at all; one identity twice in a frame (as when all are -1); or no identity twice
            in all frames (as when rows are numbered).
    """
    if not len(truth.frame_times()):
        raise DataError("the truth has no frames, so there is nothing to judge by")
    rows = np.flatnonzero(~truth.ignore)
    order = rows[np.lexsort((truth.t[rows], truth.object_id[rows]))]
    twice = (np.diff(truth.object_id[order]) == 0) & (np.diff(truth.t[order]) == 0)
    if not twice.any():
        _check_numbering(truth.object_id[rows], truth.t[rows])
        return
    row = order[int(np.argmax(twice))]
    if len(np.unique(truth.object_id[rows])) == 1:
        raise DataError(
            f"the truth has no identities: every object_id is {truth.object_id[row]}; "
            "tracks can only be judged by boxes that carry the identity of their object"
        )
    raise DataError(f"the truth has object {truth.object_id[row]} twice at t = {truth.t[row]:g} s")


def check_pair(truth: GroundTruth, table: Trajectories, *, max_age_s: float = MAX_AGE_S) -> None:
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
    check_times(frames, instants, "tracks", max_age_s)
    if len(truth):
        _check_pixels("tracks", table.boxes, "truth", truth.boxes)
        _check_pixels("truth", truth.boxes, "tracks", table.boxes)


def check_times(frames: FloatArray, instants: FloatArray, what: str, slack_s: float = 0.0) -> None:
    """Refuse times that are of another clock, or in another unit, than those of the truth.

    Args:
        frames: (F,) times of the truth, ascending, at least one.
        instants: (I,) the others, ascending and each once, at least one.
        what: has these times, in the plural.
        slack_s: so far apart may they be (s).

    Raises:
        DataError: different units of time, or no common times.
    """
    _check_units(frames, instants, what)
    if instants[0] > frames[-1] + slack_s or instants[-1] < frames[0] - slack_s:
        raise DataError(
            f"no common timestamps: the truth covers {frames[0]:.10g} to {frames[-1]:.10g} s, "
            f"the {what} {instants[0]:.10g} to {instants[-1]:.10g} s; are they of the same recording?"
        )


def check_lives(truth: GroundTruth, table: Trajectories, *, max_age_s: float = MAX_AGE_S) -> None:
    """Refuse a table without a track at any frame of the truth, where it is not known when the tracker ran.

    Tracks and truth may cover the same hour and still have no moment in common. Where it is known that the
    tracker looked at those frames, finding nothing there is a result, and this must not be asked.

    Args:
        truth: the truth, already checked.
        table: the tracks.
        max_age_s: how long after its last row a causal table still says something (s).

    Raises:
        DataError: no track lives at any frame of the truth.
    """
    if not len(table):
        return
    frames = truth.frame_times()
    order = np.lexsort((table.t, table.track_id))
    t, new = table.t[order], np.diff(table.track_id[order]) != 0
    first = t[np.concatenate(([True], new))]
    last = t[np.concatenate((new, [True]))] + max_age_s
    if not (np.searchsorted(frames, last, side="right") > np.searchsorted(frames, first)).any():
        raise DataError(f"no common timestamps: no track is there at any of the truth's {len(frames)} frames")


def _check_numbering(ids: IntArray, t: FloatArray) -> None:
    """Refuse identities of which none is there twice."""
    frames = len(np.unique(t))
    if len(ids) < ROWS_OF_THEIR_OWN or frames < FRAMES_OF_THEIR_OWN or len(np.unique(ids)) < len(ids):
        return
    raise DataError(
        f"the truth has no identities: each of its {len(ids)} boxes in {frames} frames has an object_id of "
        "its own; tracks can only be judged by boxes that carry the identity of their object"
    )


def _check_pixels(small: str, boxes: FloatArray, large: str, others: FloatArray) -> None:
    """Refuse boxes in units of the picture's size beside others in pixels."""
    largest = float(np.abs(boxes).max())
    typical = float(np.median(others[:, 2:]))
    if largest <= RELATIVE_BOX < typical / 2.0:
        raise DataError(
            f"different units: the boxes of the {small} lie within {largest:.3g} of the picture's corner, "
            f"those of the {large} are about {typical:.0f} px large; "
            f"are the former relative to the picture's size instead of in pixels?"
        )


def _check_units(frames: FloatArray, instants: FloatArray, what: str) -> None:
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
        slow, fast = (what, "truth") if ratio > 1.0 else ("truth", what)
        raise DataError(
            f"different units of time: the {what} last {span:.3g} times as long as the truth "
            f"({instants[0]:.10g} to {instants[-1]:.10g} against {frames[0]:.10g} to {frames[-1]:.10g}); "
            f"the times of the {slow} seem to be milliseconds or frames, those of the {fast} seconds"
        )
