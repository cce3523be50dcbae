"""`benchmarks road`: which vehicles are paired with which, and tables of a result."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.road import tables
from benchmarks.road_cost import causal_cost, lag_cost, many_vehicles
from benchmarks.road_real import chosen_lengths, paired, speed_scores
from benchmarks.road_real import tables as real_tables


def test_tracks_are_paired_by_both_times_after_a_constant_is_taken_off() -> None:
    true = np.array([[10.0, 11.5], [20.0, 21.4], [20.3, 21.7], [40.0, 41.0]])
    seen = true + np.array([0.1, 0.35])
    seen[3] += 0.2  # not the same vehicle
    assert paired(seen, true) == [(0, 0), (1, 1), (2, 2)]


def test_two_that_cannot_be_told_apart_are_left_out() -> None:
    true = np.array([[10.0, 11.5], [20.0, 21.4], [20.05, 21.45]])
    assert paired(true.copy(), true) == [(0, 0)]
    assert paired(np.zeros((0, 2)), true) == []


def test_sets_of_lengths() -> None:
    along = np.array([True, True, False, True, False])
    assert chosen_lengths(along, "two along").tolist() == [0, 1]
    assert chosen_lengths(along, "one along, one across").tolist() == [3, 2]
    assert len(chosen_lengths(along, "all")) == 5


def test_scores_of_speeds() -> None:
    scores = speed_scores(np.array([1.0, -2.0, 0.5]), np.array([1.0, 1.0, 1.0]))
    assert scores["mean_kmh"] == pytest.approx(3.5 / 3)
    assert scores["bias_kmh"] == 0.5
    assert scores["held"] == pytest.approx(200.0 / 3)


def test_tables_pool_seeds_by_rows() -> None:
    names = ("nees", "speed_nees", "across_held", "along_held", "speed_held", "speed_median_kmh")
    names += ("across_rmse_m", "along_rmse_m", "speed_rmse_kmh", "speed_known")
    one = {"scenario": "day", "camera": "exact", "table": "smoothed", "rows": 3, **dict.fromkeys(names, 1.0)}
    other = one | {"rows": 1, "speed_rmse_kmh": 3.0, "nees": 5.0}
    found = tables({"simulated": [one, other], "costs": []})
    row = dict(zip(found["road-simulated"].columns, found["road-simulated"].rows[0], strict=True))
    assert row["speed_rmse_kmh"] == pytest.approx(np.sqrt((3 * 1 + 9) / 4))
    assert row["nees"] == pytest.approx(2.0)


def test_tables_of_real_roads_pool_the_vehicles_of_all_cameras() -> None:
    cameras = [
        {"camera": name, "lengths": "two along", **speed_scores(np.array(errors), np.ones(len(errors)))}
        for name, errors in (("a", [0.5, -1.0]), ("b", [3.0]))
    ]
    table = real_tables({"real": cameras})["road-real-two-along"]
    rows = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    assert [row["camera"] for row in rows] == ["a", "b", "all"]
    assert rows[-1]["vehicles"] == 3
    assert rows[-1]["mean_kmh"] == pytest.approx(1.5)


def test_a_folder_without_cameras_is_refused(tmp_path, capsys) -> None:
    assert main(["road-real", str(tmp_path)]) == 2
    assert "holds no cameras" in capsys.readouterr().err
    assert main(["road-real"]) == 2
    assert "give ROOT" in capsys.readouterr().err


def test_thirty_vehicles_are_seen_by_both_sensors_at_their_rates() -> None:
    _, log = many_vehicles(2.0)
    assert len(log) == 30 * (40 + 200)
    assert (np.diff(log["t"]) >= 0).all()
    assert len(np.unique(log["track_id"][log["t"] < 0.1])) == 30


def test_costs_are_shares_of_what_was_measured() -> None:
    """No figure of time is tested: that there is one, of the right kind."""
    causal, lag = causal_cost(1.2), lag_cost(1.6)
    assert causal["share"] > 0
    assert lag["real_time"] > 0
    table = tables({"simulated": [], "costs": [{"what": "causal", **causal}, {"what": "lag", **lag}]})
    assert len(table["road-cost"].rows) == 2
