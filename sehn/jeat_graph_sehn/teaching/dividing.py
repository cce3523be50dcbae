"""What of a recording is learned from, what is held back to judge by, and whether there is enough of both.

Neighbouring frames are almost the same picture, and a vehicle keeps its appearance. So the held-back part
is the last one, a gap lies before it, and vehicles that are in both parts are not asked for in the second.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph_sehn.teaching.labels import TrackLabels

#: Between the two parts (s).
GAP_S = 3.0
#: At least so long a part is learned from, and so long a part held back (s).
LEAST_LEARNED_S, LEAST_JUDGED_S = 30.0, 12.0
#: At least so many vehicles must be asked for in each part.
LEAST_LEARNED, LEAST_JUDGED = 10, 5


class Division(NamedTuple):
    """Two spans of a recording (s), each a begin and an end."""

    learned: tuple[float, float]
    judged: tuple[float, float]


class Parts(NamedTuple):
    """The labels of the two parts.

    Attributes:
        learned: to learn from.
        judged: to judge by.
    """

    learned: TrackLabels
    judged: TrackLabels


def divide(begin_s: float, end_s: float, share: float) -> Division:
    """Divide a recording in time.

    Args:
        begin_s: its begin (s).
        end_s: its end (s).
        share: of it that is held back; the gap is taken off the part that is learned from.
    """
    held = end_s - share * (end_s - begin_s)
    return Division((begin_s, max(held - GAP_S, begin_s)), (held, end_s))


def part(learning: TrackLabels, judging: TrackLabels, division: Division) -> Parts:
    """Take the labels of both parts; who is in both is not asked for in the second.

    Args:
        learning: labels of the whole recording, to learn from.
        judging: labels of the whole recording, to judge by; the ids of their vehicles may be others.
        division: the parts.
    """
    learned, judged = learning.between(*division.learned), judging.between(*division.judged)
    before = judging.truth.object_id[judging.truth.t <= division.learned[1]]
    return Parts(learned, judged.masking(np.isin(judged.truth.object_id, before)))


def check_enough(parts: Parts, division: Division) -> None:
    """Refuse a recording that is too short, or has too little traffic.

    Raises:
        DataError: says what there is, and what would be needed.
    """
    spans = [end - begin for begin, end in division]
    counts = [len(labels.asked_objects()) for labels in parts]
    enough = (
        spans[0] >= LEAST_LEARNED_S
        and spans[1] >= LEAST_JUDGED_S
        and counts[0] >= LEAST_LEARNED
        and counts[1] >= LEAST_JUDGED
    )
    whole = division.judged[1] - division.learned[0]
    if not enough:
        raise DataError(
            f"too little to learn from in {whole:.1f} s: {spans[0]:.1f} s with {counts[0]} vehicles that the "
            f"tracker is sure of, and {spans[1]:.1f} s with {counts[1]} held back; needed are "
            f"{LEAST_LEARNED_S:g} s with {LEAST_LEARNED}, and {LEAST_JUDGED_S:g} s with {LEAST_JUDGED}: "
            "record a minute at least, in traffic"
        )
