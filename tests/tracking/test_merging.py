"""Two walkers who were seen apart keep their two tracks where one hides the other."""

import numpy as np
import pytest

from jeat_graph import Tracker, load_config

RATE_HZ, SIZE = 15.0, (30.0, 80.0)


def walkers(tracker, state, hidden_from=2.6, until=3.2):
    """Identities in the tracker at each step: one walker catches up with another and goes along behind him.

    They are 60 px apart for a second; the second comes up to 2 px behind the first within another, and from
    `hidden_from` on only the first is found, in whose box the other is.
    """
    found = []
    for k in range(int(until * RATE_HZ)):
        t = k / RATE_HZ
        behind = max(60.0 * (1.0 - max(t - 1.0, 0.0)), 2.0)
        centres = [(400.0 + 20.0 * t, 300.0)]
        if t < hidden_from:
            centres.append((400.0 + 20.0 * t - behind, 298.0))
        boxes = [[x - SIZE[0] / 2, y - SIZE[1] / 2, *SIZE] for x, y in centres]
        tracker.step((t, "rgb", np.array(boxes), np.full(len(boxes), 0.9)))
        found.append(state(tracker)["track_id"].tolist())
    return found


@pytest.fixture
def tracker():
    def make(*changes):
        return Tracker(load_config("default", ["image.width=1280", "image.height=720", *changes]))

    return make


def test_who_was_seen_apart_stays_two_where_one_hides_the_other(tracker, state):
    assert walkers(tracker(), state)[int(3.0 * RATE_HZ)] == [1, 2]


def test_without_that_question_the_hidden_one_is_merged_away(tracker, state):
    assert walkers(tracker("merge.apart_overlap=0"), state)[int(3.0 * RATE_HZ)] == [1]


def test_when_each_was_last_seen_apart(tracker, state):
    one = tracker("merge.apart_overlap=0.3")
    walkers(one, state, until=2.5)
    apart = state(one)["seen_apart"]
    rgb = one.sensor_names.index("rgb")
    # Boxes 30 px wide overlap by an IoU of .3 when they are 16 px apart (and 2 px up): at 1 + 44 / 60 s.
    assert apart[:2, rgb] == pytest.approx(1.0 + 44.0 / 60.0, abs=0.12)
    assert np.isneginf(np.delete(apart[:2], rgb, axis=1)).all()
