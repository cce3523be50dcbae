"""A sensor that once had a box on a thing is no witness for ever: misses outweigh what came by chance."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.tracking.tracker import Tracker

RATE_HZ = 10.0
POLE = np.array([600.0, 300.0, 40.0, 80.0])
FOREVER = "lifecycle.witness_odds=0"
#: Since when the first sensor sees the pole (s).
BEGIN = 10.0


def at_pole(boxes):
    centre = boxes[:, :2] + 0.5 * boxes[:, 2:]
    return np.hypot(*(centre - (POLE[:2] + 0.5 * POLE[2:])).T) < 10.0


def watch(second_sees, *overrides, seconds=30.0):
    """Both sensors see four cars, the first a pole too; `second_sees(t)` says when the second does.

    Returns the times of the rows at the pole, and the tracker.
    """
    rng = np.random.default_rng(5)
    declared = [f"sensors.{name}={{rate_hz: {RATE_HZ}}}" for name in ("one", "two")]
    tracker = Tracker(load_config("default", [*declared, *overrides]), image=(1242, 375))
    times = []
    for k in range(int(seconds * RATE_HZ)):
        t = k / RATE_HZ
        cars = np.array([[(60.0 * t + 250.0 * i) % 1180.0, 150.0 + 30.0 * i, 60.0, 40.0] for i in range(4)])
        for name, seen in (("one", t >= BEGIN), ("two", t >= BEGIN and second_sees(t))):
            boxes = np.vstack([cars, POLE[None]] if seen else [cars])
            scores = rng.uniform(0.85, 0.97, len(boxes))
            if seen:
                # Scores of a kind that does not last; flickering boxes of it teach that.
                scores[-1] = rng.uniform(0.5, 0.6)
            flicker = np.column_stack([rng.uniform(0, 1150, 2), rng.uniform(0, 290, 2), np.full((2, 2), 40)])
            boxes = np.vstack([boxes + rng.normal(0.0, 1.0, boxes.shape), flicker])
            scores = np.concatenate([scores, rng.uniform(0.5, 0.6, 2)])
            table = tracker.step((t, name, boxes, scores))
        times += [t] * int(at_pole(table.boxes).sum())
    return np.array(times), tracker


def witnesses(tracker):
    """Names of the sensors that have seen the track at the pole; none where there is no such track."""
    tracks, n = tracker._tracks, tracker._num_tracks
    pole = POLE[:2] + 0.5 * POLE[2:]
    near = np.hypot(*(tracks.mean[:n, :, 0] - pole).T) < 10.0
    bits = tracks.seen_by[:n][near].max(initial=0)
    return {name for s, name in enumerate(tracker.config.sensor_names) if bits >> s & 1}


def by_chance(t):
    return t < BEGIN + 0.25


def test_what_a_second_sensor_saw_by_chance_is_soon_the_first_one_s_alone():
    times, tracker = watch(by_chance)
    assert (times > BEGIN + 5.0).sum() == 0
    assert "two" not in witnesses(tracker)


def test_unless_who_saw_a_thing_once_is_its_witness_for_good():
    times, tracker = watch(by_chance, FOREVER)
    assert (times > BEGIN + 5.0).sum() > 100
    assert witnesses(tracker) == {"one", "two"}


@pytest.mark.parametrize("hidden_s", [0.5, 2.0])
def test_who_has_seen_it_for_long_may_miss_it_for_a_while(hidden_s):
    times, tracker = watch(lambda t: t < 27.0, seconds=27.0 + hidden_s)
    assert (times > 27.0).sum() > 9 * hidden_s - 1
    assert witnesses(tracker) == {"one", "two"}


def test_who_sees_it_again_is_a_witness_again():
    _, tracker = watch(lambda t: by_chance(t) or t > 28.85, seconds=29.0)
    assert witnesses(tracker) == {"one", "two"}


def test_what_one_alone_has_ever_seen_stays_its_own():
    """However often it misses it: a track has been seen by somebody."""
    _, tracker = watch(lambda t: False, seconds=12.0)
    tracks, n = tracker._tracks, tracker._num_tracks
    assert (tracks.seen_by[:n] > 0).all()
