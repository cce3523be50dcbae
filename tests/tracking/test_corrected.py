"""Corrected tracks: which detections are theirs, and what is edited of these."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from jeat_graph import Detections, Scan, Tracker, load_config
from jeat_graph.association.overlap import pairwise_iou
from jeat_graph.data.corrected_tracks import CorrectedTracks, Disagreements
from jeat_graph.data.errors import DataError, JeatGraphError
from jeat_graph.tracking.identities.disagreeing import Noise, RowsCompared, edited
from jeat_graph.tracking.identities.matching_rows import LEAST_IOU, nearest, owners_of, period_of
from jeat_graph.tracking.records import record_tracks

SIZE = ("image.width=1280", "image.height=720")


def corrected(t, track_id, boxes):
    t, ids = np.asarray(t, dtype=float), np.asarray(track_id, dtype=np.int64)
    boxes = np.asarray(boxes, dtype=float).reshape(-1, 4)
    return CorrectedTracks(t, ids, boxes, np.zeros(len(t), dtype=bool), lambda _, text: DataError(text))


def seen(*scans):
    return Detections.from_scans(
        Scan(t, name, np.asarray(boxes, dtype=float).reshape(-1, 4), np.full(len(boxes), 0.9))
        for t, name, boxes in scans
    )


def moving(t):
    """A box of 20 px that goes 400 px/s."""
    return [100 + 400 * t, 50.0, 20.0, 20.0]


def test_between_rows_of_a_slower_file_a_track_is_where_it_is_interpolated():
    file_t = np.arange(5) / 20
    rows = corrected(file_t, np.ones(5), [moving(t) for t in file_t])
    times = np.arange(21) / 100
    found = owners_of(seen(*((t, "evt", [moving(t)]) for t in times)), rows, rows.track_id)
    assert found.tolist() == [1] * 21


def test_where_rows_of_a_track_were_deleted_it_has_no_detections():
    file_t = np.arange(10) / 20
    keep = file_t != 0.2
    others = [[500.0, 50.0, 20.0, 20.0]] * 10
    rows = corrected(
        [*file_t[keep], *file_t],
        [1] * 9 + [2] * 10,
        [*(moving(t) for t in file_t[keep]), *others],
    )
    found = owners_of(seen(*((t, "rgb", [moving(t), others[0]]) for t in file_t)), rows, rows.track_id)
    assert found.reshape(10, 2)[:, 0].tolist() == [1, 1, 1, 1, 0, 1, 1, 1, 1, 1]
    assert (found.reshape(10, 2)[:, 1] == 2).all()


@pytest.mark.parametrize("seed", range(8))
def test_of_a_scan_the_assignment_with_the_greatest_sum_counts(seed):
    rng = np.random.default_rng(seed)
    boxes, others = (np.column_stack([rng.uniform(0, 20, (4, 2)), np.full((4, 2), 25.0)]) for _ in range(2))
    rows = corrected(np.zeros(4), np.arange(1, 5), boxes)
    found = owners_of(seen((0.0, "rgb", others)), rows, rows.track_id)
    iou = pairwise_iou(boxes, others)
    gain = np.where(iou >= LEAST_IOU, iou, 0.0)
    best = max(sum(gain[p[j], j] for j in range(4)) for p in permutations(range(4)))
    mine = np.flatnonzero(found)
    assert len(set(found[mine].tolist())) == len(mine)
    assert (iou[found[mine] - 1, mine] >= LEAST_IOU).all()
    assert iou[found[mine] - 1, mine].sum() == pytest.approx(best)


def test_each_sensor_has_one_detection_of_a_track():
    rows = corrected([0.0, 0.1], [7, 7], [moving(0.0), moving(0.1)])
    scans = [(t, name, [moving(t), moving(t + 0.005)]) for t in (0.0, 0.1) for name in ("evt", "rgb")]
    assert owners_of(seen(*scans), rows, np.ones(2, dtype=int)).tolist() == [1, 0] * 4


def test_the_period_is_that_of_most_of_the_time():
    """Two sensors that look nearly together have steps that are no period of anything."""
    t = np.sort(np.r_[np.arange(20) / 20, np.arange(20) / 20 + 0.002])
    assert period_of(np.repeat(t, 2)) == pytest.approx(0.048)
    assert period_of(np.array([3.0])) > 0
    assert nearest(np.array([0.0, 1.0, 3.0]), np.array([-1.0, 0.4, 2.1, 9.0])).tolist() == [0, 0, 2, 2]


def test_a_row_takes_the_place_of_one_detection_and_an_added_one_stands_beside():
    box, other = [10.0, 10.0, 20.0, 20.0], [300.0, 10.0, 20.0, 20.0]
    detections = seen((0.0, "evt", [box, other]), (0.0, "rgb", [box]), (0.1, "rgb", []))
    rows = corrected([0.0, 0.1], [4, 9], [[14.0, 10.0, 20.0, 20.0], [600.0, 10.0, 20.0, 20.0]])
    nothing = Disagreements(*[np.zeros(0)] * 4)
    found = RowsCompared(nothing, moved=np.array([0]), added=np.array([1]))
    after, owner, origin = edited(detections, np.array([1, 0, 1]), rows, np.array([1, 2]), found)
    assert after.boxes[:, 0].tolist() == [14.0, 300.0, 10.0, 600.0]
    assert owner.tolist() == [1, 0, 0, 2]
    assert origin.tolist() == [0, 1, 2, -1]
    assert after.scores.tolist() == [1.0, 0.9, 0.9, 1.0]
    assert detections.boxes[0, 0] == 10.0


@pytest.mark.parametrize("engine", ["core", "reference"])
def test_a_tracker_follows_them(engine):
    settings = ("smoother.identities=whole", f"tracker.engine={engine}", "smoother.engine=full", *SIZE)
    tracker = Tracker(load_config("default", settings))
    times = np.arange(30) / 10
    for t in times:
        tracker.step(Scan(t, "rgb", np.array([[100 + 50 * t, 50, 40, 30]]), np.array([0.9])))
    tracker.follow(corrected(times, [30] * 15 + [20] * 15, [[100 + 50 * t, 50, 40, 30] for t in times]))
    table = tracker.finish()
    assert table.t[table.track_id == 30].max() == pytest.approx(1.4)
    # Existence is the model's own: it takes a new track for real after some detections.
    said = tracker.disagreements()
    assert set(said.what.tolist()) == {"absent"}
    assert set(said.track_id.tolist()) == {20}
    own = np.sort(np.r_[said.t, table.t[table.track_id == 20]])
    assert own == pytest.approx(times[15:])
    assert len(said.t) < 8
    assert set(table.causal_id.tolist()) == {1}
    assert tracker.identity_links() is None


def test_a_tracker_that_keeps_no_recording_cannot():
    with pytest.raises(JeatGraphError, match=r"need smoother\.identities=whole"):
        Tracker().follow(corrected([0.0], [1], [moving(0.0)]))


def test_records_of_a_run_are_those_of_its_causal_tracks():
    """`compare` reads them, whoever the smoothed table says is who."""
    detections = seen(*((t, "rgb", [moving(t)]) for t in np.arange(20) / 20))
    whole, causal = (
        record_tracks(load_config("default", (*SIZE, f"smoother.identities={way}")), detections)
        for way in ("whole", "causal")
    )
    assert [one.track_id for one in whole[0]] == [one.track_id for one in causal[0]] == [1]
    np.testing.assert_array_equal(whole[1].boxes, causal[1].boxes)


def test_the_noise_of_centres_and_sizes_is_that_of_drawn_sides():
    box, noise = np.array([[100.0, 50.0, 80.0, 20.0]]), Noise(0.05**2, 0.7, None)
    std = np.sqrt(noise.variance * (0.5 * np.sqrt(80.0 * 20.0) + 0.5 * box[0, 2:]) ** 2 + 0.7**2)
    low, high = np.random.default_rng(0).normal(0.0, std, (2, 200_000, 2))
    drawn = np.concatenate([((low + high) / 2.0).var(axis=0), (high - low).var(axis=0)])
    # A variance of n draws has the relative standard deviation √(2/n), here 0.3 %.
    assert noise.of(box)[0] == pytest.approx(drawn, rel=0.015)
