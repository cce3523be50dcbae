"""Two sensors at one time: scan by scan is the optimum of additive gains, and better after an update."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from benchmarks.joint import WAYS, _assignments, drawn_scene, in_turn, most_likely, tables, wrong
from jeat_graph.association.assignment import assign


def test_a_joint_assignment_with_a_slot_a_sensor_is_that_of_each_sensor() -> None:
    rng = np.random.default_rng(4)
    slots = list(itertools.product(range(3), range(2)))
    for _ in range(30):
        gains = [np.maximum(rng.normal(0.5, 2.0, (3, rng.integers(0, 3))), 0.0) for _ in range(2)]
        boxes = [(s, j) for s in range(2) for j in range(gains[s].shape[1])]
        # One problem over the slots (track, sensor) and all boxes, by trying everything.
        best = max(
            sum(
                gains[sensor][track, j]
                for (of, j), (track, sensor) in zip(boxes, chosen, strict=True)
                if of == sensor
            )
            for chosen in itertools.permutations(slots, len(boxes))
        )
        assert sum(g[assign(g)].sum() for g in gains) == pytest.approx(best)


def test_all_assignments_are_tried_once() -> None:
    pairs = [tuple(zip(a.tolist(), b.tolist(), strict=True)) for a, b in _assignments(3, 2)]
    # Σ_k C(3, k) C(2, k) k!
    assert len(pairs) == len(set(pairs)) == 1 + 6 + 6


def test_scan_by_scan_confuses_fewer_boxes_than_one_joint_assignment() -> None:
    rng = np.random.default_rng(1)
    drawn = [drawn_scene(rng) for _ in range(1200)]
    joint, exact_first, poor_first = (
        np.array([wrong(one, way(one)) for one in drawn]) for way in list(WAYS.values())[:3]
    )
    for other, least in ((exact_first, 2.0), (poor_first, -1.0)):
        gain = joint - other
        assert gain.mean() > least * gain.std() / np.sqrt(len(gain))


def test_the_most_likely_of_both_is_no_less_likely_than_scan_by_scan() -> None:
    rng = np.random.default_rng(2)
    drawn = [drawn_scene(rng) for _ in range(60)]
    best = sum(wrong(one, most_likely(one)) for one in drawn)
    assert best <= sum(wrong(one, in_turn(one, (0, 1))) for one in drawn)


def test_the_tables_name_every_way() -> None:
    shown = {"preset": "default", "scans of one time": "in one step", "MOTA": 83.1, "HOTA": 1.0, "IDF1": 2.0}
    found = tables(
        {"drawn": dict.fromkeys(WAYS, (0.2, 0.01)), "demo": [shown | {"FP": 1, "FN": 2, "IDSW": 3}]}
    )
    assert [row[0] for row in found["joint-drawn"].rows] == list(WAYS)
    assert "83.1" in found["joint-demo"].render("text")
