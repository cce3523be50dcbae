"""However many sensors and boxes there are, a step is answered within a bound.

Times are of the processor, so that a busy machine does not count; the bounds are several times what is usual.
"""

from __future__ import annotations

import time

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.tracking.tracker import Tracker

MOST_BOXES, MOST_SENSORS = 30_000, 63
#: Seconds for a step of `MOST_BOXES` apart from each other, and for one box of each of `MOST_SENSORS`.
MOST_STEP_S, MOST_JOINT_S = 15.0, 2.0
SIDE_PX = 30.0


def apart(count: int) -> np.ndarray:
    """Boxes (M, 4) in rows and columns, none of which overlaps another."""
    columns = int(np.ceil(np.sqrt(count)))
    rows, column = np.divmod(np.arange(count), columns)
    return np.column_stack([column, rows, np.full((count, 2), 0.5)]) * 2.0 * SIDE_PX


def tracker_of(sensors: int, side: float) -> tuple[Tracker, list[str]]:
    names = [f"s{k}" for k in range(sensors)]
    declared = {"sensors": {name: {"rate_hz": 10.0} for name in names}}
    overrides = [f"sensors.{name}={{rate_hz: 10}}" for name in declared["sensors"]]
    config = load_config("default", [*overrides, "smoother.engine=none"])
    return Tracker(config, image=(side, side)), names


def seconds(call) -> float:
    begin = time.process_time()
    call()
    return time.process_time() - begin


@pytest.mark.parametrize("count", [1, 1000, MOST_BOXES])
def test_a_step_of_many_boxes_is_bounded(count):
    boxes = apart(count)
    tracker, (name,) = tracker_of(1, float(boxes.max()) + 2.0 * SIDE_PX)
    scores = np.full(count, 0.9)
    for k in range(2):
        scan = (0.1 + 0.1 * k, name, boxes + np.array([0.5 * k, 0.0, 0.0, 0.0]), scores)
        assert seconds(lambda scan=scan: tracker.step([scan])) < MOST_STEP_S
    assert tracker.num_born == count


@pytest.mark.parametrize("sensors", [1, 16, MOST_SENSORS - 2])
def test_a_step_of_many_sensors_is_bounded(sensors):
    tracker, names = tracker_of(sensors, 1000.0)
    for k in range(4):
        box = [[100.0 + k, 100.0, 60.0, 40.0]]
        scans = [(0.1 * k, name, box, [0.9]) for name in names]
        spent = seconds(lambda scans=scans: tracker.step(scans))
        assert k == 0 or spent < MOST_JOINT_S
    assert tracker.num_born == 1


def step_of(boxes: np.ndarray) -> float:
    """Seconds of the second step of a tracker that sees the same boxes twice."""
    tracker, (name,) = tracker_of(1, float(boxes.max()) + 2.0 * SIDE_PX)
    scores = np.full(len(boxes), 0.9)
    tracker.step([(0.0, name, boxes, scores)])
    return seconds(lambda: tracker.step([(0.1, name, boxes, scores)]))


def test_a_step_costs_little_more_than_in_proportion_to_the_boxes():
    little = min(step_of(apart(MOST_BOXES // 10)) for _ in range(3))
    much = min(step_of(apart(MOST_BOXES)) for _ in range(2))
    # In proportion it would be 10 times, by pairs 100 times.
    assert much < 40.0 * max(little, 0.002)


@pytest.mark.filterwarnings("ignore:.*of 1000 boxes at t = 0 s 968 do not count")
def test_a_thousand_boxes_that_all_coincide_are_bounded_too():
    assert step_of(np.tile([[10.0, 10.0, SIDE_PX, SIDE_PX]], (1000, 1))) < MOST_STEP_S
