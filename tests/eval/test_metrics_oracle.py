"""All scores equal those of an independent implementation, on random sequences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.eval.frames import build_frames
from jeat_graph.eval.metrics import score_frames, trackeval_input

from .data import make_tracks, make_truth

oracle = pytest.importorskip("trackers.eval", reason="needs the package trackers as oracle")


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


@settings(max_examples=60, deadline=None)
@given(
    seeds=st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=3), iou=st.sampled_from([0.3, 0.5, 0.75])
)
def test_pooled_scores_equal_those_of_roboflow_trackers(seeds, iou):
    frames = [build_frames(*random_pair(seed), instants=np.arange(30) * 0.1) for seed in seeds]
    ours = score_frames(frames, iou=iou)

    lists = [trackeval_input(one) for one in frames]
    inputs = [(d["gt_ids"], d["tracker_ids"], d["similarity_scores"]) for d in lists]
    clear = oracle.aggregate_clear_metrics([oracle.compute_clear_metrics(*i, threshold=iou) for i in inputs])
    identity = oracle.aggregate_identity_metrics(
        [oracle.compute_identity_metrics(*i, threshold=iou) for i in inputs]
    )
    hota = oracle.aggregate_hota_metrics([oracle.compute_hota_metrics(*i) for i in inputs])

    for name, theirs in {
        **{name: clear[name] for name in ("MOTA", "MOTP")},
        **{name: identity[name] for name in ("IDF1", "IDP", "IDR")},
        **{name: hota[name] for name in ("HOTA", "DetA", "AssA", "LocA")},
    }.items():
        assert math.isclose(getattr(ours, name), 100 * theirs, rel_tol=0, abs_tol=1e-9), name
    for name in ("TP", "FP", "FN"):
        assert getattr(ours, name) == clear[f"CLR_{name}"]
    for name in ("IDSW", "MT", "PT", "ML", "Frag"):
        assert getattr(ours, name) == clear[name], name
