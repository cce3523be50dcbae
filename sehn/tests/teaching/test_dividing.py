"""What is learned from and what is held back, and when there is too little of it."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph_sehn.teaching.dividing import Parts, check_enough, divide, part
from jeat_graph_sehn.teaching.labels import TrackLabels


def labels(spans):
    """Vehicles by id, each with a box at each second of its span."""
    t = np.concatenate([np.arange(begin, end + 1.0) for begin, end in spans.values()])
    ids = np.concatenate([np.full(int(end - begin) + 1, one) for one, (begin, end) in spans.items()])
    truth = GroundTruth(
        t=t,
        object_id=ids,
        boxes=np.tile([0.0, 0.0, 9.0, 9.0], (len(t), 1)),
        motion=None,
        ignore=np.zeros(len(t), dtype=bool),
        frames=np.arange(0.0, 101.0),
    )
    return TrackLabels(truth, np.ones(len(t)))


def test_the_last_part_is_held_back_and_a_gap_lies_before_it():
    assert divide(0.0, 100.0, 0.25) == ((0.0, 72.0), (75.0, 100.0))
    assert divide(10.0, 12.0, 0.5).learned == (10.0, 10.0)


def test_no_time_is_in_both_parts_and_who_is_in_both_is_not_asked_for_twice():
    whole = labels({1: (0, 100), 2: (10, 20), 3: (70, 80), 4: (73, 90), 5: (80, 95)})
    parts = part(whole, whole, divide(0.0, 100.0, 0.25))
    assert parts.learned.truth.t.max() == 72.0
    assert parts.judged.truth.t.min() == 75.0
    assert parts.learned.truth.frame_times()[-1] == 72.0
    assert parts.learned.asked_objects().tolist() == [1, 2, 3]
    assert parts.judged.asked_objects().tolist() == [4, 5]  # 4 came in the gap
    assert set(parts.judged.truth.object_id.tolist()) == {1, 3, 4, 5}  # masked, not background


def test_too_little_is_refused_with_what_would_be_needed():
    division = divide(0.0, 2.4, 0.25)
    whole = labels({1: (0, 1), 2: (1, 2), 3: (0, 2)})
    needed = r"needed are 30 s with 10, and 12 s with 5: record a minute"
    with pytest.raises(DataError, match=r"in 2\.4 s: 0\.0 s with 2 vehicles .*" + needed):
        check_enough(part(whole, whole, division), division)


@pytest.mark.parametrize(("learned", "judged", "good"), [(10, 5, True), (9, 5, False), (10, 4, False)])
def test_so_many_vehicles_are_enough(learned, judged, good):
    division = divide(0.0, 100.0, 0.25)
    parts = Parts(
        labels(dict.fromkeys(range(learned), (0, 10))), labels(dict.fromkeys(range(judged), (80, 90)))
    )
    if good:
        check_enough(parts, division)
    else:
        with pytest.raises(DataError, match="too little"):
            check_enough(parts, division)
