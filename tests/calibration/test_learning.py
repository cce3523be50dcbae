"""What tracking taught of sensors is kept unless it loses on recordings that it was not learnt from."""

from __future__ import annotations

from dataclasses import replace

from jeat_graph.calibration import learning
from jeat_graph.calibration.learning import LEARNT, choose_learnt, without_learnt
from jeat_graph.calibration.parts import with_parts
from jeat_graph.calibration.rounding import rounded
from jeat_graph.calibration.supervised import measure_sensors
from jeat_graph.config.learnt import LearntConfig
from jeat_graph.config.reading import load_config
from jeat_graph.runs.declaring import fit_input


def fitted(recordings, preset="default"):
    return fit_input(load_config(preset), *(detections for detections, _ in recordings))[0]


def test_what_does_no_harm_is_kept(recordings):
    config, choice = choose_learnt(fitted(recordings), recordings)
    assert choice.part == LEARNT
    assert choice.kept
    assert choice.gain >= 0.0
    assert config.sensors["rgb"].learnt.lasting_s > 0.0


def test_what_makes_tracking_worse_is_not(recordings, monkeypatch):
    nothing_lasts = LearntConfig(worth=(-20.0, 0.0), worth_cov=(1e-6, 0.0, 1e-6))

    def taught_wrongly(_, config):
        known = {name: replace(s, learnt=nothing_lasts) for name, s in config.sensors.items()}
        return replace(config, sensors=known)

    monkeypatch.setattr(learning, "learn_sensors", taught_wrongly)
    base = fitted(recordings)
    config, choice = choose_learnt(base, recordings)
    assert not choice.kept
    assert choice.gain < -1.0
    assert config == base


def test_where_scores_mean_something_else_it_is_learnt_anew(recordings):
    base, _ = choose_learnt(fitted(recordings), recordings)
    measured = measure_sensors(recordings, base)
    assert with_parts(measured, ()).sensors["rgb"].learnt == base.sensors["rgb"].learnt
    assert with_parts(measured, ("reliability",)).sensors["rgb"].learnt is None


def test_where_nothing_is_learnt_nothing_is_decided(recordings):
    base = load_config("highway")
    assert choose_learnt(base, recordings) == (base, None)


def test_it_is_written_with_as_many_digits_as_all_else(recordings):
    config, _ = choose_learnt(fitted(recordings), recordings)
    known = rounded(config).sensors["rgb"].learnt
    assert known.lasting_s == float(f"{config.sensors['rgb'].learnt.lasting_s:.4g}")
    assert without_learnt(config) == fitted(recordings)
