"""Births: duplicates are refused, two sensors' views of one new vehicle are one birth."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.association.births import choose_births
from jeat_graph.association.overlap import overlap


def iou(a, b):
    width = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    height = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    common = max(width, 0.0) * max(height, 0.0)
    return common / (a[2] * a[3] + b[2] * b[3] - common)


def births(boxes, existence, sensor, taken=None, tracks=(), least=0.01, most=0.5, denied=None):
    boxes = np.array(boxes, dtype=float).reshape(-1, 4)
    tracks = np.array(tracks, dtype=float).reshape(-1, 4)
    nobody = np.zeros((len(tracks), max(sensor, default=0) + 1), dtype=bool)
    parents, partner, double = choose_births(
        boxes,
        np.array(existence, dtype=float),
        np.array(sensor, dtype=np.int64),
        np.zeros(len(boxes), dtype=np.int64) if taken is None else np.array(taken, dtype=np.int64),
        tracks,
        nobody if denied is None else denied,
        least,
        most,
    )
    return parents.tolist(), partner.tolist(), double.tolist()


@st.composite
def boxes(draw, most):
    n = draw(st.integers(0, most))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    return np.column_stack([rng.uniform(0, 30, (n, 2)), rng.uniform(10, 30, (n, 2))])


@given(a=boxes(6), b=boxes(6))
def test_overlap_is_intersection_over_union(a, b):
    for one in a:
        for two in b:
            assert np.isclose(overlap(one, two), iou(one, two))
            assert overlap(one, two) == overlap(two, one)
        assert np.isclose(overlap(one, one), 1.0)


@given(
    dets=boxes(9),
    tracks=boxes(4),
    seed=st.integers(0, 10**6),
    least=st.sampled_from([0.0, 0.3]),
    most=st.sampled_from([0.2, 0.5, 0.8, 1.0]),
)
@settings(max_examples=200, deadline=None)
def test_every_detection_has_a_reason_for_what_became_of_it(dets, tracks, seed, least, most):
    rng = np.random.default_rng(seed)
    # Few distinct probabilities, so that ties occur: the earlier detection is first.
    existence = rng.integers(0, 5, len(dets)) / 4
    sensor, taken = rng.integers(0, 3, len(dets)), rng.integers(0, 2, len(dets))
    denied = rng.random((len(tracks), 3)) < 0.3
    parents, partner, double = births(dets, existence, sensor, taken, tracks, least, most, denied)
    free = [j for j in range(len(dets)) if not taken[j] and existence[j] >= least]
    surer = {j: {k for k in free if (-existence[k], k) < (-existence[j], j)} for j in free}
    assert parents == sorted(parents, key=lambda j: (-existence[j], j))
    views = [[parent, *(j for j in free if partner[j] == b)] for b, parent in enumerate(parents)]
    for view in views:
        assert len({sensor[j] for j in view}) == len(view), "a vehicle has one box of each sensor"
        assert all(iou(dets[j], dets[view[0]]) > most / 2 and view[0] in surer[j] for j in view[1:])
    for j in range(len(dets)):
        coincident = [i for i, track in enumerate(tracks) if most < 1.0 and iou(dets[j], track) > most]
        on_track = [i for i in coincident if not denied[i, sensor[j]]]
        if j not in free or on_track:
            assert j not in parents
            assert partner[j] == -1
            # Where several tracks refuse it, the leftmost does.
            assert double[j] == (min(on_track, key=lambda i: (tracks[i][0], i)) if j in free else -1)
            continue
        assert double[j] == -1
        near = []  # the births before it that it cannot be told from
        for b, view in enumerate(views):
            own = [k for k in view if sensor[k] == sensor[j] and k in surer[j]]
            common = [iou(dets[j], dets[k]) for k in [view[0], *own]]
            joined = bool(own) and own[0] != view[0]
            if own and (max(common) > most or (joined and min(common) > most / 2)):
                near.append(-1)  # a second box of what this sensor shows already
            elif not own and view[0] in surer[j] and iou(dets[j], dets[view[0]]) > most / 2:
                near.append(b)
        near = near if most < 1.0 else []
        assert (j in parents) == (not near)
        assert partner[j] == (near[0] if near else -1)


def test_the_surest_detection_is_born_first():
    far = [[0, 0, 10, 10], [100, 0, 10, 10], [200, 0, 10, 10]]
    assert births(far, [0.2, 0.9, 0.5], [0, 0, 0])[:2] == ([1, 2, 0], [-1, -1, -1])


def test_a_detection_on_a_track_starts_none_and_says_on_which():
    tracks = [[50, 0, 10, 10], [1, 0, 10, 10]]
    assert births([[0, 0, 10, 10], [90, 0, 10, 10]], [0.9, 0.9], [0, 0], tracks=tracks) == (
        [1],
        [-1, -1],
        [1, -1],
    )


def test_a_track_that_its_sensor_denies_refuses_no_detection():
    box, track = [[0, 0, 10, 10]], [[1, 0, 10, 10]]
    for sensor, begins in ((0, []), (1, [0])):
        found = births(box, [0.9], [sensor], tracks=track, denied=np.array([[False, True]]))
        assert found[0] == begins


def test_two_sensors_views_of_one_vehicle_are_one_birth():
    assert births([[0, 0, 10, 10], [1, 0, 10, 10]], [0.4, 0.9], [0, 1])[:2] == ([1], [0, -1])


def test_two_boxes_of_one_sensor_on_one_place_are_one_birth_and_no_second_view():
    assert births([[0, 0, 10, 10], [1, 0, 10, 10]], [0.4, 0.9], [0, 0])[:2] == ([1], [-1, -1])


def test_a_box_over_two_vehicles_of_another_sensor_swallows_only_one_of_them():
    wide, left, right = [0, 0, 120, 60], [0, 0, 60, 60], [60, 0, 60, 60]
    assert births([wide, left, right], [0.9, 0.8, 0.8], [0, 1, 1])[:2] == ([0, 2], [-1, 0, -1])
    # The other way round the wide box joins the first vehicle.
    assert births([wide, left, right], [0.7, 0.8, 0.8], [0, 1, 1])[:2] == ([1, 2], [0, -1, -1])


def test_a_second_box_of_what_has_joined_a_birth_is_a_duplicate():
    first, joins, again = [0, 0, 10, 10], [4, 0, 10, 10], [6, 0, 10, 10]
    assert births([first, joins, again], [0.9, 0.8, 0.7], [0, 1, 1])[:2] == ([0], [-1, 0, -1])
    # Not so of one sensor alone, which sees each thing more exactly than two see it together.
    assert births([first, again], [0.9, 0.7], [1, 1])[:2] == ([0, 1], [-1, -1])


def test_a_third_sensors_view_joins_as_well():
    assert births([[0, 0, 10, 10]] * 3, [0.9, 0.8, 0.7], [0, 1, 2])[:2] == ([0], [-1, 0, 0])


def test_what_a_track_took_and_what_is_too_doubtful_start_none():
    far = [[0, 0, 10, 10], [100, 0, 10, 10], [200, 0, 10, 10]]
    assert births(far, [0.9, 0.001, 0.9], [0, 0, 0], taken=[1, 0, 0])[:2] == ([2], [-1, -1, -1])


def test_the_paper_refuses_no_birth():
    same = [[0, 0, 10, 10]] * 3
    parents, partner, _ = births(same, [0.0, 0.0, 0.0], [0, 1, 0], tracks=same, least=0.0, most=1.0)
    assert (parents, partner) == ([0, 1, 2], [-1, -1, -1])
