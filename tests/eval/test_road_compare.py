"""Filter and smoother on the road, compared where both say something."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.drawing.comparison import write_plots
from jeat_graph.eval.compare import Comparison
from jeat_graph.eval.road_compare import compare_road, road_truth_beside, with_road
from jeat_graph.eval.tables import to_json

T = np.arange(0.0, 3.0, 0.05)
HEAD = "t,track_id,x,y,speed_kmh,var_x,var_y,var_speed_kmh\n"


def _write(folder: Path, name: str, first: int, error: tuple[float, float, float], blank: int) -> None:
    """One vehicle at 20 m/s from 25 m on: rows from the `first`, whose first `blank` state no speed."""
    lines = [HEAD]
    for k in range(first, len(T)):
        speed, var = (f"{72.0 + error[2]}", "4") if k - first >= blank else ("", "")
        lines.append(f"{T[k]},7,{error[0]},{25.0 + 20.0 * T[k] + error[1]},{speed},0.04,0.04,{var}\n")
    (folder / name).write_text("".join(lines))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    rows = "".join(f"{t},1,0,{25.0 + 20.0 * t},72\n" for t in T)
    (tmp_path / "gt_road.csv").write_text("t,object_id,x,y,speed_kmh\n" + rows)
    _write(tmp_path, "road_causal.csv", 4, (0.2, 0.4, 3.0), 2)
    _write(tmp_path, "road_smoothed.csv", 0, (0.1, 0.1, 1.0), 0)
    return tmp_path


def test_each_is_judged_over_its_own_rows_and_both_over_the_same(run: Path) -> None:
    values = compare_road(run, run / "gt_road.csv").values
    assert values["filter"]["rows"] == len(T) - 4
    assert values["smoothed"]["rows"] == len(T)
    same = values["same_rows"]
    assert same["filter"]["rows"] == same["smoothed"]["rows"] == len(T) - 6
    assert same["filter"]["along_rmse_m"] == pytest.approx(0.4)
    assert same["smoothed"]["speed_rmse_kmh"] == pytest.approx(1.0)
    assert same["filter"]["speed_nees"] == pytest.approx(9.0 / 4.0)
    assert same["filter"]["nees"] == pytest.approx((0.04 + 0.16) / 2 / 0.04)
    assert (same["filter"]["along_held"], same["smoothed"]["along_held"]) == (0.0, 100.0)
    assert sum(one["filter"]["rows"] for one in values["by_distance"]) == same["filter"]["rows"]
    assert [one["from_m"] for one in values["by_distance"]] == [20.0, 40.0, 60.0, 80.0]


def test_it_becomes_part_of_a_comparison_and_is_drawn(run: Path) -> None:
    truth = road_truth_beside(run, run / "gt.csv")
    comparison = with_road(Comparison({"tracks": 1}, [], None), run, truth)
    assert json.loads(to_json(comparison.values))["road"]["smoothed"]["tracks"] == 1
    assert "filter, same rows" in comparison.tables[0].render()
    assert "60 to 80 m" in comparison.tables[1].render()
    assert [path.name for path in write_plots(comparison, run)] == ["road-errors.png", "road-errors.svg"]


def test_without_tables_of_the_road_there_is_nothing_to_compare(run: Path) -> None:
    (run / "road_causal.csv").unlink()
    assert road_truth_beside(run, run / "gt.csv") is None
    with pytest.raises(DataError, match="holds no road_causal"):
        compare_road(run, run / "gt_road.csv")
