"""Which detections of a run's log belong to which track of its smoothed table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.data.trajectories import Trajectories
from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.road.box_rows import BoxConfig
from jeat_graph.road.taken_boxes import boxes_of_log

from .scenes import camera

T = np.arange(0.0, 6.0, 0.1)
RIGHT, LEFT = 200.0 + 60.0 * T, 560.0 - 60.0 * T
SIZE = np.array([40.0, 30.0])


def log_of(*tracks):
    """Records of what tracks (identity, t, x) took in."""
    parts = []
    for identity, t, x in tracks:
        rows = np.zeros(len(t), dtype=MEASUREMENT)
        rows["t"], rows["track_id"], rows["z"][:, 0], rows["z"][:, 1] = t, identity, x, 300.0
        rows["r"], rows["scale"], rows["log_size"], rows["size_var"] = 1.0, 1.0, np.log(SIZE), 0.01
        parts.append(rows)
    return np.concatenate(parts)


def table_of(*tracks):
    """A smoothed table of tracks (identity, t, x)."""
    t, x = (np.concatenate([one[k] for one in tracks]) for k in (1, 2))
    boxes = np.column_stack([x - 20.0, np.full(len(x), 285.0), np.full(len(x), 40.0), np.full(len(x), 30.0)])
    identity = np.repeat([one[0] for one in tracks], [len(one[1]) for one in tracks])
    mean = np.zeros((len(x), 6))
    ones = np.ones(len(x))
    return Trajectories(t, identity, boxes, ones, mean, np.ones((len(x), 6)), ones.astype(np.int64), ("a",))


def taken(log, table):
    """Middles (M,) of what each track took in, by identity and in order of time."""
    found = boxes_of_log(log, table, camera(), BoxConfig(bin_s=1e-3))
    return {one.track_id: (one.rows.t, one.rows.z[:, 0]) for one in found}


def test_a_track_has_its_own_detections_those_beside_its_boxes_too():
    x = RIGHT.copy()
    x[[7, 20, 21]] += 80.0
    t, z = taken(log_of((1, T, x)), table_of((1, T, RIGHT)))[1]
    assert t == pytest.approx(T)
    assert z == pytest.approx(x)


def test_detections_before_and_after_the_rows_of_a_track_stay_its_own():
    t, _ = taken(log_of((1, T, RIGHT)), table_of((1, T[20:40], RIGHT[20:40])))[1]
    assert t == pytest.approx(T)


def test_a_stitched_fragment_belongs_to_the_track_on_whose_boxes_it_lies():
    log = log_of((1, T[:25], RIGHT[:25]), (2, T, LEFT), (3, T[35:], RIGHT[35:]))
    found = taken(log, table_of((1, T, RIGHT), (2, T, LEFT)))
    assert sorted(found) == [1, 2]
    assert found[1][0] == pytest.approx(np.r_[T[:25], T[35:]])
    assert found[2][0] == pytest.approx(T)


def test_tracks_that_were_exchanged_have_what_the_other_took_in_from_then_on():
    turned, back = (np.where(T < 3.0, a, b) for a, b in ((RIGHT, LEFT), (LEFT, RIGHT)))
    found = taken(log_of((1, T, turned), (2, T, back)), table_of((1, T, RIGHT), (2, T, LEFT)))
    for identity, x in ((1, RIGHT), (2, LEFT)):
        t, z = found[identity]
        apart = np.abs(t - 3.0) > 0.35
        assert apart.sum() == (np.abs(T - 3.0) > 0.35).sum()
        assert z[apart] == pytest.approx(np.interp(t[apart], T, x))
    assert sum(len(t) for t, _ in found.values()) == 2 * len(T)


def test_detections_of_tracks_that_were_exchanged_where_no_place_tells_it_go_by_the_table():
    """Two that lie within each other's boxes all the time; the causal tracks changed places at 3 s."""
    near, after = RIGHT + 6.0, T >= 3.0
    first, second = np.where(after, near, RIGHT), np.where(after, RIGHT, near)
    table = table_of((1, T, RIGHT), (2, T, near))
    causal = np.concatenate([np.where(after, 2, 1), np.where(after, 1, 2)])
    decided = replace(table, causal_id=causal, identity_probability=np.ones(len(causal)))
    found = taken(log_of((1, T, first), (2, T, second)), decided)
    assert found[1][1] == pytest.approx(RIGHT)
    assert found[2][1] == pytest.approx(near)
    undecided = taken(log_of((1, T, first), (2, T, second)), table)
    assert undecided[1][1] == pytest.approx(first)
