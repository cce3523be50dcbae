"""Of a calibration only what does better on other recordings is kept."""

from dataclasses import replace

import pytest

from jeat_graph.calibration import parts as module
from jeat_graph.calibration.parts import PARTS, choose_parts, with_parts
from jeat_graph.calibration.supervised import calibrate
from jeat_graph.config.reading import load_config
from jeat_graph.runs.declaring import fit_input


@pytest.fixture(scope="module")
def base(recordings):
    return fit_input(load_config("default"), recordings[0][0])[0]


@pytest.fixture(scope="module")
def calibrated(recordings, base):
    return calibrate(recordings, base)


def test_all_parts_are_the_calibration_and_none_is_the_base(base, calibrated):
    assert with_parts(base, calibrated, PARTS) == calibrated
    none = with_parts(base, calibrated, ())
    assert (none.motion, none.size, none.birth) == (base.motion, base.size, base.birth)
    same = replace(none.sensors["rgb"], rate_hz=base.sensors["rgb"].rate_hz)
    assert same == base.sensors["rgb"]


def test_each_part_is_one_thing(base, calibrated):
    motion = with_parts(base, calibrated, ("motion",))
    assert motion.motion == calibrated.motion
    assert motion.sensors["rgb"].sigma_px == base.sensors["rgb"].sigma_px
    noise = with_parts(base, calibrated, ("noise of the centre",))
    assert noise.sensors["rgb"].sigma_px == calibrated.sensors["rgb"].sigma_px
    assert noise.sensors["rgb"].sigma_log_width == base.sensors["rgb"].sigma_log_width


def test_a_part_that_does_worse_on_the_other_half_goes_back_to_the_base(recordings, base, monkeypatch):
    def spoilt(pairs, start):
        config = calibrate(pairs, start)
        # A vehicle that turns up once in a million years: hardly a track is ever born.
        return replace(config, birth=replace(config.birth, arrival_rate_hz=1e-12, initial=1e-12))

    monkeypatch.setattr(module, "calibrate", spoilt)
    config, choices = choose_parts(recordings, base)
    assert config.birth == base.birth
    births = next(choice for choice in choices if choice.part == "births")
    assert not births.kept
    assert births.gain < -10.0


def test_the_gain_of_each_part_is_told(recordings, base):
    told = []
    _, choices = choose_parts(recordings, base, max_scans=200, progress=told.append)
    assert [choice.part for choice in choices] == list(PARTS) == told
