"""Of a calibration only what does better on other recordings is kept."""

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.calibration import parts as module
from jeat_graph.calibration.cuts import cut_scans, cut_truth
from jeat_graph.calibration.parts import PARTS, choose_parts, with_parts
from jeat_graph.calibration.supervised import calibrate, measure_sensors, with_sensors
from jeat_graph.calibration.verdict import Verdict
from jeat_graph.config.reading import load_config
from jeat_graph.runs.declaring import fit_input


@pytest.fixture(scope="module")
def recordings(known):
    return [known.recording(seed, duration_s=10.0) for seed in (1, 2)]


@pytest.fixture(scope="module")
def base(recordings):
    return fit_input(load_config("default"), recordings[0][0])[0]


@pytest.fixture(scope="module")
def measured(recordings, base):
    return measure_sensors(recordings, base)


def test_all_parts_are_the_calibration_and_none_is_the_base(recordings, base, measured):
    assert with_parts(measured, PARTS) == calibrate(recordings, base)
    none = with_parts(measured, ())
    assert (none.motion, none.size, none.birth) == (base.motion, base.size, base.birth)
    same = replace(none.sensors["rgb"], rate_hz=base.sensors["rgb"].rate_hz)
    assert same == base.sensors["rgb"]


def test_noise_and_the_motion_fitted_to_it_stay_together(base, measured):
    centre = with_parts(measured, ("noise and motion",))
    assert centre.sensors["rgb"].sigma_px == measured.sensors["rgb"].sigma_px
    assert centre.motion != base.motion
    assert centre.sensors["rgb"].sigma_log_width == base.sensors["rgb"].sigma_log_width
    assert centre.size == base.size
    size = with_parts(measured, ("noise and growth of the size",))
    assert size.sensors["rgb"].sigma_px == base.sensors["rgb"].sigma_px
    assert size.motion == base.motion
    assert size.sensors["rgb"].sigma_log_width == measured.sensors["rgb"].sigma_log_width
    assert size.size != base.size


def test_fitted_motion_is_the_usual_one_and_calm_and_hard_ones_stay_beside_it(base, measured):
    motion = with_parts(measured, ("noise and motion",)).motion
    assert motion.jerk_per_size != base.motion.jerk_per_size
    assert motion.densities == base.motion.densities == 3
    assert (motion.calm_step, motion.manoeuvre_step) == (base.motion.calm_step, base.motion.manoeuvre_step)
    assert motion.first_odds == base.motion.first_odds
    assert motion.unseen_memory_s == base.motion.unseen_memory_s


def test_motion_is_estimated_for_the_size_noise_that_stays(measured, base):
    """The filter of the size tells how fast a vehicle comes near: how much of its motion is perspective."""
    mixed = {
        name: replace(
            s,
            sigma_log_width=base.sensors[name].sigma_log_width,
            sigma_log_height=base.sensors[name].sigma_log_height,
        )
        for name, s in measured.sensors.items()
    }
    centre = with_parts(measured, ("noise and motion", "reliability"))
    assert centre.motion == with_sensors(measured, mixed).motion


def test_a_part_that_does_worse_on_the_other_half_goes_back_to_the_base(recordings, base, monkeypatch):
    """And the gain of each part is told, in their order, as soon as it is known."""

    def spoilt(measured, parts):
        config = with_parts(measured, parts)
        if "births" not in parts:
            return config
        # A vehicle that turns up once in a million years: hardly a track is ever born.
        return replace(config, birth=replace(config.birth, arrival_rate_hz=1e-12, initial=1e-12))

    monkeypatch.setattr(module, "with_parts", spoilt)
    told = []
    config, choices = choose_parts(recordings, base, max_scans=100, progress=told.append)
    assert [choice.part for choice in choices] == list(PARTS) == told
    assert config.birth == base.birth
    births = next(choice for choice in choices if choice.part == "births")
    assert not births.kept
    assert births.gain < -10.0


def test_what_nothing_is_left_to_check_by_goes_back_to_the_base(recordings, base):
    """Six scans show some thirty vehicles, of which one can calibrate, and half of them too few."""
    detections, truth = recordings[0]
    few = cut_scans(detections, 0, 6), cut_truth(truth, -np.inf, float(detections.scan_t[5]))
    config, choices = choose_parts([few], base)
    assert [(choice.part, choice.kept, choice.gain) for choice in choices] == [(p, False, 0.0) for p in PARTS]
    assert (config.motion, config.size, config.birth) == (base.motion, base.size, base.birth)
    assert config.sensors["rgb"].sigma_px == base.sensors["rgb"].sigma_px


@pytest.mark.parametrize(
    ("scores", "kept", "gains"),
    [
        # All of them win over the base, and win more without the births.
        (
            {"": 50, "nsfrb": 60, "sfrb": 40, "nfrb": 55, "nsrb": 57, "nsfb": 52, "nsfr": 63},
            "nsfr",
            (20, 5, 3, 8, -3),
        ),
        # Together they lose; the reliability alone wins.
        ({"": 50, "nsfrb": 40, "n": 45, "s": 49, "f": 48, "r": 53, "rb": 52}, "r", (-5, -1, -2, 3, -1)),
    ],
)
def test_the_base_stays_but_for_what_wins(scores, kept, gains):
    def verdict(some):
        score = scores["".join("nsfrb"[k] for k, part in enumerate(PARTS) if part in some)]
        each = np.full(6, float(score))
        return Verdict(each, np.ones(6), np.arange(6) % 2, each, np.ones(6))

    found, choices = module._choose(verdict, lambda _: None)
    assert found == [part for k, part in enumerate(PARTS) if "nsfrb"[k] in kept]
    assert [choice.gain for choice in choices] == pytest.approx(list(gains))
    assert [choice.kept for choice in choices] == [part in found for part in PARTS]
