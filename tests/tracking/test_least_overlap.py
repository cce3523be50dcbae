"""A sensor whose boxes are right only where they are like another's takes no part where they are not."""

import numpy as np
import pytest

from jeat_graph import Tracker, load_config

BOX = np.array([500.0, 300.0, 60.0, 40.0])
#: Sizes of events are rough, so that a box of the same centre and of twice the sides is inside every gate.
ROUGH = (
    "sensors.evt.sigma_log_width=0.5",
    "sensors.evt.sigma_log_height=0.5",
    "sensors.evt.blind_speed=0",
    "smoother.engine=none",
)


P_DETECT = 0.9


def of_size(times):
    """A box of the same centre whose IoU with `BOX` is 1 / times²."""
    size = times * BOX[2:]
    return [[*(BOX[:2] + 0.5 * (BOX[2:] - size)), *size]]


def after(begun_by, box, least, state):
    """Hits and ln width of a track of three scans by `begun_by`, and then a box of the events."""
    tracker = Tracker(load_config("highway", [*ROUGH, f"sensors.evt.least_overlap={least}"]))
    for k in range(3):
        tracker.step((0.05 * k, begun_by, [BOX.tolist()], [0.9]))
    assert tracker.num_tracks == 1
    tracker.step((0.11, "evt", box, [0.9]))
    return state(tracker)["hits"][0], state(tracker)["size_mean"][0, 0, 0]


@pytest.mark.parametrize(
    ("begun_by", "times", "least", "hits"),
    [
        ("rgb", 2.0, 0.0, 4),  # whoever is believed alike draws the track
        ("rgb", 2.0, 0.24, 4),
        ("rgb", 2.0, 0.26, 3),
        ("rgb", 1.05, 0.6, 4),
        ("evt", 2.0, 0.6, 4),  # nobody else has seen it: to whom should it be left?
    ],
)
def test_what_fits_less_is_not_the_tracks_where_another_sensor_has_seen_it(
    state, begun_by, times, least, hits
):
    counted, log_width = after(begun_by, of_size(times), least, state)
    assert counted == hits
    if hits == 3:
        np.testing.assert_allclose(log_width, np.log(BOX[2]), rtol=0, atol=1e-9)
    else:
        assert log_width > np.log(BOX[2])


def test_a_box_that_the_picture_cuts_is_compared_with_the_part_that_shows(state):
    image = ["image.width=1280", "image.height=720", "image.edge_px=3"]
    tracker = Tracker(load_config("highway", [*ROUGH, *image, "sensors.evt.least_overlap=0.75"]))
    for k in range(8):  # it drives out of the picture at the left
        left = 10.0 - 6.0 * k
        seen = [[max(left, 0.0), 300.0, min(left, 0.0) + 60.0, 40.0]]
        tracker.step([(0.05 * k, "rgb", seen, [0.9]), (0.05 * k, "evt", seen, [0.9])])
    assert state(tracker)["hits"].tolist() == [16]


def existence_beside(misfit, overlap, state, scans=6):
    """Existence of a track of `rgb` after scans in which the events show `misfit`, or nothing."""
    changes = [
        *ROUGH,
        "sensors.evt.least_overlap=0.6",
        f"sensors.evt.p_detect={P_DETECT}",
        f"birth.max_overlap={overlap}",
    ]
    tracker = Tracker(load_config("highway", changes))
    for k in range(scans):
        tracker.step((0.05 * k, "rgb", [BOX.tolist()], [0.9]))
        scores = [0.5] * len(misfit)
        tracker.step((0.05 * k + 0.01, "evt", misfit, scores))
    first = state(tracker)
    assert first["seen_by"][0] == 2, "the events' box was taken"
    return first["existence"][0], first["p_detect"][0, 0], tracker.num_tracks


def test_a_worse_outline_of_a_vehicle_is_no_miss(state):
    """A box of IoU .44: for the track it is too bad, and it begins none of its own."""
    beside, own, tracks = existence_beside(of_size(1.5), 0.3, state)
    missed, less, _ = existence_beside([], 0.3, state)
    assert tracks == 1
    assert beside > missed
    assert less < own == P_DETECT


def test_a_box_that_may_be_a_vehicle_of_its_own_excuses_nobody(state):
    beside, own, tracks = existence_beside(of_size(1.5), 0.5, state, scans=1)
    excused, _, _ = existence_beside(of_size(1.5), 0.3, state, scans=1)
    assert tracks == 2
    assert beside < excused
    assert own < P_DETECT


def test_one_outline_excuses_one_track(state):
    """Two tracks that overlap: the box is a worse outline of the nearer one, and the other was missed."""
    second = BOX + np.array([45.0, 0.0, 0.0, 0.0])
    changes = [*ROUGH, "sensors.evt.least_overlap=0.6", "birth.max_overlap=0.2"]
    tracker = Tracker(load_config("highway", changes))
    for k in range(5):
        tracker.step((0.05 * k, "rgb", [BOX.tolist(), second.tolist()], [0.9, 0.9]))
    before = state(tracker)["p_detect"][:, 0].copy()
    tracker.step((0.21, "evt", [[497.0, 300.0, 106.0, 40.0]], [0.9]))  # IoU .57 with one, .54 with the other
    assert state(tracker)["hits"].tolist() == [5, 5]
    after = state(tracker)["p_detect"][:, 0]
    assert after[0] == before[0]
    assert after[1] < before[1]
