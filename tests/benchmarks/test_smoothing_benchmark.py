"""Drawn tracks are what they are said to be, and the command's tables hold what was judged."""

import json

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.drawn import EVT, RGB, from_model, from_paths
from benchmarks.smoothing import drawn


def residuals(track, sensor):
    """Errors (M, 2) of one sensor's measurements and their times; drawn tracks have no coincident ones."""
    data = track.data
    near = np.searchsorted(track.t, data.t[data.key])
    error = data.z - track.truth[near, :, 0]
    mine = data.error == sensor
    return error[mine], data.t[data.key][mine]


@pytest.mark.parametrize(("sensor", "model"), [(0, EVT), (1, RGB)])
def test_drawn_noise_has_the_variance_and_the_memory_of_its_model(sensor, model):
    _, std, share, memory = model
    lag, product, square = [], [], []
    for seed in range(30):
        error, t = residuals(from_model(seed, True), sensor)
        square.append((error**2).mean())
        lag.append(np.diff(t))
        product.append((error[1:] * error[:-1]).mean(axis=1))
    assert np.sqrt(np.mean(square)) == pytest.approx(std, rel=0.06)
    expected = share * np.exp(-np.concatenate(lag) / memory) * std**2
    assert np.concatenate(product).mean() == pytest.approx(expected.mean(), rel=0.12)


@pytest.mark.parametrize("memory", [pytest.param(False, marks=pytest.mark.slow), True])
def test_on_drawn_tracks_all_estimates_are_consistent_and_smoothing_pays(memory):
    rows = {row["row"]: row for row in drawn([from_model(seed, memory) for seed in range(40)])}
    for row in rows.values():
        assert row["low"] - 0.03 < row["anees"] < row["high"] + 0.03
    ratio = [rows["whole tracks"][k] / rows["filter"][k] for k in ("position_rmse", "velocity_rmse")]
    most = (0.66, 0.36) if memory else (0.45, 0.30)
    assert ratio[0] <= most[0]
    assert ratio[1] <= most[1]


def test_real_paths_keep_their_places_and_too_short_ones_are_left_out(tmp_path):
    path = tmp_path / "paths.csv"
    lines = ["t,object_id,x_m,y_m"]
    lines += [f"{0.1 * k},long,{3.0 * k},{0.5 * k}" for k in range(60)]
    lines += [f"{0.1 * k},short,1,1" for k in range(5)]
    path.write_text("\n".join(lines))
    [track] = from_paths(path, seed=0)
    # 30 m/s along x and 5 m/s along y, at 10 px a metre.
    assert track.truth[:, 0, 1] == pytest.approx(np.full(len(track.t), 300.0))
    assert track.truth[:, 1, 1] == pytest.approx(np.full(len(track.t), 50.0))


def test_the_command_writes_what_it_prints(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("benchmarks.smoothing._DRAWN_SEEDS", 4)
    arguments = ["--scenarios", "night", "--duration", "1", "--seeds", "0", "1", "--jobs", "1"]
    missing = ["--data", str(tmp_path / "none")]
    assert main(["smoothing", *arguments, *missing, "--out", str(tmp_path)]) in (0, None)
    printed = capsys.readouterr()
    assert "real paths are left out" in printed.err
    result = json.loads((tmp_path / "smoothing.json").read_text())
    rows = {record["row"] for record in result["records"]}
    assert rows == {"causal", "fixed lag, 1 s", "whole tracks, stitched"}
    assert len(result["records"]) == 6
    causal = [r["scores"]["MOTA"] for r in result["records"] if r["row"] == "causal"]
    assert f"{np.mean(causal):.1f} ± {np.std(causal, ddof=1):.1f}" in printed.out
    assert main(["smoothing", "--from", str(tmp_path / "smoothing.json")]) in (0, None)
    assert capsys.readouterr().out == printed.out
