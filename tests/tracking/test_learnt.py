"""What one recording taught of the sensors, taken along to the next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.calibration.learning import learn_sensors
from jeat_graph.config.learnt import LearntConfig
from jeat_graph.config.reading import config_from_dict, config_to_dict, load_config
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import ConfigError
from jeat_graph.tracking.learnt import learnt_of
from jeat_graph.tracking.tracker import Tracker

RATE_HZ = 10.0
# Where one of the sensors takes three things for cars that are none, and no car drives.
POSTS = ((900.0, 500.0, 60.0, 40.0), (500.0, 600.0, 50.0, 40.0), (200.0, 520.0, 70.0, 50.0))
POSTS_Y = 450.0


def street(seconds, seed, sensors=("good", "poor")):
    """Three cars that all sensors see, and posts that `poor` sees too."""
    rng, t, name, boxes = np.random.default_rng(seed), [], [], []
    for k in range(int(seconds * RATE_HZ)):
        x = 100.0 + 30.0 * k / RATE_HZ
        cars = np.array([[x, y, 60.0, 40.0] for y in (100.0, 220.0, 340.0)])
        for sensor in sensors:
            seen = cars[rng.random(3) < 0.9]
            if sensor == "poor":
                seen = np.concatenate([seen, np.array(POSTS)[rng.random(3) < 0.8]])
            boxes.append(seen + rng.normal(0.0, 1.0, seen.shape))
            t.append(np.full(len(seen), k / RATE_HZ))
            name.append(np.full(len(seen), sensor))
    scores = rng.uniform(0.6, 0.9, sum(map(len, boxes)))
    return Detections.from_rows(np.concatenate(t), np.concatenate(name), np.concatenate(boxes), scores)


def settings(*overrides, sensors=("good", "poor")):
    declared = [f"sensors.{name}={{rate_hz: {RATE_HZ}}}" for name in sensors]
    config = load_config("default", [*declared, "smoother.engine=none", "image.width=1280", *overrides])
    return replace(config, sensors={name: config.sensors[name] for name in sensors})


def tracked(config, recording):
    """The tracker after a recording, and how many rows were written where no car drives."""
    tracker = Tracker(config)
    return tracker, sum(int((table.boxes[:, 1] > POSTS_Y).sum()) for table in tracker.run(recording))


@pytest.fixture(scope="module")
def before():
    return tracked(settings(), street(30.0, 0))[0]


def beginning_with(config, learnt):
    return replace(config, sensors={k: replace(s, learnt=learnt.get(k)) for k, s in config.sensors.items()})


def test_the_next_tracker_believes_its_sensors_as_the_last_one_did(before):
    after = Tracker(beginning_with(settings(), before.learnt()))
    old, new = before.snapshot().scene, after.snapshot().scene
    for name in ("worth_mean", "worth_cov", "lasting_odds", "lasting_seen", "vain", "vain_seen"):
        np.testing.assert_allclose(getattr(new, name), getattr(old, name), rtol=1e-12)
    for name in ("agreed_odds", "borne_out", "trust"):
        np.testing.assert_allclose(getattr(new, name), getattr(old, name), rtol=1e-12)
    # Both look at all of the picture, so that no claim of any strip is left out.
    for column in old.claims.dtype.names:
        total = old.claims[column].sum(axis=1)
        np.testing.assert_allclose(new.claims[column].sum(axis=1), total, rtol=0.05, atol=1e-9)


def test_what_it_has_learnt_of_the_scene_stays_behind(before):
    after = Tracker(beginning_with(settings(), before.learnt()))
    cold, new = Tracker(settings()).snapshot().scene, after.snapshot().scene
    for name in ("usual_jerk", "usual_resizing", "gap_share", "p_detect", "clutter", "field", "first_look"):
        np.testing.assert_array_equal(getattr(new, name), getattr(cold, name))


def test_fewer_false_things_that_the_last_recording_unmasked_are_reported_in_a_short_one():
    taught = learn_sensors([street(30.0, 0)], settings())
    short = [street(4.0, seed) for seed in (7, 8, 9)]
    cold, warm = (sum(tracked(config, one)[1] for one in short) for config in (settings(), taught))
    assert cold > 40
    assert warm < cold / 2


def test_several_recordings_teach_more_than_one():
    one = learn_sensors([street(10.0, 0)], settings()).sensors["poor"].learnt
    two = learn_sensors([street(10.0, 0), street(10.0, 1)], settings()).sensors["poor"].learnt
    assert two.lonely_s > 1.5 * one.lonely_s
    assert two.trust < one.trust


def test_a_sensor_that_never_looked_has_learnt_nothing():
    known = learn_sensors([street(5.0, 0, ("good",))], settings())
    assert known.sensors["good"].learnt is not None
    assert known.sensors["poor"].learnt is None


def test_presets_that_do_not_learn_their_sensors_stay_as_they_are():
    config = load_config("highway")
    recording = street(5.0, 0, ("rgb",))
    assert learn_sensors([recording], config) == config


def test_what_is_known_of_a_sensor_that_is_not_there_is_left_out(before):
    known = before.learnt()
    assert dict(known["good"].agreed_without) == {}
    third = replace(known["good"], agreed_without=(("away", 3.0), ("poor", 2.0)))
    scene = Tracker(beginning_with(settings(), {"good": third})).snapshot().scene
    np.testing.assert_array_equal(scene.agreed_without, [[0.0, 2.0], [0.0, 0.0]])


def test_it_is_written_and_read_back(before):
    config = beginning_with(settings(), before.learnt())
    assert config_from_dict(config_to_dict(config)) == config


def test_a_share_of_what_is_known_lies_between_all_of_it_and_nothing(before):
    known, std = before.learnt()["good"], 1.0
    every = known.counting_for(1.0, std)
    np.testing.assert_allclose(every.worth_cov, known.worth_cov, rtol=1e-9)
    nothing = known.counting_for(0.0, std)
    np.testing.assert_allclose(nothing.worth_cov, (std**2, 0.0, std**2), atol=1e-12)
    assert nothing.agreed_s == nothing.lasting_s == 0.0
    # Two independent witnesses who know a half each know all together, the prior counted once.
    half = known.counting_for(0.5, std)
    a, ab, b = half.worth_cov
    information = 2.0 * np.linalg.inv([[a, ab], [ab, b]]) - np.eye(2) / std**2
    a, ab, b = known.worth_cov
    np.testing.assert_allclose(np.linalg.inv(information), [[a, ab], [ab, b]], rtol=1e-6, atol=1e-9)
    assert half.agreed_s == pytest.approx(known.agreed_s / 2)
    assert half.worth == known.worth


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"worth": [0.0, -1.0]}, "sensors.rgb.learnt.worth: the slope"),
        ({"worth_cov": [1.0, 2.0, 1.0]}, "sensors.rgb.learnt.worth_cov"),
        ({"agreed_s": 1.0, "agreed_high_s": 2.0}, "sensors.rgb.learnt.agreed_high_s"),
        ({"lonely_high_s": 2.0}, "sensors.rgb.learnt.lonely_high_s"),
        ({"agreed_without": [["evt", -1.0]]}, "sensors.rgb.learnt.agreed_without"),
        ({"trust": 0.0}, "sensors.rgb.learnt.trust"),
        ({"vane": 0.1}, "did you mean sensors.rgb.learnt.vain"),
        (3, "sensors.rgb.learnt"),
    ],
)
def test_what_cannot_have_been_learnt_is_refused(change, message):
    with pytest.raises(ConfigError, match=message.replace(".", r"\.")):
        config_from_dict({"sensors": {"rgb": {"learnt": change}}})


def test_nothing_learnt_is_the_default():
    assert load_config("default").sensors["rgb"].learnt is None
    assert LearntConfig().trust == 1.0


@pytest.mark.parametrize("score", [0.9, 0.37])
@pytest.mark.parametrize("sensors", [("rgb",), ("rgb", "thermal")])
def test_scores_that_are_all_alike_are_learnt_without_spread(score, sensors):
    rng = np.random.default_rng(0)
    tracker = Tracker("default", image=(1280, 720))
    for k in range(300):
        left = (np.arange(6) * 200.0 + (60.0 + 10.0 * np.arange(6)) * k / 20.0) % 1200.0
        boxes = np.column_stack([left, 100.0 * np.arange(6) + 20.0, np.full(6, 80.0), np.full(6, 50.0)])
        noisy = boxes + 2.0 * rng.standard_normal(boxes.shape)
        tracker.step([Scan(k / 20.0, name, noisy, np.full(6, score)) for name in sensors])
    learnt = tracker.learnt()  # settings closer to 0 than any of theirs may be were refused
    for name in sensors:
        assert abs(learnt[name].score_spread) < 1e-6
    # What rounding left of nothing.
    scene = tracker._scene
    scene.claims["score_spread"][:] = 1.69e-30
    scene.claims["score_kept"][:] = -3.0e-20
    assert learnt_of(scene, tracker.config)["rgb"].score_spread == 0.0
