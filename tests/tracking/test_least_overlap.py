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
