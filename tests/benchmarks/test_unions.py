"""Drawn detectors are what their parameters say; a union is judged beside the best of its detectors."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.drawn_detectors import SECOND, THIRD, WAYS, Draw, drawn_parameters, with_drawn_detectors
from benchmarks.judging import HEADLINE
from benchmarks.recordings import JudgedRecording
from benchmarks.unions import ALL, OWN_SECOND, OWN_THIRD, UNIONS, UnionJob, fails, judge_draw, tables
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth

PLAIN = Draw("still", seed=3, jitter=0.01, bias=0.0, wander=0.0, junk=0, shared=0.0, p=1.0)
FRAMES, RATE = 200, 20.0


def recording(objects=12):
    """Objects side by side, half of them twice as large, seen by `cam` as they are."""
    t = np.repeat(np.arange(FRAMES) / RATE, objects)
    which = np.tile(np.arange(objects), FRAMES)
    size = np.where(which % 2, 40.0, 80.0)
    boxes = np.column_stack([100.0 * which + t, np.full(len(t), 200.0), size, 0.8 * size])
    detections = Detections.from_rows(t, np.full(len(t), "cam"), boxes, np.full(len(t), 0.9))
    return JudgedRecording("drawn", detections, GroundTruth(t, which, boxes, None, np.zeros(len(t), bool)))


def errors(draw):
    """(frames, objects, 4): how far `third`'s boxes lie off, in sizes and log size; every object is seen."""
    one = recording()
    seen = with_drawn_detectors(one, draw).detections.select(THIRD).boxes.reshape(FRAMES, -1, 4)
    true = one.truth.boxes.reshape(FRAMES, -1, 4)
    centre = (seen[..., :2] + 0.5 * seen[..., 2:] - true[..., :2] - 0.5 * true[..., 2:]) / true[..., 2:]
    return np.concatenate([centre, np.log(seen[..., 2:] / true[..., 2:])], axis=-1)


def test_thirds_errors_are_a_jitter_a_bias_and_one_that_wanders():
    jitter = errors(PLAIN)
    assert jitter[..., :2].std() == pytest.approx(0.01, rel=0.05)
    assert jitter[..., 2:].mean() == pytest.approx(-0.08, abs=0.001)
    biased = errors(PLAIN._replace(bias=0.2))
    lasting = biased.mean(axis=0)
    assert lasting.std() == pytest.approx(0.2, rel=0.4)  # 48 numbers: 10 % each standard error
    assert (biased - lasting).std() == pytest.approx(0.01, rel=0.05)
    wander = errors(PLAIN._replace(wander=0.1, jitter=0.005))
    step = round(0.8 * RATE)  # after the time constant, 1/e of it is left
    now, later = wander[:-step, :, :2].ravel(), wander[step:, :, :2].ravel()
    assert np.corrcoef(now, later)[0, 1] == pytest.approx(np.exp(-1.0), abs=0.2)


@pytest.mark.parametrize("way", ["near", "far"])
def test_a_third_that_sees_half_sees_that_half(way):
    draw = PLAIN._replace(way=way)
    boxes = with_drawn_detectors(recording(), draw).detections.select(THIRD).boxes
    assert len(boxes) == FRAMES * 6
    assert ((boxes[:, 2] > 60.0) == (way == "near")).all()


@pytest.mark.parametrize("way", ["still", "moving"])
def test_false_things_stay_or_move_as_drawn(way):
    draw = PLAIN._replace(way=way, p=0.0, junk=4, jitter=1e-6)
    seen = with_drawn_detectors(recording(), draw).detections.select(THIRD)
    still = np.unique(seen.boxes.round(1), axis=0)
    assert (len(still) <= 4) == (way == "still")


def test_second_is_an_ordinary_detector():
    seen = with_drawn_detectors(recording(), PLAIN).detections.select(SECOND)
    # P_D 0.8 of 12 objects, and three false things seen at 0.7.
    assert len(seen) / FRAMES == pytest.approx(0.8 * 12 + 0.7 * 3, rel=0.05)


def test_parameters_of_a_draw_are_the_same_each_time_and_cover_their_range():
    drawn = [drawn_parameters("one", k) for k in range(200)]
    assert drawn == [drawn_parameters("one", k) for k in range(200)]
    assert {one.way for one in drawn} == set(WAYS)
    for name, least, most in (("jitter", 0.005, 0.05), ("bias", 0.0, 0.25), ("p", 0.2, 0.9)):
        values = np.array([getattr(one, name) for one in drawn])
        assert least <= values.min() < least + 0.1 * (most - least)
        assert most >= values.max() > most - 0.1 * (most - least)


def test_a_union_is_judged_beside_the_best_alone():
    found = judge_draw(UnionJob(recording(), 0))
    assert set(found["unions"]) == {OWN_SECOND, OWN_THIRD, ALL}
    assert {one["best"] for one in found["unions"].values()} == {"cam"}  # it sees everything as it is
    assert all(one["anees"] > 0.0 for one in found["unions"].values())
    shown = {key: table.render("text") for key, table in tables({"draws": [found]}).items()}
    assert OWN_THIRD in shown["unions"]
    assert found["way"] in shown["unions-ways"]


@pytest.mark.parametrize(
    ("bias", "worst", "failed"), [(0.05, -2.0, True), (0.2, -2.0, False), (0.2, -5.0, True)]
)
def test_a_third_that_is_off_may_cost_more(bias, worst, failed):
    draw = {"bias": bias, "unions": {OWN_THIRD: {"gain": {"MOTA": worst, "IDF1": 1.0}}}}
    assert fails(draw, OWN_THIRD) == failed


def test_a_table_says_how_many_unions_are_honest_about_their_positions():
    gain = dict.fromkeys(HEADLINE, 0.0)
    draws = [
        {"bias": 0.0, "way": "still", "unions": {key: {"gain": gain, "anees": anees} for key in UNIONS}}
        for anees in (0.6, 1.0, 1.4, 3.0)
    ]
    header, first, *_ = tables({"draws": draws})["unions"].render("csv").splitlines()
    shown = dict(zip(header.split(","), first.split(","), strict=True))
    assert (float(shown["ANEES (median)"]), float(shown["ANEES 0.7 to 1.5 (%)"])) == (1.2, 50.0)
