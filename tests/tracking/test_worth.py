"""One sensor alone: what comes back is believed if boxes of such scores last, as is found out on the way."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.tracking.tracker import Tracker

RATE_HZ = 10.0
BUSH = np.array([600.0, 300.0, 40.0, 80.0])
NOT_ASKED = "lifecycle.min_worth=0"


def at_bush(table):
    centre = table.boxes[:, :2] + 0.5 * table.boxes[:, 2:]
    return np.hypot(*(centre - (BUSH[:2] + 0.5 * BUSH[2:])).T) < 10.0


def follow(score_of, *overrides, second=(), seconds=40.0, until=30.0):
    """Cars, flickering false boxes, and from `until` on a bush that is found in every scan.

    `score_of(kind, rng)` gives the score of a box; sensors in `second` see the bush too. Returns how many
    rows of the table after `until` + 5 s lie on the bush and on cars, per scan, and the tracker.
    """
    rng = np.random.default_rng(3)
    declared = [f"sensors.{name}={{rate_hz: {RATE_HZ}}}" for name in ("one", *second)]
    tracker = Tracker(
        load_config("default", [*declared, "smoother.engine=full", *overrides]), image=(1242, 375)
    )
    on_bush, on_cars = [], []
    for k in range(int(seconds * RATE_HZ)):
        t = k / RATE_HZ
        cars = np.array([[(60.0 * t + 250.0 * i) % 1180.0, 150.0 + 30.0 * i, 60.0, 40.0] for i in range(4)])
        flicker = np.column_stack(
            [rng.uniform(0, 1150, 3), rng.uniform(0, 290, 3), rng.uniform(20, 80, (3, 2))]
        )
        kinds = ["car"] * 4 + ["false"] * 3
        boxes = np.vstack([cars + rng.normal(0.0, 1.0, cars.shape), flicker])
        if t >= until:
            kinds, boxes = [*kinds, "false"], np.vstack([boxes, BUSH + rng.normal(0.0, 1.0, 4)])
        scores = np.array([score_of(kind, rng) for kind in kinds])
        table = tracker.step((t, "one", boxes, scores))
        for name in second:
            shown = BUSH[None] if t >= until else np.zeros((0, 4))
            table = tracker.step((t + 0.01, name, shown, np.full(len(shown), 0.9)))
        if t >= until + 5.0:
            near = at_bush(table)
            on_bush.append(near.sum())
            on_cars.append((~near).sum())
    return np.mean(on_bush), np.mean(on_cars), tracker


def told_by_score(kind, rng):
    return rng.uniform(0.85, 0.97) if kind == "car" else rng.uniform(0.5, 0.65)


def meaningless(kind, rng):
    return rng.uniform(0.3, 0.95)


def test_a_false_thing_that_comes_back_is_known_by_the_scores_of_what_did_not_last():
    on_bush, on_cars, tracker = follow(told_by_score)
    assert on_bush == 0.0
    assert on_cars > 3.0
    smoothed = tracker.finish()
    assert not at_bush(smoothed).any()


def test_unless_it_is_not_asked():
    on_bush, on_cars, _ = follow(told_by_score, NOT_ASKED)
    assert on_bush > 0.9
    assert on_cars > 3.0


def test_what_a_second_sensor_sees_too_needs_no_score():
    on_bush, _, _ = follow(told_by_score, second=("two",))
    assert on_bush > 0.9


@pytest.mark.parametrize("scale", [0.5, 0.75])
def test_it_does_not_matter_where_on_the_scale_a_detector_puts_its_scores(scale):
    """Scores of .45 for what is true and of .3 for what is not are as good as .9 and .6."""
    on_bush, on_cars, _ = follow(lambda kind, rng: scale * told_by_score(kind, rng))
    assert on_bush == 0.0
    assert on_cars > 3.0


def test_scores_that_mean_nothing_take_no_vehicle():
    _, on_cars, _ = follow(meaningless)
    _, without, _ = follow(meaningless, NOT_ASKED)
    assert on_cars > without - 0.5


def test_what_always_stays_at_one_place_is_no_proof_that_its_scores_are_worth_something():
    """A spot on the lens of middling score, there from the start: it lasts longest of all."""
    on_spot, on_cars, _ = follow(told_by_score, until=0.0, seconds=15.0)
    assert on_spot == 0.0
    assert on_cars > 3.0


def test_where_all_scores_are_one_most_of_what_comes_and_goes_is_not_reported():
    """Three false boxes a scan, each somewhere else: a tenth at most may be taken for vehicles at once."""
    _, shown, tracker = follow(lambda kind, rng: 1.0, second=("two",), until=20.0)
    assert shown < 4.3
    assert tracker.sensor_states()["one"].clutter > 1.5


def test_a_saved_tracker_goes_on_with_what_it_learnt(tmp_path):
    _, _, tracker = follow(told_by_score, seconds=10.0, until=3.0)
    tracker.save(tmp_path / "state.npz")
    again = Tracker.load(tmp_path / "state.npz")
    for name in ("worth_mean", "worth_cov", "first_look"):
        np.testing.assert_array_equal(
            getattr(again.snapshot().scene, name), getattr(tracker.snapshot().scene, name)
        )


def flickering(least_move, speed=0.0, seen_by=("evt",), light=True):
    """Rows a scan in the last second of what an event camera finds all the time, and those in hindsight.

    Eight cars pass, which a camera sees too if there is light.
    """
    rng = np.random.default_rng(7)
    tracker = Tracker(load_config("highway", [f"lifecycle.least_move={least_move}", "smoother.engine=full"]))
    rows = []
    for k in range(300):
        t = 0.01 * k
        thing = [300.0 + speed * t, 200.0, 40.0, 30.0]
        cars = [[100.0 + 100.0 * i + 60.0 * t, 400.0 + 30.0 * i, 60.0, 25.0] for i in range(8)]
        for name in ("evt", "rgb"):
            boxes = [thing] * (name in seen_by) + (cars if light or name == "evt" else [])
            found = np.array(boxes).reshape(-1, 4) + rng.normal(0.0, 1.0, (len(boxes), 4))
            if name == "evt" or k % 5 == 0:
                table = tracker.step((t, name, found, np.full(len(found), 0.9)))
        rows.append((table.boxes[:, 1] < 300.0).sum())
    return np.mean(rows[-100:]), (tracker.finish().boxes[:, 1] < 300.0).sum()


def test_what_an_event_camera_alone_finds_at_one_place_all_the_time_is_no_vehicle():
    """It sees nothing that stands still, and the camera, which sees that, does not find it."""
    assert flickering(0.0)[0] > 0.9
    assert flickering(0.2) == (0.0, 0)


@pytest.mark.parametrize(
    "how",
    [{"speed": 30.0}, {"seen_by": ("evt", "rgb")}, {"light": False}],
    ids=lambda how: str(next(iter(how))),
)
def test_unless_it_moves_or_the_camera_sees_it_too_or_would_not(how):
    shown, smoothed = flickering(0.2, **how)
    assert shown > 0.9
    assert smoothed > 0


def test_scores_that_were_measured_are_believed_as_measured(state):
    """Of one sensor the precision by score is known, of the other not: a and b, and log odds of a box."""
    curve = "score_precision=[[0.2, 0.1], [0.8, 0.9]]"
    config = load_config(
        "default", ["sensors.one={rate_hz: 10}", f"sensors.one.{curve}", "sensors.two={rate_hz: 10}"]
    )
    tracker = Tracker(config, image=(1242, 375))
    worth = dict(zip(config.sensor_names, tracker._scene.worth_mean, strict=True))
    assert worth["one"].tolist() == [0.0, 1.0]
    half = config.lifecycle.worth_half
    assert worth["two"].tolist() == [np.log(half / (1.0 - half)), config.lifecycle.worth_slope]
    tracker.step((0.0, "one", [BUSH], [0.5]))  # a precision of one half
    tracker.step((0.01, "two", [BUSH + np.array([200.0, 0.0, 0.0, 0.0])], [0.5]))
    np.testing.assert_allclose(state(tracker)["score_odds"], [0.0, 0.0], rtol=0, atol=1e-12)
    tracker.step((0.1, "one", [BUSH + np.array([400.0, 0.0, 0.0, 0.0])], [0.95]))
    np.testing.assert_allclose(state(tracker)["score_odds"][-1], np.log(9.0), rtol=1e-12)
