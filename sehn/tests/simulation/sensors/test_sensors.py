"""The detectors: who is found, with what noise, scores, clutter and timing."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from jeat_graph.data.detections import Detections
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.sensors.clutter import ClutterConfig, draw_clutter
from jeat_graph_sehn.simulation.sensors.detectability import judge
from jeat_graph_sehn.simulation.sensors.detector import SensorModel, detect
from jeat_graph_sehn.simulation.sensors.noise import NoiseModel, persistent_noise, perturb
from jeat_graph_sehn.simulation.sensors.sequences import correlated, sticky_uniform
from jeat_graph_sehn.simulation.sensors.timing import TimingConfig, run_clock
from jeat_graph_sehn.simulation.simulate import record
from jeat_graph_sehn.simulation.world.scene import Scene
from jeat_graph_sehn.simulation.world.truth import Views, look

from .ap import iou_matrix

PICTURE = (1280.0, 720.0)


@cache
def views(name: str) -> Views:
    s = load_scenario(name)
    scene = Scene.build(3, 15.0, s.road, s.fleet, s.traffic, s.light, s.camera)
    return look(scene, np.arange(0.0, 15.0, 0.05), s.truth)


DARK, DAY = load_scenario("night-nolight"), load_scenario("day")


def test_the_event_camera_never_sees_what_is_parked() -> None:
    p = judge(views("day"), DAY.sensors["evt"].detect).p_detect
    assert views("day").parked.any()
    assert (p[views("day").parked] == 0.0).all()


def test_in_a_recording_no_event_box_but_clutter_lies_on_a_parked_vehicle() -> None:
    bare = {k: replace(m, clutter=ClutterConfig(per_scan=0.0)) for k, m in DAY.sensors.items()}
    road_empty = replace(DAY, sensors=bare, traffic=replace(DAY.traffic, vehicles_normal=0.0, parked=3))
    recording = record(road_empty, 4, 5.0)
    assert len(recording.detections.select(["rgb"])) > 200
    assert len(recording.detections.select(["evt"])) == 0


def test_blindness_follows_the_image_speed() -> None:
    model = replace(DAY.sensors["evt"].detect, p_max=1.0, half_size_px=0, half_visible=0, half_lux=0)
    speed = np.hypot(*views("day").motion[:, 2:4].T)
    expected = 1.0 - np.exp(-((speed / model.blind_speed) ** 2))
    assert judge(views("day"), model).p_detect == pytest.approx(expected)


def test_in_the_dark_the_rgb_camera_sees_mostly_what_is_near() -> None:
    p = judge(views("night-nolight"), DARK.sensors["rgb"].detect).p_detect
    moving = ~views("night-nolight").parked & ~views("night-nolight").ignore
    near, far = (
        moving & (views("night-nolight").distance < 40),
        moving & (views("night-nolight").distance > 110),
    )
    assert p[near].mean() > 0.7
    assert p[far].mean() < 0.45
    assert 0.15 < p[views("night-nolight").parked & ~views("night-nolight").ignore].mean() < 0.6


def test_by_day_nearly_every_free_vehicle_is_seen_by_the_rgb_camera() -> None:
    p = judge(views("day"), DAY.sensors["rgb"].detect).p_detect
    free = ~views("day").ignore & (views("day").visible > 0.9)
    assert p[free].mean() > 0.97


@pytest.mark.parametrize("cause", ["visible", "lux"])
def test_occlusion_and_darkness_lower_the_probability(cause: str) -> None:
    model = DARK.sensors["rgb"].detect
    low = judge(
        replace(views("night-nolight"), **{cause: getattr(views("night-nolight"), cause) * 0.5}), model
    ).p_detect
    before = judge(views("night-nolight"), model).p_detect
    assert (low <= before).all()
    assert (low < before).mean() > 0.95


def test_blur_in_the_dark_lowers_the_probability_and_raises_the_noise() -> None:
    model = DARK.sensors["rgb"].detect
    sharp = judge(views("night-nolight"), replace(model, exposure_s=0.0))
    blurred = judge(views("night-nolight"), replace(model, exposure_s=0.1))
    moving = (np.hypot(*views("night-nolight").motion[:, 2:4].T) > 50.0) & (
        views("night-nolight").visible > 0.1
    )
    assert (blurred.p_detect[moving] < sharp.p_detect[moving]).all()
    noise, zero = NoiseModel(outlier_probability=0.0), np.zeros((len(views("night-nolight")), 4))
    error = [
        perturb(np.random.default_rng(0), views("night-nolight").boxes, zero, c, noise)[1][moving].mean()
        for c in (sharp, blurred)
    ]
    assert error[1] > 1.2 * error[0]


def test_noise_of_the_centre_has_the_configured_size() -> None:
    model = NoiseModel(sigma_px=0.7, rho=0.03, outlier_probability=0.0, dark_factor=0.0, blur_factor=0.0)
    conditions = judge(views("day"), DAY.sensors["rgb"].detect)
    rng = np.random.default_rng(1)
    boxes, _ = perturb(rng, views("day").boxes, persistent_noise(rng, views("day"), model), conditions, model)
    true = views("day").boxes
    shift = (boxes[:, :2] + boxes[:, 2:] / 2) - (true[:, :2] + true[:, 2:] / 2)
    unit = shift / np.hypot(0.7, 0.03 * true[:, 2:])
    assert unit.std() == pytest.approx(1.0, abs=0.05)
    assert np.log(boxes[:, 2:] / true[:, 2:]).std() == pytest.approx(model.sigma_log_size, rel=0.05)


def test_correlated_noise_forgets_with_its_time_constant_and_starts_anew_with_each_object() -> None:
    objects, steps, dt, memory = 400, 50, 0.05, 0.2
    identity, t = np.tile(np.arange(objects), steps), np.repeat(dt * np.arange(steps), objects)
    x = correlated(np.random.default_rng(2), identity, t, memory, 1).reshape(steps, objects)
    assert x.var() == pytest.approx(1.0, abs=0.05)
    for lag in (1, 4):
        assert (x[lag:] * x[:-lag]).mean() == pytest.approx(np.exp(-lag * dt / memory), abs=0.04)
    assert abs(np.corrcoef(x[:, :-1].ravel(), x[:, 1:].ravel())[0, 1]) < 0.03


def test_hits_follow_a_two_state_markov_chain_with_the_right_share() -> None:
    objects, steps, dt, memory, p = 400, 100, 0.01, 0.04, 0.7
    identity, t = np.tile(np.arange(objects), steps), np.repeat(dt * np.arange(steps), objects)
    hit = sticky_uniform(np.random.default_rng(3), identity, t, memory).reshape(steps, objects) < p
    assert hit.mean() == pytest.approx(p, abs=0.02)
    keep = np.exp(-dt / memory)
    after_miss = (~hit[1:] & ~hit[:-1]).sum() / (~hit[:-1]).sum()
    assert after_miss == pytest.approx(keep + (1.0 - keep) * (1.0 - p), abs=0.02)


def test_independent_clutter_is_poisson() -> None:
    times = 0.01 * np.arange(20000)
    config = ClutterConfig(per_scan=0.8, persistent_share=0.0)
    scan, boxes = draw_clutter(np.random.default_rng(4), times, PICTURE, config)
    count = np.bincount(scan, minlength=len(times))
    assert count.mean() == pytest.approx(0.8, abs=4 * np.sqrt(0.8 / 20000))
    assert count.var() == pytest.approx(0.8, rel=0.06)
    centre = boxes[:, :2] + boxes[:, 2:] / 2
    assert np.histogram(centre[:, 0], 4, (0, 1280))[0] == pytest.approx(len(scan) / 4, rel=0.07)


def test_persistent_clutter_returns_to_the_same_places_at_the_configured_rate() -> None:
    times = 0.05 * np.arange(40000)
    config = ClutterConfig(per_scan=0.6, persistent_share=1.0, places=4, memory_s=0.5)
    scan, boxes = draw_clutter(np.random.default_rng(5), times, PICTURE, config)
    assert len(scan) / len(times) == pytest.approx(0.6, rel=0.07)
    # Boxes of one place overlap each other, so that four of them cover all.
    left, remaining = boxes, 0
    while len(left):
        left = left[iou_matrix(left, left[:1])[:, 0] < 0.3]
        remaining += 1
    assert remaining <= 6


def test_clutter_of_a_whole_sensor_follows_its_rate_on_an_empty_road() -> None:
    empty = replace(DAY, traffic=replace(DAY.traffic, vehicles_normal=0.0, parked=0))
    # Clutter that lasts makes the rate of one recording vary by 0.05, so the mean of several is taken.
    scans = [record(empty, seed, 60.0).detections.select(["evt"]) for seed in range(6)]
    rate = np.mean([len(detections) / detections.num_scans for detections in scans])
    assert rate == pytest.approx(DAY.sensors["evt"].clutter.per_scan, abs=0.06)


def test_scan_times_jitter_about_the_nominal_ones_and_stay_in_order() -> None:
    config = TimingConfig(rate_hz=100.0, jitter_s=0.001, drop_probability=0.1)
    clock = run_clock(np.random.default_rng(7), config, 200.0)
    error = clock.times - 0.01 * np.arange(20000)
    assert error[1:].std() == pytest.approx(0.001, rel=0.03)
    assert (np.diff(clock.times) > 0).all()
    assert clock.dropped.mean() == pytest.approx(0.1, abs=0.01)


def test_blank_scans_come_in_bursts_of_the_configured_share() -> None:
    config = TimingConfig(rate_hz=100.0, blank_rate_hz=0.2, blank_duration_s=0.15)
    clock = run_clock(np.random.default_rng(8), config, 3000.0)
    assert clock.blank.mean() == pytest.approx(0.03, rel=0.15)
    bursts = (np.diff(clock.blank.astype(int)) == 1).sum()
    assert clock.blank.sum() / bursts == pytest.approx(15.0, rel=0.15)


def test_blank_scans_arrive_without_boxes_and_dropped_ones_do_not_arrive() -> None:
    model = SensorModel(timing=TimingConfig(drop_probability=0.2, blank_rate_hz=0.5, blank_duration_s=0.3))
    clock = run_clock(np.random.default_rng(9), model.timing, 15.0)
    clock = replace(clock, times=views("day").times)
    found = detect(1, "rgb", clock, views("day"), PICTURE, model)
    assert np.array_equal(found.scan_t, clock.times[~clock.dropped])
    empty = np.diff(found.scan_start) == 0
    assert np.array_equal(empty, clock.blank[~clock.dropped])
    assert empty.any()


def matched_scores(detections: Detections, recording_truth: Views) -> tuple[np.ndarray, np.ndarray]:
    good = np.zeros(len(detections), dtype=bool)
    for k in range(detections.num_scans):
        rows = slice(*detections.scan_start[k : k + 2])
        truth = recording_truth.boxes[recording_truth.frame == k]
        if len(truth):
            good[rows] = iou_matrix(detections.boxes[rows], truth).max(axis=1, initial=0.0) > 0.5
    return detections.scores[good], detections.scores[~good]


def test_scores_of_true_boxes_are_higher_than_those_of_false_ones_but_overlap_them() -> None:
    model = DARK.sensors["rgb"]
    model = replace(model, timing=replace(model.timing, drop_probability=0.0))
    clock = replace(
        run_clock(np.random.default_rng(0), model.timing, 15.0), times=views("night-nolight").times
    )
    true, false = matched_scores(
        detect(2, "rgb", clock, views("night-nolight"), PICTURE, model), views("night-nolight")
    )
    assert len(false) > 50
    assert np.median(true) > np.median(false) + 0.1
    assert np.percentile(false, 80) > np.percentile(true, 20)
