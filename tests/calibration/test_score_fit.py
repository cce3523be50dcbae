"""What the scores of detections say of the boxes of tracks, measured with truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.calibration import score_fit as module
from jeat_graph.calibration.score_fit import SCORE_FIT, choose_score_fit, measure_score_fit
from jeat_graph.calibration.verdict import Verdict
from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections
from jeat_graph.runs.declaring import fit_input
from jeat_graph.tracking.whole import track

GOOD, BAD = 0.8, 0.4


@pytest.fixture(scope="module")
def recordings(known):
    return [known.recording(seed, duration_s=8.0) for seed in (1, 2)]


@pytest.fixture(scope="module")
def base(recordings):
    return fit_input(load_config("default"), recordings[0][0])[0]


def with_ghosts(recordings, seed, low=BAD):
    """Below a third of the vehicles something goes with them that is none; its score is the lower one."""
    rng, out = np.random.default_rng(seed), []
    for detections, truth in recordings:
        every = detections.boxes
        times = np.repeat(detections.scan_t, np.diff(detections.scan_start))
        vehicles = np.flatnonzero(truth.object_id % 3 == 0)
        ghosts = truth.boxes[vehicles] + np.array([0.0, 55.0, 0.0, 0.0])
        ghosts[:, :2] += rng.normal(0.0, 1.0, (len(ghosts), 2))
        t = np.concatenate([times, truth.t[vehicles]])
        scores = np.concatenate([np.full(len(every), GOOD), np.full(len(ghosts), low)])
        boxes = np.concatenate([every, ghosts])
        out.append((Detections.from_rows(t, ["rgb"] * len(t), boxes, scores), truth))
    return out


def test_scores_of_what_does_not_fit_are_found_and_rows_with_them_left_out(recordings, base):
    """The ghosts are as steady as vehicles, so that only their scores tell."""
    seen = with_ghosts(recordings, 1)
    knots = np.array(measure_score_fit(base, seen).sensors["rgb"].score_fit)
    assert np.interp(BAD, *knots.T) < 0.2
    assert np.interp(GOOD, *knots.T) > 0.8
    config, choice = choose_score_fit(base, seen)
    assert choice is not None
    assert choice.part == SCORE_FIT
    assert choice.kept
    assert choice.gain > 1.0
    assert config.sensors["rgb"].score_fit
    assert config.sensors["rgb"] == replace(base.sensors["rgb"], score_fit=config.sensors["rgb"].score_fit)


def test_scores_that_say_nothing_hide_nothing(recordings, base):
    """Ghosts and vehicles have the same score."""
    seen = with_ghosts(recordings, 2, low=GOOD)
    config, choice = choose_score_fit(base, seen)
    assert choice is not None
    assert choice.gain == pytest.approx(0.0, abs=1e-9)
    for detections, _ in seen:
        assert len(track(config, detections)) == len(track(base, detections))


def test_what_loses_on_other_recordings_is_not_kept(recordings, base, monkeypatch):
    """Measured from recordings whose scores mean the opposite."""
    knots = ((BAD, 0.1), (GOOD, 0.2))
    wrong = replace(base, sensors={"rgb": replace(base.sensors["rgb"], score_fit=knots)})
    monkeypatch.setattr(module, "measure_score_fit", lambda config, recordings: wrong)
    config, choice = choose_score_fit(base, with_ghosts(recordings, 4))
    assert choice is not None
    assert not choice.kept
    assert choice.gain < -1.0
    assert config == base


def test_of_a_few_boxes_nothing_is_said(recordings, base):
    detections, truth = recordings[0]
    few = detections.select(["rgb"])
    cut = Detections.from_rows(
        np.repeat(few.scan_t, np.diff(few.scan_start))[:60], ["rgb"] * 60, few.boxes[:60], few.scores[:60]
    )
    assert measure_score_fit(base, [(cut, truth)]) == base


def test_a_sensor_that_saw_nothing_is_left_as_it_is(recordings, base):
    both = replace(base, sensors={**base.sensors, "evt": base.sensors["rgb"]})
    found = measure_score_fit(both, with_ghosts(recordings, 3))
    assert found.sensors["evt"] == both.sensors["evt"]
    assert found.sensors["rgb"].score_fit


@pytest.mark.parametrize(("loss", "kept"), [(0.3, True), (0.6, False)])
def test_what_loses_less_than_scenes_scatter_has_lost_nothing(recordings, base, monkeypatch, loss, kept):
    """Half of a handful of recordings is too little to say that scores mean nothing."""
    scores = iter((80.0, 80.0 - loss))

    def judged(configs, parts):
        each = np.full(2, next(scores))
        return Verdict(each, np.ones(2), np.arange(2), each, np.ones(2))

    monkeypatch.setattr(module, "judge", judged)
    monkeypatch.setattr(module, "scene_error", lambda recordings: 0.5)
    monkeypatch.setattr(module, "measure_score_fit", lambda config, recordings: config)
    choice = choose_score_fit(base, recordings)[1]
    assert choice is not None
    assert choice.kept == kept
    assert choice.gain == pytest.approx(-loss)
