"""Few scans a second: tracking goes by their times, and the rate that is declared changes nothing."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from pandas import concat

from jeat_graph import Detections, GroundTruth, Tracker, Trajectories, evaluate, load_config, track
from jeat_graph.cli.main import main

from .road import IMAGE, LANES, truth_of

DURATION_S, NOISE_PX, FOUND = 36.0, 2.0, 0.91


def highway(rate_hz: float, seed: int) -> tuple[Detections, GroundTruth]:
    """Four lanes that one camera sees, with misses and noise, and the truth."""
    rng = np.random.default_rng(seed)
    vehicles = []
    for top, speed in LANES:
        t = rng.uniform(1.0, 2.5)
        while t < DURATION_S:
            width = rng.uniform(80.0, 130.0)
            vehicles.append((t, top, width, speed * rng.uniform(0.93, 1.07)))
            t += rng.uniform(1.0, 2.5)
    times = np.arange(0.0, DURATION_S, 1.0 / rate_hz)
    true, seen = [], []
    for t in times:
        seen.append((t, np.nan, np.nan, np.nan, np.nan, np.nan))
        for k, (begin, top, width, speed) in enumerate(vehicles):
            centre = speed * (t - begin) + (-width / 2 if speed > 0 else IMAGE[0] + width / 2)
            low, high = max(centre - width / 2, 0.0), min(centre + width / 2, IMAGE[0])
            if t < begin or high - low < 10.0:
                continue
            box = np.array([low, top, high - low, 0.6 * width])
            true.append((t, k, *box))
            if rng.random() < FOUND:
                box = box + NOISE_PX * rng.standard_normal(4)
                seen.append((t, *box, np.clip(rng.normal(0.72, 0.12), 0.05, 1.0)))
    d = np.array(seen)
    none = np.isnan(d[:, 1])
    detections = Detections.from_rows(d[:, 0], ["rgb"] * len(d), d[:, 1:5], d[:, 5], none)
    return detections, truth_of(true, times)


def step_by_step(detections: Detections, *overrides: str) -> Trajectories:
    tracker = Tracker(load_config("default", overrides), image=IMAGE)
    return Trajectories.concatenate(list(tracker.run(detections)))


def mota(tracks: Trajectories, truth: GroundTruth) -> float:
    return evaluate(tracks, truth)["causal"]["MOTA"]


@pytest.mark.parametrize("rate_hz", [1.5, 5.0, 10.0])
def test_the_declared_rate_changes_no_track(rate_hz):
    detections, _ = highway(rate_hz, 0)
    told = step_by_step(detections, f"sensors.rgb.rate_hz={rate_hz}")
    for other in (step_by_step(detections), track(detections, image=IMAGE).causal):
        np.testing.assert_array_equal(other.t, told.t)
        np.testing.assert_array_equal(other.track_id, told.track_id)
        np.testing.assert_array_equal(other.boxes, told.boxes)


@pytest.mark.parametrize("seed", range(3))
def test_at_ten_scans_a_second_next_to_every_vehicle_is_followed(seed):
    """It drives two to four tenths of its length from one to the next."""
    detections, truth = highway(10.0, seed)
    assert mota(track(detections, image=IMAGE).causal, truth) > 90.0


def test_the_random_scores_of_a_sensor_that_is_alone_keep_their_weight():
    """Nothing else says what is real."""
    detections, truth = highway(10.0, 0)
    random = np.random.default_rng(0).uniform(0.05, 1.0, len(detections))
    tracks = track(replace(detections, scores=random), image=IMAGE)
    assert mota(tracks.causal, truth) > 90.0


@pytest.mark.parametrize(("rate_hz", "least"), [(1.5, 30.0), (2.0, 55.0), (5.0, 80.0)])
def test_with_few_scans_a_second_most_vehicles_are_followed(rate_hz, least):
    detections, truth = highway(rate_hz, 0)
    assert mota(track(detections, image=IMAGE).causal, truth) > least


def test_scores_that_are_all_low_are_named_and_the_setting_that_the_line_names_helps(tmp_path, capsys):
    detections, truth = highway(10.0, 0)
    table = detections.to_pandas()
    table["score"] = table["score"].where(table["score"].isna(), 0.3)
    table.to_csv(tmp_path / "low.csv", index=False)
    command = ["track", str(tmp_path / "low.csv"), "--image", "1280x720", "--out", str(tmp_path / "run")]
    assert main(command) == 0
    (setting,) = re.findall(
        r"if its boxes are real, set (sensors\.rgb\.even_score=\S+)", capsys.readouterr().err
    )
    low = replace(detections, scores=np.full(len(detections), 0.3))
    assert mota(track(low, image=IMAGE, config=load_config("default", [setting])).causal, truth) > 90.0


def test_the_sensor_is_named_whose_scores_are_low_in_whatever_order_they_come(tmp_path, capsys):
    """Another one scans first, and sees nothing."""
    detections, _ = highway(10.0, 0)
    table = detections.to_pandas()
    table["score"] = table["score"].where(table["score"].isna(), 0.3)
    table["sensor"] = "evt"
    table["t"] += 0.05
    empty = table.drop_duplicates("t").assign(sensor="rgb", left=None, top=None, width=None, height=None)
    empty = empty.assign(score=None, t=empty["t"] - 0.05)
    concat([empty, table]).sort_values("t").to_csv(tmp_path / "two.csv", index=False)
    command = ["track", str(tmp_path / "two.csv"), "--image", "1280x720", "--out", str(tmp_path / "run")]
    assert main(command) == 0
    assert "most scores of 'evt' are below" in capsys.readouterr().err
