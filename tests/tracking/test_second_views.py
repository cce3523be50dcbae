"""A second sensor's view counts like the first: joint association leaves it to a second pass."""

import numpy as np
import pytest

from jeat_graph import Tracker, load_config

SEQUENTIAL = "association={method: sequential, priority: [rgb]}"
COUNTED = ("existence", "p_detect", "hidden", "hits", "seen_by", "mean", "cov", "size_mean", "scale")


def views(k):
    """Two sensors' scans of one car, of one instant."""
    box = [[500.0 + 6.0 * k, 300.0, 60.0, 40.0]]
    return [(0.05 * k, "rgb", box, [0.55]), (0.05 * k, "evt", box, [0.6])]


def test_taken_in_a_second_pass_a_view_counts_as_if_it_came_alone_at_the_same_time(state):
    # Seen however fast it is: else P_D would follow the speed, which the first view has changed.
    config = load_config("highway", [SEQUENTIAL, "sensors.evt.blind_speed=0", "smoother.engine=none"])
    together, apart = Tracker(config), Tracker(config)
    for k in range(8):
        together.step(views(k)) if k else together.step(views(k)[0])
        for scan in views(k) if k else views(k)[:1]:
            apart.step(scan)
        one, two = state(together), state(apart)
        for name in COUNTED:
            np.testing.assert_allclose(one[name], two[name], rtol=1e-9, atol=1e-12, err_msg=f"{name}, {k}")
    assert state(together)["hits"].tolist() == [15]


@pytest.mark.parametrize("method", ["slots", "joint", "sequential"])
def test_who_has_just_seen_a_vehicle_has_it_not_hidden(state, method):
    config = load_config("highway", [f"association.method={method}", "smoother.engine=none"])
    tracker = Tracker(config)
    # The first two views begin the track, the second as its partner; then they are taken.
    for k in range(3):
        tracker.step(views(k))
        assert state(tracker)["hidden"].tolist() == [[0.0, 0.0]]
    assert tracker.num_tracks == 1
