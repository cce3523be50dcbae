"""Which boxes of a track are asked for, which are masked, and what is background."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph_sehn.teaching.drawn_truth import DrawnTruth, WeighedTruth, chances
from jeat_graph_sehn.teaching.labels import (
    APART_S,
    TrackLabels,
    hidden,
    labels_of,
    masked_rows,
    spread,
    unexplained,
    vague,
)

BOX = (100.0, 100.0, 40.0, 20.0)


def tracks(t, track_id=None, boxes=None, existence=0.99, var=1.0, used=1):
    """Smoothed rows, whose centre has a variance (px²)."""
    t = np.asarray(t, dtype=float)
    n = len(t)
    boxes = np.tile(BOX, (n, 1)) if boxes is None else np.asarray(boxes, dtype=float)
    return Trajectories(
        t=t,
        track_id=np.full(n, 1) if track_id is None else np.asarray(track_id),
        boxes=boxes,
        existence=np.broadcast_to(existence, n).astype(float),
        mean=np.zeros((n, 6)),
        var=np.broadcast_to(np.reshape(var, (-1, 1)), (n, 6)).astype(float),
        used=np.broadcast_to(used, n).astype(np.int64),
        sensors=("rgb",),
    )


#: Eighths of a second, which binary numbers hold exactly.
TIMES = np.arange(21) / 8


def test_a_sure_track_is_asked_for_but_at_its_ends():
    masked = masked_rows(tracks(TIMES))
    assert np.flatnonzero(~masked).tolist() == list(range(3, 18))  # 0.3 s at each end are not


def test_existence_in_the_middle_masks_and_below_it_there_is_only_background():
    existence = np.full(21, 0.95)
    existence[8:10], existence[10:12] = 0.5, 0.1
    table = tracks(TIMES, existence=existence)
    assert masked_rows(table)[6:14].tolist() == [False, False, True, True, True, True, False, False]
    labels = labels_of(table, scans(TIMES))
    assert np.setdiff1d(TIMES, labels.truth.t) == pytest.approx(TIMES[10:12])
    assert labels.weight[labels.truth.t == TIMES[8]] == 0.5


def test_a_place_is_vague_from_a_tenth_of_the_box_on():
    sizes = np.tile([40.0, 20.0], (4, 1))
    place = np.array([[3.9**2, 0.0], [4.1**2, 0.0], [0.0, 2.1**2], [0.0, 0.0]])
    size = np.array([[np.nan, np.nan], [np.nan, np.nan], [np.nan, np.nan], [8.1**2, 0.0]])
    # A side's variance is that of the centre and a quarter of the size's.
    assert vague(place, size, sizes).tolist() == [False, True, True, True]


def test_who_is_not_seen_for_a_while_is_masked():
    used = np.ones(21, dtype=int)
    used[6:15] = 0  # nobody saw it after row 5 and before row 15
    masked = masked_rows(tracks(TIMES, used=used))
    assert masked[3:18].tolist() == [False] * 5 + [True] * 5 + [False] * 5


def test_the_nearer_box_hides_the_farther_one():
    boxes = np.array([BOX, (105.0, 110.0, 40.0, 30.0), (100.0, 200.0, 40.0, 20.0)])
    assert hidden(np.zeros(3), boxes).tolist() == [True, False, False]
    assert hidden(np.arange(3.0), boxes).tolist() == [False, False, False]  # at other times
    boxes[1, 1] = 117.0  # covers 3 of 20 rows
    assert hidden(np.zeros(3), boxes).tolist() == [False, False, False]


def scans(times, boxes=(), scores=()):
    """Detections: at the first time of these boxes, at the others of none."""
    n = len(times)
    return Detections.from_rows(
        np.concatenate([times, np.full(len(boxes), times[0])]),
        ["rgb"] * (n + len(boxes)),
        np.concatenate([np.zeros((n, 4)), np.reshape(boxes, (-1, 4))]),
        np.concatenate([np.zeros(n), scores]),
        empty=np.concatenate([np.ones(n, dtype=bool), np.zeros(len(boxes), dtype=bool)]),
    )


def test_what_was_believed_and_no_track_took_is_masked():
    near, far, weak = BOX, (300.0, 100.0, 40.0, 20.0), (500.0, 100.0, 40.0, 20.0)
    labels = labels_of(tracks(TIMES), scans(TIMES, [near, far, weak], [0.9, 0.6, 0.4]))
    lone = labels.truth.object_id < 0
    assert labels.truth.boxes[lone].tolist() == [list(far)]
    assert labels.truth.ignore[lone].all()
    assert labels.truth.t[lone].tolist() == [0.0]  # the next label is farther than 0.1 s
    labels = labels_of(tracks(TIMES), scans(TIMES, [near, far, weak], [0.9, 0.6, 0.4]), {"rgb": 0.3})
    assert (labels.truth.object_id < 0).sum() == 2


def test_a_mask_lasts_until_the_detector_looks_again():
    times = np.arange(9) / 16
    far = (300.0, 100.0, 40.0, 20.0)
    detections = Detections.from_rows([times[4]], ["rgb"], [far], [0.9])
    t, boxes, ids = unexplained(detections, tracks(times), times, {})
    assert t.tolist() == times[3:6].tolist()  # 0.1 s before and after
    assert boxes.tolist() == [list(far)] * 3
    assert len(set(ids.tolist())) == 1


def test_other_labels_have_another_digest():
    labels = labels_of(tracks(TIMES), scans(TIMES))
    assert labels.digest() == labels_of(tracks(TIMES), scans(TIMES)).digest()
    assert labels.digest() != labels_of(tracks(TIMES, existence=0.9), scans(TIMES)).digest()
    assert labels.digest() != labels.masking(labels.truth.t == TIMES[9]).digest()


def test_labels_stand_at_times_that_are_apart():
    times = np.array([0.0, 0.01, 0.05, 0.06, 0.2])
    assert times[spread(times, APART_S)].tolist() == [0.0, 0.05, 0.2]


def weighed(weight):
    """A box that stands still for 2.5 s."""
    truth = GroundTruth(
        t=TIMES,
        object_id=np.full(21, 7),
        boxes=np.tile(BOX, (21, 1)),
        motion=None,
        ignore=np.zeros(21, dtype=bool),
        frames=TIMES,
    )
    return TrackLabels(truth, np.full(21, weight))


def test_a_label_is_asked_for_as_often_as_it_is_probable():
    looks = np.linspace(0.0, 2.0, 1001)
    drawn = DrawnTruth(weighed(0.7), seed=3)
    asked = np.array([not drawn.at(float(t)).ignored[0] for t in looks])
    assert asked.mean() == pytest.approx(0.7, abs=4.0 * np.sqrt(0.7 * 0.3 / len(looks)))
    again = DrawnTruth(weighed(0.7), seed=3)
    assert [not again.at(float(t)).ignored[0] for t in looks] == asked.tolist()
    assert not any(DrawnTruth(weighed(1.0), 0).at(float(t)).ignored[0] for t in looks[:200])


def test_chances_are_even_and_of_their_own():
    ids = np.arange(20_000)
    drawn = chances(ids, 123, 0)
    # The largest gap to an even distribution, as Kolmogorov and Smirnov have it: 1.95 / √n at 0.1 %.
    assert np.abs(np.sort(drawn) - (ids + 0.5) / len(ids)).max() < 1.95 / np.sqrt(len(ids))
    for other in (chances(ids, 124, 0), chances(ids, 123, 1)):
        assert abs(np.corrcoef(drawn, other)[0, 1]) < 4.0 / np.sqrt(len(ids))


def test_weights_are_those_of_the_nearest_label():
    truth = WeighedTruth(weighed(0.6))
    assert truth.weights(np.array([7, 8]), 1.03).tolist() == [0.6, 0.0]
