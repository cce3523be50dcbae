"""Judging on the road: errors that were put in come out, and a track is judged with all its rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.eval.road import RoadJudging, RoadRows, judge_road, judge_road_run

T = np.arange(0.0, 3.0, 0.05)


def _truth() -> RoadRows:
    values = [np.c_[np.full(len(T), x), 30.0 + 20.0 * T, np.full(len(T), 72.0)] for x in (0.0, 3.6)]
    return RoadRows(np.tile(T, 2), np.repeat([5, 6], len(T)), np.concatenate(values))


def _tracks(error: np.ndarray, var: float = 0.04) -> RoadRows:
    true = _truth()
    values = np.concatenate([true.values + error, np.full((len(true.t), 3), var)], axis=1)
    return RoadRows(true.t, true.identity + 100, values)


def test_errors_are_those_put_in() -> None:
    rng = np.random.default_rng(0)
    error = 0.2 * rng.standard_normal((2 * len(T), 3))
    scores = judge_road(_tracks(error), _truth(), RoadJudging()).scores()
    assert scores["along_rmse_m"] == pytest.approx(np.sqrt((error[:, 1] ** 2).mean()))
    assert scores["speed_rmse_kmh"] == pytest.approx(np.sqrt((error[:, 2] ** 2).mean()))
    assert scores["nees"] == pytest.approx((error[:, :2] ** 2 / 0.04).mean())
    assert scores["across_held"] == pytest.approx(100.0 * (np.abs(error[:, 0]) < 1.96 * 0.2).mean())
    assert scores["tracks"] == 2


def test_a_track_is_judged_with_its_worst_rows_too() -> None:
    error = np.zeros((2 * len(T), 3))
    error[:10, 1] = 30.0  # out of the gate for a sixth of its life
    scores = judge_road(_tracks(error), _truth(), RoadJudging()).scores()
    assert scores["along_rmse_m"] == pytest.approx(30.0 * np.sqrt(10 / (2 * len(T))))


def test_only_rows_within_the_range_count() -> None:
    scores = judge_road(_tracks(np.zeros((2 * len(T), 3))), _truth(), RoadJudging(near_m=40.0)).scores()
    assert scores["rows"] == 2 * int((30.0 + 20.0 * T >= 40.0).sum())


def test_a_track_at_no_vehicle_is_not_judged() -> None:
    error = np.zeros((2 * len(T), 3))
    error[:, 0] = 20.0
    assert judge_road(_tracks(error), _truth(), RoadJudging()).scores() == {"rows": 0, "tracks": 0}


def test_a_false_track_that_a_vehicle_drives_by_is_not_judged() -> None:
    """It stands for 0.7 s on a lane: the vehicle that passes is within 8 m of it for most of that."""
    true = _truth()
    t = np.arange(0.7, 1.4, 0.05)
    values = np.tile([0.0, 50.0, 0.0, 0.04, 0.04, 0.04], (len(t), 1))
    alone = RoadRows(t, np.full(len(t), 300), values)
    assert judge_road(alone, true, RoadJudging()).tracks == 1  # nothing else is at the vehicle
    tracks = _tracks(np.zeros((2 * len(T), 3)))
    both = RoadRows(
        *(np.concatenate(pair) for pair in zip(vars(tracks).values(), vars(alone).values(), strict=True))
    )
    found = judge_road(both, true, RoadJudging())
    assert set(found.track_id.tolist()) == {105, 106}
    assert np.abs(found.error).max() < 1e-9


def test_two_pieces_of_one_track_are_both_judged() -> None:
    tracks = _tracks(np.zeros((2 * len(T), 3)))
    identity = np.where(tracks.t > 1.0, tracks.identity + 200, tracks.identity)
    order = np.lexsort((tracks.t, identity))
    cut = RoadRows(tracks.t[order], identity[order], tracks.values[order])
    assert set(judge_road(cut, _truth(), RoadJudging()).track_id.tolist()) == {105, 106, 305, 306}


def test_tables_of_a_folder(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no table of a road"):
        judge_road_run(tmp_path, tmp_path / "gt.csv")
    (tmp_path / "gt.csv").write_text("t,object_id,x,y,speed_kmh\n0,1,0,30,72\n1,1,0,50,72\n")
    head = "t,track_id,x,y,speed_kmh,var_x,var_y,var_speed_kmh\n"
    (tmp_path / "road_causal.csv").write_text(head + "0.5,9,0.1,40.3,75,0.01,0.09,9\n")
    scores = judge_road_run(tmp_path, tmp_path / "gt.csv")["road_causal"]
    assert scores["along_rmse_m"] == pytest.approx(0.3)
    assert scores["speed_nees"] == pytest.approx(1.0)


def test_rows_that_do_not_know_their_speed_yet_count_for_the_place_alone(tmp_path: Path) -> None:
    (tmp_path / "gt.csv").write_text("t,object_id,x,y,speed_kmh\n0,1,0,30,72\n1,1,0,50,72\n")
    head = "t,track_id,x,y,speed_kmh,var_x,var_y,var_speed_kmh\n"
    rows = "0.25,9,0.0,35.4,,0.01,0.04,\n0.5,9,0.0,40.3,75,0.01,0.09,9\n"
    (tmp_path / "road_causal.csv").write_text(head + rows)
    scores = judge_road_run(tmp_path, tmp_path / "gt.csv")["road_causal"]
    assert scores["rows"] == 2
    assert scores["speed_known"] == 50.0
    assert scores["speed_rmse_kmh"] == pytest.approx(3.0)
    assert scores["along_rmse_m"] == pytest.approx(np.sqrt((0.4**2 + 0.3**2) / 2))
    (tmp_path / "road_causal.csv").write_text(head + "0.25,9,0.0,35.4,,0.01,0.04,\n")
    scores = judge_road_run(tmp_path, tmp_path / "gt.csv")["road_causal"]
    assert "speed_rmse_kmh" not in scores
    assert scores["speed_known"] == 0.0
