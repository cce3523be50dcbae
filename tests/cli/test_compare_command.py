"""`jeat-graph compare` from files to files."""

from __future__ import annotations

import contextlib
import io
import json
import re
from pathlib import Path

import pandas as pd
import pytest

from jeat_graph.cli.main import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("compare")
    assert main(["simulate", "day-sparse", "--out", str(path / "sim"), "--duration", "2", "--seed", "1"]) == 0
    detections = str(path / "sim" / "detections.csv")
    assert main(["track", detections, "--out", str(path / "run"), "--smoother", "full"]) == 0
    return path


@pytest.fixture(scope="module")
def shown(folder, small_plots):
    """What the comparison with the truth, in `out`, prints."""
    truth = str(folder / "sim" / "gt.csv")
    with small_plots(), contextlib.redirect_stdout(io.StringIO()) as printed:
        assert main(["compare", str(folder / "run"), "--gt", truth, "--out", str(folder / "out")]) == 0
    return printed.getvalue()


def test_it_prints_tables_and_writes_json_and_pictures(folder, shown):
    assert "lag 0.5 s" in shown
    assert "innovation autocorrelation" in shown
    values = json.loads((folder / "out" / "compare.json").read_text())
    assert values["errors"]["full"]["velocity_rmse"] < values["errors"]["filter"]["velocity_rmse"]
    for name in ("trajectories", "error-over-time", "rmse-against-lag"):
        assert (folder / "out" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert b"<svg" in (folder / "out" / f"{name}.svg").read_bytes()


def test_the_guide_explains_each_column_of_the_errors_and_each_check(shown):
    guide = (Path(__file__).parents[2] / "docs" / "guides" / "evaluation.md").read_text(encoding="utf-8")
    errors, checks, *_ = shown.split("\n\n")
    rows = [re.split(r"  +", line.strip()) for line in errors.splitlines() if "─" not in line]
    # Title, names of the columns, filter, lags, whole track.
    assert [rows[2][0], rows[-1][0]] == ["filter", "whole track"]
    columns = rows[1][1:]
    assert len(columns) >= 7
    rules = [re.split(r"  +", line)[0] for line in checks.splitlines()[3:]]
    rules = [
        re.sub(r", \d steps?$", ", k steps", re.sub(r", (position|velocity|acceleration)$", "", r))
        for r in rules
    ]
    assert len(set(rules)) == 3
    assert [name for name in {*columns, *rules} if f"`{name}`" not in guide] == []


def test_without_truth_it_judges_consistency(folder, capsys):
    assert main(["compare", str(folder / "run"), "--out", str(folder / "plain")]) == 0
    assert "NIS" in capsys.readouterr().out
    assert sorted(p.name for p in (folder / "plain").iterdir()) == ["compare.json"]


@pytest.mark.usefixtures("shown")
def test_the_same_run_gives_the_same_bytes(folder, small_plots):
    truth = str(folder / "sim" / "gt.csv")
    with small_plots():
        assert main(["compare", str(folder / "run"), "--gt", truth, "--out", str(folder / "again")]) == 0
    first = sorted((folder / "out").iterdir())
    assert [path.name for path in first] == sorted(path.name for path in (folder / "again").iterdir())
    for path in first:
        assert path.read_bytes() == (folder / "again" / path.name).read_bytes(), path.name


def test_an_input_that_has_changed_is_refused(folder, tmp_path, capsys):
    moved = tmp_path / "detections.csv"
    moved.write_bytes((folder / "sim" / "detections.csv").read_bytes() + b"1.9999,rgb,1,1,5,5,0.5\n")
    out = str(tmp_path / "out")
    assert main(["compare", str(folder / "run"), "--detections", str(moved), "--out", out]) == 2
    error = capsys.readouterr().err
    assert "detections.csv" in error
    assert "has changed since the run" in error
    assert len(error.strip().splitlines()) == 1


def test_inputs_that_have_moved_can_be_named(folder, tmp_path):
    moved = tmp_path / "elsewhere.csv"
    moved.write_bytes((folder / "sim" / "detections.csv").read_bytes())
    out = str(tmp_path / "out")
    assert main(["compare", str(folder / "run"), "--detections", str(moved), "--out", out, "--no-plots"]) == 0


def test_a_folder_that_holds_no_run_is_refused(tmp_path, capsys):
    assert main(["compare", str(tmp_path)]) == 2
    assert "run.json" in capsys.readouterr().err


def test_boxes_without_velocities_give_errors_of_positions(folder, small_plots, capsys):
    whole = pd.read_csv(folder / "sim" / "gt.csv")
    boxes = folder / "boxes.csv"
    whole[["t", "object_id", "left", "top", "width", "height"]].to_csv(boxes, index=False)
    out = folder / "by-boxes"
    with small_plots():
        assert main(["compare", str(folder / "run"), "--gt", str(boxes), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "lag 0.5 s" in printed
    assert "velocity" not in printed.split("Consistency")[0].split("\n")[1]
    values = json.loads((out / "compare.json").read_text())
    assert len(values["lag_curve"]) > 1
    filtered, lagged = (values["errors"][name]["position_rmse"] for name in ("filter", "lag 0.1 s"))
    assert 0.0 < lagged < filtered < 20.0
    assert values["errors"]["full"]["velocity_rmse"] is None
    for name in ("trajectories", "error-over-time", "rmse-against-lag"):
        assert (out / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_a_table_alone_is_no_run(folder, capsys):
    table = folder / "run" / "causal.csv"
    assert main(["compare", str(table)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "causal.csv: is a table: compare needs the directory of a run" in line
