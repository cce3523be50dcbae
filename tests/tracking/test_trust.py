"""Sensors that nobody declared: believed as far as the others bear them out."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.kernel_form import kernel_model
from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections
from jeat_graph.runs.declaring import fit_input
from jeat_graph.tracking.tracker import Tracker

RATE_HZ = 10.0
STEPS = 300
GHOSTS = ((900.0, 500.0, 60.0, 40.0), (500.0, 600.0, 50.0, 40.0), (200.0, 520.0, 70.0, 50.0))


def follow(sensors, overrides=(), false=("poor",)):
    """Track three cars seen by all sensors; those in `false` also see three things that are none."""
    rng = np.random.default_rng(3)
    names = {name: {"rate_hz": RATE_HZ} for name in sensors}
    declared = [f"sensors.{name}={{rate_hz: {RATE_HZ}}}" for name in names]
    tracker = Tracker(load_config("default", [*declared, "smoother.engine=none", *overrides]))
    reported = []
    for k in range(STEPS):
        t = k / RATE_HZ
        x = 100.0 + 30.0 * (t % 30.0)
        cars = np.array([[x, y, 60.0, 40.0] for y in (100.0, 220.0, 340.0)])
        scans = []
        for name in sensors:
            seen = cars[rng.random(3) < 0.9]
            if name in false:
                seen = np.concatenate([seen, np.array(GHOSTS)[rng.random(3) < 0.8]])
            noisy = seen + rng.normal(0.0, 1.0, seen.shape)
            scans.append((t, name, noisy, np.full(len(noisy), 0.8)))
        reported.append(tracker.step(scans))
    return tracker, reported


def false_rows(reported, since=STEPS // 2):
    return sum(int((table.boxes[:, 1] > 450.0).sum()) for table in reported[since:])


def trust(tracker):
    return dict(zip(tracker.sensor_names, tracker.snapshot().scene.trust.tolist(), strict=True))


def test_a_sensor_that_is_alone_where_another_looks_loses_its_weight():
    tracker, reported = follow(("good", "poor"))
    found = trust(tracker)
    assert found["good"] > 0.8
    assert found["poor"] < 0.2
    assert false_rows(reported) == 0


def test_without_regard_to_disagreement_what_it_sees_alone_is_reported():
    _, reported = follow(("good", "poor"), ["lifecycle.disagreement=0"])
    assert false_rows(reported) > 100


def test_cars_are_reported_all_the_same():
    _, reported = follow(("good", "poor"))
    assert np.mean([np.sum(table.boxes[:, 1] < 450.0) for table in reported[STEPS // 2 :]]) > 2.5


def test_two_good_sensors_are_not_disturbed_by_a_third():
    tracker, reported = follow(("good", "other", "poor"))
    found = trust(tracker)
    assert min(found["good"], found["other"]) > 0.8 > found["poor"]
    assert false_rows(reported) < 0.05 * len(GHOSTS) * STEPS / 2


def test_of_two_poor_sensors_each_is_believed_so_far_that_cars_live():
    """Each sees things that are none, at places of its own, and misses half of the cars."""
    rng = np.random.default_rng(7)
    declared = [f"sensors.{name}={{rate_hz: {RATE_HZ}}}" for name in ("one", "other")]
    tracker = Tracker(load_config("default", [*declared, "smoother.engine=none"]))
    places = {name: rng.uniform((0, 420, 40, 30), (1150, 640, 80, 60), (6, 4)) for name in ("one", "other")}
    cars_shown = 0
    for k in range(2 * STEPS):
        t = k / RATE_HZ
        cars = np.array([[100.0 + 30.0 * (t % 30.0), y, 60.0, 40.0] for y in (60.0, 150.0, 240.0, 330.0)])
        scans = []
        for name, ghosts in places.items():
            seen = np.concatenate([cars[rng.random(4) < 0.5], ghosts[rng.random(6) < 0.6]])
            scores = rng.uniform(0.4, 0.95, len(seen))
            scans.append((t, name, seen + rng.normal(0.0, 1.0, seen.shape), scores))
        table = tracker.step(scans)
        if k >= STEPS:
            cars_shown += int((table.boxes[:, 1] < 400.0).sum())
    assert cars_shown / STEPS > 2.5


def alone_with_two_of_three(score_of, seconds=60.0):
    """Track three cars that one sensor sees, of which another sees but one, always the same.

    `score_of(rng)` gives a score of the former. Returns the trust in it and how many cars are reported.
    """
    rng = np.random.default_rng(5)
    declared = [f"sensors.{name}={{rate_hz: {RATE_HZ}}}" for name in ("all", "some")]
    tracker = Tracker(load_config("default", [*declared, "smoother.engine=none"]))
    reported = []
    for k in range(int(seconds * RATE_HZ)):
        t = k / RATE_HZ
        cars = np.array([[100.0 + 30.0 * (t % 30.0), y, 60.0, 40.0] for y in (100.0, 220.0, 340.0)])
        noisy = [cars + rng.normal(0.0, 1.0, cars.shape), cars[:1] + rng.normal(0.0, 1.0, (1, 4))]
        scores = [np.array([score_of(rng) for _ in cars]), np.array([0.8])]
        scans = [(t, name, b, s) for name, b, s in zip(("all", "some"), noisy, scores, strict=True)]
        reported.append(len(tracker.step(scans)))
    return trust(tracker)["all"], np.mean(reported[len(reported) // 2 :])


def test_a_sensor_that_sees_little_takes_no_trust_from_one_that_sees_all():
    """What the good one alone sees has scores like those of what both see: it is the other that misses it."""
    believed, cars = alone_with_two_of_three(lambda rng: rng.uniform(0.6, 0.99))
    assert believed > 0.2
    assert cars > 2.8


def test_where_all_scores_are_one_nothing_tells_whose_fault_it_is():
    believed, _ = alone_with_two_of_three(lambda rng: 1.0)
    assert believed < 0.1


def alone(false_per_s: float, repeats: int) -> tuple[float, float]:
    """Trust in the only sensor, which sees cars pass, and the share of its repeated boxes that were in vain.

    Boxes of nothing come as often as asked, each so many scans in a row at one place.
    """
    rng = np.random.default_rng(5)
    tracker = Tracker(
        load_config("default", [f"sensors.only={{rate_hz: {RATE_HZ}}}", "smoother.engine=none"])
    )
    ghosts: list[tuple[int, np.ndarray]] = []
    for k in range(600):
        t = k / RATE_HZ
        cars = np.array(
            [[100.0 + 60.0 * ((t + 5.0 * n) % 15.0), 60.0 + 70.0 * n, 60.0, 40.0] for n in range(3)]
        )
        ghosts = [(left - 1, box) for left, box in ghosts if left > 1]
        if rng.random() < false_per_s / RATE_HZ:
            ghosts.append((repeats, np.array([rng.uniform(50, 1150), rng.uniform(300, 650), 60.0, 40.0])))
        boxes = np.concatenate([cars, *([box[None] for _, box in ghosts] or [cars[:0]])])
        noisy = boxes + rng.normal(0.0, 1.0, boxes.shape)
        tracker.step((t, "only", noisy, np.full(len(noisy), 0.8)))
    vain = tracker.snapshot().scene.vain[tracker.sensor_names.index("only")]
    return trust(tracker)["only"], float(vain)


def test_a_sensor_alone_is_believed_in_full_where_nothing_comes_again_in_vain():
    assert alone(0.0, 1)[0] > 0.85
    # Of false boxes that come once each a few lie where another has been by chance.
    assert alone(5.0, 1)[0] > 1.2 * alone(2.0, 3)[0]


def test_a_sensor_alone_is_believed_no_more_than_before_where_much_comes_again_in_vain():
    lifecycle = load_config("default").lifecycle
    believed, vain = alone(2.0, 3)
    assert vain > lifecycle.usual_vain
    assert believed == pytest.approx(lifecycle.agreement_prior**lifecycle.disagreement)


def found_by_a_poor_sensor(p_detect: float) -> tuple[float, float]:
    """Share of the time for which cars are reported that one sensor sees so often, and trust in it.

    In the second half of 30 s; false boxes come, one in thirty of them again for a second.
    """
    rng = np.random.default_rng(11)
    tracker = Tracker(
        load_config("default", [f"sensors.only={{rate_hz: {RATE_HZ}}}", "smoother.engine=none"])
    )
    ghosts: list[tuple[float, np.ndarray]] = []
    reported, steps = 0, int(30 * RATE_HZ)
    for k in range(steps):
        t = k / RATE_HZ
        cars = np.array(
            [[100.0 + 60.0 * ((t + 3.0 * n) % 15.0), 60.0 + 70.0 * n, 60.0, 40.0] for n in range(5)]
        )
        ghosts = [(end, box) for end, box in ghosts if end > t]
        for _ in range(rng.poisson(2.0)):
            end = t + (1.0 if rng.random() < 0.03 else 0.5 / RATE_HZ)
            ghosts.append((end, np.array([rng.uniform(50, 1150), rng.uniform(420, 650), 60.0, 40.0])))
        seen = cars[rng.random(len(cars)) < p_detect]
        boxes = np.concatenate([seen, *([box[None] for _, box in ghosts] or [cars[:0]])])
        noisy = boxes + rng.normal(0.0, 3.0, boxes.shape)
        odds = rng.normal(np.where(np.arange(len(noisy)) < len(seen), 0.8, -1.0), 1.0)
        table = tracker.step((t, "only", noisy, 1.0 / (1.0 + np.exp(-odds))))
        if k >= steps // 2:
            # Cars are in the upper half of the picture, false boxes in the lower one.
            reported += min(int(np.sum(table.boxes[:, 1] + 20.0 < 400.0)), len(cars))
    return reported / (steps - steps // 2) / 5.0, trust(tracker)["only"]


def test_cars_that_a_sensor_alone_finds_less_than_every_other_time_are_tracked_on():
    """What misses take from a vehicle, hits must bring: else all end, which says that all was in vain."""
    share, believed = found_by_a_poor_sensor(0.4)
    assert share > 0.4
    assert believed > 1.2 * load_config("default").lifecycle.agreement_prior ** 12.0


def test_of_a_sensor_that_falls_silent_the_other_is_not_judged_anew():
    tracker, _ = follow(("good", "other"), false=())
    before = trust(tracker)["good"]
    for k in range(STEPS, STEPS + 100):
        tracker.step((k / RATE_HZ, "good", np.array([[600.0, 300.0, 60.0, 40.0]]), np.array([0.8])))
    assert trust(tracker)["good"] > 0.8 * before


def test_a_sensor_may_be_believed_whatever_the_others_say():
    tracker, _ = follow(("good", "poor"), ["sensors.poor.disagreement=0"])
    assert trust(tracker)["poor"] == 1.0


def test_sensors_that_highway_does_not_know_have_to_earn_their_trust():
    """Its own two do not: in the dark only one of them sees."""
    rng = np.random.default_rng(0)
    t = np.repeat(np.arange(20) / 10.0, 3)
    names = np.tile(["rgb", "evt", "third"], 20)
    seen = Detections.from_rows(t, names, rng.uniform(50.0, 90.0, (60, 4)), np.full(60, 0.9))
    config, _ = fit_input(load_config("highway", ("input.undeclared=declare",)), seen)
    prior = dict(zip(config.sensor_names, kernel_model(config).sensors.prior_trust, strict=True))
    assert prior["rgb"] == prior["evt"] == 1.0
    assert prior["third"] == pytest.approx(0.91**12)
