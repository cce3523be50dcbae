"""A vehicle that events outline badly is given to the pictures, once these have looked there in vain."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Tracker, load_config

LIT = np.array([400.0, 500.0, 60.0, 40.0])
#: The car, and what events take for it: less than half of what the two cover is common to them.
CAR, OUTLINE = np.array([300.0, 200.0, 120.0, 60.0]), np.array([350.0, 200.0, 120.0, 60.0])
NIGHT = (
    "smoother.engine=none",
    "sensors.rgb={rate_hz: 20, disagreement: 0}",
    "sensors.evt={rate_hz: 20, blind_speed: 2, least_overlap: 0.7}",
    "birth.max_overlap=0.3",
)


def along(box, t):
    return box + np.array([60.0 * t, 0.0, 0.0, 0.0])


def watch(*overrides, car_from=2.0, seconds=4.0):
    """The last table: both follow a lit car; from 1.5 s on events see an outline, pictures the car later."""
    tracker = Tracker(load_config("default", [*NIGHT, *overrides]), image=(1280, 720))
    for k in range(int(seconds * 20)):
        t = 0.05 * k
        seen = [along(LIT, t)] + ([along(CAR, t)] if t > car_from else [])
        tracker.step((t, "rgb", seen, [0.9] * len(seen)))
        found = [along(LIT, t)] + ([along(OUTLINE, t)] if t > 1.5 else [])
        table = tracker.step((t + 0.01, "evt", found, [0.9] * len(found)))
    return table


def shows(table, box):
    return bool((np.abs(table.boxes - along(box, table.t[0])).max(axis=1) < 12.0).any())


def test_what_pictures_see_takes_the_place_of_an_outline_that_they_do_not():
    table = watch()
    assert shows(table, LIT)
    assert shows(table, CAR)
    assert not shows(table, OUTLINE)
    assert len(table) == 2


def test_what_pictures_never_see_stays():
    table = watch(car_from=np.inf)
    assert shows(table, LIT)
    assert shows(table, OUTLINE)


@pytest.mark.parametrize(
    "otherwise",
    [
        # Who sees half of all vehicles cannot say that there is none.
        "sensors.rgb={rate_hz: 20, disagreement: 0, p_detect: 0.5}",
        # Nobody's misses count against a track.
        "lifecycle.witness_odds=0",
        # A sensor that sees what stands is not told by another where there is nothing.
        "sensors.evt.blind_speed=0",
    ],
)
def test_unless_the_pictures_cannot_deny_it(otherwise):
    table = watch(otherwise, "lifecycle.scene_memory_s=0")
    assert shows(table, OUTLINE)
    assert not shows(table, CAR)
