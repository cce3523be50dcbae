"""Pieces that passes agree on, of one sensor and of two."""

from __future__ import annotations

import numpy as np

from jeat_graph.association.agreement import SeenBoxes, pieces, successive, votes_between


def test_links_that_nearly_all_passes_make_are_pieces():
    seen = SeenBoxes(np.arange(5.0), np.zeros(5, dtype=int))
    assigned = np.array([[1, 1, 1, 1, 1], [9, 9, 9, 4, 4]])
    assert pieces(seen, assigned, 0.8).tolist() == [0, 0, 0, 1, 1]


def test_two_of_three_are_no_eight_tenths():
    seen = SeenBoxes(np.arange(2.0), np.zeros(2, dtype=int))
    assigned = np.array([[1, 1], [1, 1], [1, 2]])
    assert pieces(seen, assigned, 0.8).tolist() == [0, 1]
    assert pieces(seen, assigned, 0.6).tolist() == [0, 0]


def test_boxes_of_two_sensors_are_one_piece_where_the_causal_pass_says_so():
    t = np.repeat(np.arange(4.0), 2) / 10
    sensor = np.tile([0, 1], 4)
    apart = np.array([1, 2] * 4)
    assert pieces(SeenBoxes(t, sensor), np.array([[5] * 8, apart]), 0.8).tolist() == [0] * 8
    assert pieces(SeenBoxes(t, sensor), np.array([apart, [5] * 8]), 0.8).tolist() == [0, 1] * 4
    assert pieces(SeenBoxes(t, sensor), np.array([apart, apart]), 0.8).tolist() == [0, 1] * 4


def test_a_piece_never_has_two_boxes_of_a_sensor_at_one_time():
    # The passes give the boxes of sensor 1 to one of two objects of sensor 0 each.
    t = np.repeat(np.arange(4.0), 3) / 10
    sensor = np.tile([0, 0, 1], 4)
    assigned = np.array([[1, 2, 1] * 4, [1, 2, 2] * 4])
    found = pieces(SeenBoxes(t, sensor), assigned, 0.8)
    for time in np.unique(t):
        for which in (0, 1):
            own = found[(t == time) & (sensor == which)]
            assert len(set(own.tolist())) == len(own)


def test_successive_detections_and_votes_are_counted():
    assigned = np.array([[1, 2, 1, 2], [1, 1, 1, 1]])
    tail, head, votes = successive(assigned)
    assert list(zip(tail.tolist(), head.tolist(), votes.tolist(), strict=True)) == [
        (0, 1, 1),
        (0, 2, 1),
        (1, 2, 1),
        (1, 3, 1),
        (2, 3, 1),
    ]
    piece = np.array([0, -1, 1, 2])
    tail, head, votes = votes_between(piece, assigned, np.array([0, 2, 3]))
    assert list(zip(tail.tolist(), head.tolist(), votes.tolist(), strict=True)) == [(0, 1, 2), (1, 2, 1)]
