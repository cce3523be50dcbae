"""What events alone see goes on although pictures look, once these have looked for it in vain."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Tracker, load_config

BOX = np.array([500.0, 300.0, 60.0, 40.0])
NOTHING = np.zeros((0, 4))
NIGHT = (
    "smoother.engine=none",
    "sensors.rgb={rate_hz: 20}",
    "sensors.evt.rate_hz=20",
)
#: More false boxes, so that a track which is hardly believed takes none, and ends late.
DOUBTED = ("sensors.evt.clutter_per_scan=3", "birth.min_existence=1e-4", "lifecycle.delete_existence=1e-9")


def dark(*overrides):
    """A tracker whose two sensors have looked at nothing for a second."""
    tracker = Tracker(load_config("default", [*NIGHT, *overrides]), image=(1280, 720))
    for k in range(20):
        tracker.step((0.05 * k, "rgb", NOTHING, []))
        tracker.step((0.05 * k + 0.01, "evt", NOTHING, []))
    return tracker


def shifted(x, y=0.0):
    return BOX + np.array([x, y, 0.0, 0.0])


def beside_a_lit_car(*overrides):
    """A tracker whose two sensors have both followed a car for two seconds."""
    tracker = dark(*overrides)
    for k in range(40):
        tracker.step((1.0 + 0.05 * k, "rgb", [shifted(2.0 * k, 200.0)], [0.9]))
        tracker.step((1.01 + 0.05 * k, "evt", [shifted(2.0 * k, 200.0)], [0.8]))
    return tracker


@pytest.mark.parametrize("speed", [60.0, 200.0])
def test_events_follow_what_pictures_never_find(speed):
    """A dark car beside one that both see: the pictures look all the time, and are not blind as a whole.

    Nothing is known of a new track's speed, and an event camera does not see what stands: only when the
    pictures have looked for it in vain is its second box believed to be of something that moves.
    """
    tracker, rows = beside_a_lit_car(), 0
    for k in range(40):
        t = 3.0 + 0.05 * k
        lit, unlit = shifted(80.0 + 2.0 * k, 200.0), shifted(speed * 0.05 * k - 300.0)
        tracker.step((t, "rgb", [lit], [0.9]))
        table = tracker.step((t + 0.01, "evt", [lit, unlit], [0.8, 0.8]))
        rows += int(np.any(np.abs(table.boxes[:, 1] - BOX[1]) < 10.0))
    assert rows >= 25


def test_a_second_box_of_events_waits_for_the_pictures_look(state):
    """Boxes of nothing repeat from scan to scan: until the pictures have looked, they say nothing."""
    tracker = beside_a_lit_car(*DOUBTED)
    for k in range(3):
        lit = shifted(80.0, 200.0)
        tracker.step((3.01 + 0.01 * k, "evt", [lit, shifted(0.5 * k)], [0.8, 0.8]))
    hits = state(tracker)["hits"]
    assert len(hits) > 1
    assert hits[1:].max() == 1
    for k in range(2):
        tracker.step((3.05 + 0.05 * k, "rgb", [lit], [0.9]))
    tracker.step((3.11, "evt", [lit, shifted(3.0)], [0.8, 0.8]))
    assert state(tracker)["hits"][1:].max() == 2
