"""All scores equal those of two other implementations: TrackEval's, and that of Roboflow's trackers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.eval.frames import build_frames
from jeat_graph.eval.metrics import score_frames

from .data import KITTI, kitti, make_tracks, make_truth, tud_pair
from .oracles import roboflow_scores, trackeval_scores

ORACLES = [
    pytest.param(trackeval_scores, "trackeval", id="trackeval"),
    pytest.param(roboflow_scores, "trackers.eval", id="trackers"),
]


def random_pair(seed: int):
    """Objects that come and go, tracks that follow them with noise, gaps, switches and clutter."""
    rng = np.random.default_rng(seed)
    frames, objects = int(rng.integers(1, 30)), int(rng.integers(1, 7))
    t, ids = np.repeat(np.arange(frames) * 0.1, objects), np.tile(np.arange(objects), frames)
    start, speed = rng.uniform(0, 150, (objects, 2)), rng.normal(0, 20, (objects, 2))
    size = rng.uniform(15, 50, (objects, 2))
    boxes = np.column_stack((start[ids] + speed[ids] * t[:, None], size[ids]))
    there = rng.random(len(t)) < rng.uniform(0.3, 1.0)
    seen = rng.random(len(t)) < rng.uniform(0.2, 1.0)
    # A track changes hands now and then, never to one that is used in that frame already.
    owner = (ids + (t > rng.uniform(0, 3)) * rng.integers(0, objects)) % objects
    tracked = boxes + rng.normal(0, rng.uniform(0, 6), boxes.shape)
    tracked[:, 2:] = np.maximum(tracked[:, 2:], 1.0)
    clutter = rng.random(frames) < 0.3
    extra = np.column_stack((rng.uniform(0, 150, (frames, 2)), rng.uniform(15, 50, (frames, 2))))
    return (
        make_truth(t[there], ids[there], boxes[there], frames=np.arange(frames) * 0.1),
        make_tracks(
            np.concatenate((t[seen], (np.arange(frames) * 0.1)[clutter])),
            np.concatenate((owner[seen], 100 + np.flatnonzero(clutter))),
            np.concatenate((tracked[seen], extra[clutter])),
        ),
    )


def assert_equal(ours, theirs):
    for name, value in theirs.items():
        assert math.isclose(getattr(ours, name), value, rel_tol=0, abs_tol=1e-9), name


@pytest.mark.parametrize(("oracle", "package"), ORACLES)
@given(
    seeds=st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=3), iou=st.sampled_from([0.3, 0.5, 0.75])
)
def test_pooled_scores_of_random_sequences(oracle, package, seeds, iou):
    pytest.importorskip(package, reason=f"needs the package {package} as oracle")
    frames = [build_frames(*random_pair(seed), instants=np.arange(30) * 0.1) for seed in seeds]
    assert_equal(score_frames(frames, iou=iou), oracle(frames, iou))


@pytest.mark.parametrize(("oracle", "package"), ORACLES)
@pytest.mark.parametrize("iou", [0.05, 0.5])
def test_scores_of_a_crowd_in_which_every_box_touches_others(oracle, package, iou):
    pytest.importorskip(package, reason=f"needs the package {package} as oracle")
    rng = np.random.default_rng(4)
    frames, objects = 60, 25
    t, ids = np.repeat(np.arange(frames) * 0.1, objects), np.tile(np.arange(objects), frames)
    places = rng.uniform(0, 120, (objects, 2)) + 0.3 * np.arange(frames)[:, None, None]
    boxes = np.concatenate((places, np.full(places.shape, 40.0)), axis=2).reshape(-1, 4)
    seen = rng.random(len(t)) < 0.9
    owner = np.where(rng.random(len(t)) < 0.05, objects + ids, ids)
    tracks = make_tracks(t[seen], owner[seen], (boxes + rng.normal(0, 4, boxes.shape))[seen])
    sequence = [build_frames(make_truth(t, ids, boxes), tracks)]
    assert_equal(score_frames(sequence, iou=iou), oracle(sequence, iou))


@pytest.mark.parametrize(("oracle", "package"), ORACLES)
def test_scores_where_a_sequence_has_no_tracks_or_frames_have_no_boxes(oracle, package):
    pytest.importorskip(package, reason=f"needs the package {package} as oracle")
    box, nothing = [[0.0, 0.0, 10.0, 10.0]], np.zeros((0, 4))
    frames = np.arange(6) * 0.1
    sequences = [
        build_frames(make_truth([0.0, 0.1], [1, 1], box * 2), make_tracks([], [], nothing)),
        build_frames(make_truth([], [], nothing, frames=frames), make_tracks([0.0], [4], box)),
        # Matched, out of the truth, matched again, missed without any track, missed beside another, matched.
        build_frames(
            make_truth(frames[[0, 2, 3, 4, 5]], [1] * 5, box * 5, frames=frames),
            make_tracks(frames[[0, 1, 2, 4, 5]], [7, 7, 7, 8, 9], [*box * 3, [90.0, 0.0, 5.0, 5.0], *box]),
            instants=frames,
        ),
    ]
    assert_equal(score_frames(sequences), oracle(sequences))
    for one in sequences:
        assert_equal(score_frames([one]), oracle([one]))


@pytest.mark.parametrize(("oracle", "package"), ORACLES)
def test_scores_of_real_vehicles_with_their_detections_as_tracks(oracle, package):
    pytest.importorskip(package, reason=f"needs the package {package} as oracle")
    sequences = []
    for name in KITTI:
        truth, detections = kitti(name)
        # Each detection carries the number of its place from the left: identities that switch all the time.
        row_t = np.repeat(detections.scan_t, np.diff(detections.scan_start))
        order = np.lexsort((detections.boxes[:, 0], row_t))
        t = row_t[order]
        rank = np.arange(len(t)) - np.searchsorted(t, t)
        sequences.append(build_frames(truth, make_tracks(t, rank, detections.boxes[order])))
    assert_equal(score_frames(sequences), oracle(sequences))


@pytest.mark.parametrize(("oracle", "package"), ORACLES)
def test_scores_of_a_known_trackers_results(oracle, package):
    pytest.importorskip(package, reason=f"needs the package {package} as oracle")
    sequences = [build_frames(*tud_pair(name)) for name in ("TUD-Campus", "TUD-Stadtmitte")]
    assert_equal(score_frames(sequences), oracle(sequences))
