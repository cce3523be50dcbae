"""Scans of different sensors at nearly one time get one time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph import Detections, Scan, Tracker, load_config
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.pairing import paired, paired_times
from jeat_graph.live.late import LiveTracker
from jeat_graph.runs.latency import at_measurement

PAIR = ["paper.pair_within_s=0.002"]


def scan(t: float, sensor: str, left: float = 100.0) -> Scan:
    return Scan(t, sensor, np.array([[left, 100.0, 40.0, 30.0]]), np.array([0.9]))


def test_near_scans_of_two_sensors_are_one_batch_at_the_last_one_s_time() -> None:
    found = Detections.from_scans(
        [scan(0.0, "rgb"), scan(0.0012, "evt"), scan(0.01, "evt"), scan(0.05, "rgb")]
    )
    config = load_config("paper", PAIR)
    batches = [[(one.t, one.sensor) for one in batch] for batch in at_measurement(found, config).batches()]
    assert batches == [[(0.0012, "evt"), (0.0012, "rgb")], [(0.01, "evt")], [(0.05, "rgb")]]


def test_the_boxes_stay_with_their_sensors() -> None:
    found = Detections.from_scans([scan(0.0, "rgb", 1.0), scan(0.001, "evt", 2.0)])
    (batch,) = paired(found, 0.002).batches()
    assert {one.sensor: one.boxes[0, 0] for one in batch} == {"evt": 2.0, "rgb": 1.0}


def test_only_the_paper_s_engine_pairs() -> None:
    found = Detections.from_scans([scan(0.0, "rgb"), scan(0.001, "evt")])
    assert len(list(at_measurement(found, load_config("default", PAIR)).batches())) == 2
    assert len(list(at_measurement(found, load_config("paper")).batches())) == 2


def test_one_sensor_never_meets_itself() -> None:
    t = np.array([0.0, 0.001, 0.002])
    assert paired_times(t, np.array([0, 0, 0]), 1.0).tolist() == t.tolist()


def test_decimal_times_are_as_far_apart_as_they_read() -> None:
    assert paired_times(np.array([0.12, 0.13]), np.array([0, 1]), 0.01).tolist() == [0.13, 0.13]


@given(
    looks=st.sets(st.tuples(st.integers(0, 40), st.integers(0, 2)), min_size=1, max_size=30),
    within=st.integers(0, 15),
)
def test_groups_are_narrow_and_have_no_sensor_twice(looks: set[tuple[int, int]], within: int) -> None:
    order = sorted(looks)
    t, sensor = np.array([k / 1000 for k, _ in order]), np.array([s for _, s in order])
    out = paired_times(t, sensor, within / 1000)
    assert (out >= t).all()
    assert (np.diff(out) >= 0).all()
    assert (out - t <= within / 1000 + 1e-9).all()
    assert len(set(zip(out.tolist(), sensor.tolist(), strict=True))) == len(order)
    for time in set(t.tolist()):  # what had one time keeps one
        assert len(set(out[t == time].tolist())) == 1


def test_a_live_tracker_refuses_to_pair() -> None:
    with pytest.raises(ConfigError, match=r"paper\.pair_within_s: whoever gives the scans pairs them"):
        LiveTracker(Tracker(load_config("paper", PAIR)))
