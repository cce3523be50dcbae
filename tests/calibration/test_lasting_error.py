"""What detectors' boxes are off as long as they show one object: drawn errors, and a double loop."""

from __future__ import annotations

import math

import numpy as np
import pytest

from jeat_graph.calibration.lasting_error import lasting_error
from jeat_graph.calibration.matches import SensorMatches
from jeat_graph.filters.model_constants import ModelConstants

C = ModelConstants()


def drawn(lasting, jitter, objects=150, scans=60, seed=0):
    rng = np.random.default_rng(seed)
    scale = np.sqrt([0.5, 0.5, 2.0, 2.0])
    off = rng.normal(0, lasting, (objects, 1, 4)) * scale
    residual = (off + rng.normal(0, jitter, (objects, scans, 4)) * scale + 0.02).reshape(-1, 4)
    t = np.tile(np.arange(scans) * 0.1, objects) + np.repeat(rng.uniform(0, 50, objects), scans)
    key = np.column_stack([np.zeros(len(t), dtype=int), np.repeat(np.arange(objects), scans)])
    shuffled = rng.permutation(len(t))
    ones, no = np.ones(len(t)), np.zeros(0)
    return SensorMatches(
        scans=scans,
        score=ones,
        correct=ones > 0,
        residual=residual[shuffled],
        side=np.ones((len(t), 2)),
        key=key[shuffled],
        t=t[shuffled],
        box=np.ones((len(t), 4)),
        hit_score=ones,
        seen=no > 0,
        speed=no,
    )


@pytest.mark.parametrize(("lasting", "jitter"), [(0.1, 0.005), (0.1, 0.08), (0.05, 0.02)])
def test_jitter_is_no_lasting_error_and_a_common_offset_is_none(lasting, jitter):
    assert lasting_error(drawn(lasting, jitter), C) == pytest.approx(lasting, rel=0.15)


def test_boxes_that_only_jitter_are_off_by_little():
    assert lasting_error(drawn(0.0, 0.08), C) < 0.01


def test_each_box_is_paired_with_the_first_of_its_object_that_is_late_enough():
    matched = drawn(0.08, 0.03, objects=4, scans=30)
    off = np.clip(matched.residual - np.median(matched.residual, axis=0), -C.lasting_clip, C.lasting_clip)
    found = []
    for i in range(len(off)):
        later = [
            (matched.t[j], j)
            for j in range(len(off))
            if (matched.key[j] == matched.key[i]).all()
            and matched.t[j] - matched.t[i] >= C.lasting_after_s - 1e-9
        ]
        if later and min(later)[0] - matched.t[i] <= C.lasting_within_s:
            found.append((off[i] * off[min(later)[1]] * [0.5, 0.5, 0.125, 0.125]).sum())
    assert lasting_error(matched, C) == pytest.approx(math.sqrt(np.mean(found)), rel=0.02)


def test_objects_that_are_seen_for_a_moment_say_nothing():
    assert lasting_error(drawn(0.1, 0.01, scans=4), C) is None
    assert lasting_error(drawn(0.1, 0.01, objects=0), C) is None
