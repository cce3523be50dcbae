"""Tables that are made when they are looked at."""

from __future__ import annotations

import copy
import pickle
from dataclasses import fields, replace

import numpy as np
import pytest

from jeat_graph import Tracker
from jeat_graph.data.promised import promised
from jeat_graph.data.trajectories import Trajectories


def table(made=None):
    if made is not None:
        made.append(1)
    columns = {"boxes": np.ones((2, 4)), "mean": np.ones((2, 6)), "var": np.ones((2, 6))}
    ids = np.array([3, 5])
    return Trajectories(
        t=np.zeros(2), track_id=ids, existence=np.ones(2), used=ids, sensors=("a",), **columns
    )


@pytest.mark.parametrize("name", [field.name for field in fields(Trajectories)])
def test_a_look_at_any_column_makes_the_table_once(name):
    made = []
    later = promised(lambda: table(made))
    assert isinstance(later, Trajectories)
    assert made == []
    np.testing.assert_array_equal(getattr(later, name), getattr(table(), name))
    assert len(later) == 2
    assert made == [1]
    assert type(later) is Trajectories
    assert vars(later).keys() == vars(table()).keys()


@pytest.mark.parametrize(
    "way",
    [
        copy.copy,
        copy.deepcopy,
        lambda one: pickle.loads(pickle.dumps(one)),
        lambda one: one.take([0, 1]),
        replace,
    ],
)
def test_a_copy_is_one_of_the_table(way):
    other = way(promised(table))
    assert type(other) is Trajectories
    assert other.track_id.tolist() == [3, 5]
    assert other.sensors == ("a",)


def test_a_table_that_is_looked_at_later_is_that_of_its_step():
    """Whatever comes between: boxes, sensors, classes, and an end of it all."""
    early, late = Tracker(image=(640, 480)), Tracker(image=(640, 480))
    looked, kept = [], []
    for k in range(12):
        sensors = ["b"] if k < 4 else ["a", "b"]
        classes = ["car"] if k > 6 else None
        scans = [(0.05 * k, name, [[100.0 + 3 * k, 200, 40, 30]], [0.9], classes) for name in sensors]
        kept.append(late.step(scans))
        now = early.step(scans)
        assert len(now) <= 1
        looked.append(now)
    late.reset(9.0)
    late.finish()
    assert sum(map(len, looked)) > 5
    for now, then in zip(looked, kept, strict=True):
        for field in fields(Trajectories):
            one, other = getattr(now, field.name), getattr(then, field.name)
            np.testing.assert_array_equal(one, other)
            assert getattr(one, "dtype", None) == getattr(other, "dtype", None)
