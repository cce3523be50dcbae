"""The page of a run: its figures are those of the tables, and it needs nothing but itself."""

from __future__ import annotations

import json
import re
from itertools import pairwise

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.io.tables.diagnostics_io import read_diagnostics
from jeat_graph.io.tables.trajectories_io import read_trajectories


@pytest.fixture(scope="module")
def causal(full_run):
    return read_trajectories(full_run.run / "causal.csv")


@pytest.fixture(scope="module")
def smoothed(full_run):
    return read_trajectories(full_run.run / "smoothed.csv")


@pytest.fixture(scope="module")
def diagnostics(full_run):
    return read_diagnostics(full_run.run / "diagnostics.csv")


def test_nothing_is_asked_of_a_network(full_run):
    text = full_run.page.read_text(encoding="utf-8")
    assert "http://" not in text
    assert "https://" not in text
    assert "@import" not in text
    assert re.findall(r"url\(", text) == []
    for tag, attributes in full_run.html.tags:
        for name in ("src", "href", "xlink:href", "data", "srcset", "action"):
            value = attributes.get(name)
            assert value is None or value.startswith("data:"), (tag, name)
    policies = [one for one in full_run.html.attributes("meta") if "http-equiv" in one]
    assert policies[0]["content"].startswith("default-src 'none'")


def test_the_same_run_gives_the_same_bytes(full_run, small_plots, tmp_path):
    again = tmp_path / "again.html"
    with small_plots():
        assert main(["report", str(full_run.run), "--gt", str(full_run.truth), "--out", str(again)]) == 0
    assert again.read_bytes() == full_run.page.read_bytes()


def test_scores_are_those_of_eval(full_run, tmp_path):
    scores = tmp_path / "scores.json"
    assert main(["eval", str(full_run.run), "--gt", str(full_run.truth), "--json", str(scores)]) == 0
    wanted = json.loads(scores.read_text())
    shown = {row["table"]: row for row in full_run.html.tables[""]}
    assert set(shown) == {"causal", "smoothed"}
    errors = {row["table"]: row for row in full_run.html.tables["Errors of matched tracks"]}
    for kind, values in wanted.items():
        for name in ("MOTA", "IDF1", "HOTA"):
            assert shown[kind][name] == f"{values[name]:.2f}"
        for name in ("position_rmse", "nees"):
            assert errors[kind][name] == f"{values[name]:.2f}"
        assert shown[kind]["FN"] == str(values["FN"])


def test_counts_are_those_of_the_tables(full_run, causal, smoothed):
    rows = {row["table"]: row for row in full_run.html.tables["Tracks"]}
    for kind, table in (("causal", causal), ("smoothed", smoothed)):
        ids = np.unique(table.track_id)
        lives = [np.ptp(table.t[table.track_id == i]) for i in ids]
        assert rows[kind]["tracks"] == str(len(ids))
        assert rows[kind]["rows"] == str(len(table))
        assert rows[kind]["longest (s)"] == f"{max(lives):.2f}"
        assert rows[kind]["rows without any detection (%)"] == f"{100 * np.mean(table.used == 0):.2f}"


def test_consistency_by_sensor_is_that_of_the_diagnostics(full_run, causal, smoothed, diagnostics):
    reported = np.isin(diagnostics.track_id, np.union1d(causal.track_id, smoothed.track_id))
    rows = {row["sensor"]: row for row in full_run.html.tables["Consistency by sensor"]}
    assert set(rows) == {"evt", "rgb"}
    for k, name in enumerate(diagnostics.sensors):
        mine = reported & (diagnostics.sensor == k)
        nis = diagnostics.nis[mine]
        inside = (nis >= -2.0 * np.log(0.975)) & (nis <= -2.0 * np.log(0.025))  # χ² of 2 degrees of freedom
        assert rows[name]["updates"] == str(mine.sum())
        assert rows[name]["mean NIS / 2"] == f"{np.nanmean(nis) / 2:.3f}"
        share = 100 * inside.sum() / np.isfinite(nis).sum()
        assert float(rows[name]["NIS within 95 % bounds (%)"]) == pytest.approx(share, abs=0.0501)
        assert rows[name]["median s"] == f"{np.median(diagnostics.noise_scale[mine]):.2f}"


def test_every_track_is_on_the_map_in_the_list_and_has_curves(full_run, causal, smoothed):
    ids = [str(i) for i in np.union1d(causal.track_id, smoothed.track_id)]
    groups = [one["data-id"] for one in full_run.html.attributes("g") if one.get("class") == "track"]
    assert groups == ids
    assert [row["track"] for row in full_run.html.tables["All tracks"]] == ids
    assert [str(one["id"]) for one in full_run.html.data["tracks"]] == ids


def test_the_map_draws_each_track_where_its_table_has_it(full_run, causal):
    paths = re.findall(r'data-id="(\d+)".*?class="now" d="([^"]+)"', full_run.page.read_text(), re.DOTALL)
    assert paths
    for track_id, path in paths:
        steps = np.array([[float(v) for v in step.split()] for step in re.findall(r"[Mml]([-.\d ]+)", path)])
        mine = causal.take(causal.track_id == int(track_id))
        drawn = np.cumsum(steps, axis=0)
        np.testing.assert_allclose(drawn[0], mine.mean[0, :2], atol=0.051)
        np.testing.assert_allclose(drawn[-1], mine.mean[-1, :2], atol=0.051)
        nearest = np.abs(drawn[:, None] - mine.mean[None, :, :2]).max(axis=2).min(axis=1)
        assert nearest.max() < 0.051


def test_curves_hold_values_of_the_tables(full_run, causal, diagnostics):
    data = full_run.html.data
    start = data["start_ms"]
    names = data["sensors"]
    for one in data["tracks"]:
        mine = diagnostics.take(diagnostics.track_id == one["id"])
        for k, name in enumerate(names):
            here = (mine.sensor == mine.sensors.index(name)) & np.isfinite(mine.nis)
            ms = np.rint(1e3 * mine.t[here]).astype(int)
            told = dict(zip((ms - start).tolist(), mine.nis[here].tolist(), strict=True))
            for t, v in zip(one["nis"][k]["t"], one["nis"][k]["v"], strict=True):
                assert v == pytest.approx(told[t], rel=1e-3)
            if here.any():
                assert max(one["nis"][k]["v"]) == pytest.approx(mine.nis[here].max(), rel=1e-3)
        rows = causal.take(causal.track_id == one["id"])
        motion = one["motion"]
        t = (np.array(motion["t"]) + start) / 1e3
        near = np.abs(rows.t[None] - t[:, None]) < 1.1e-3  # times are shown to the millisecond
        for name, wanted in (("vx", rows.mean[:, 2]), ("svy", np.sqrt(rows.var[:, 3]))):
            same = np.isclose(np.array(motion[name])[:, None], wanted, rtol=1e-3, atol=1e-2)
            assert (near & same).any(axis=1).all()


def test_difference_of_filter_and_smoother_is_that_of_the_rows(full_run, causal, smoothed):
    data = full_run.html.data
    checked = 0
    for one in data["tracks"]:
        early = causal.take(causal.track_id == one["id"])
        late = smoothed.take(smoothed.track_id == one["id"])
        if not len(early) or not len(late):
            continue  # a track that is in one table only has no difference
        for ms, dx in zip(one["motion"]["t"], one["motion"]["dx"], strict=True):
            t = (ms + data["start_ms"]) / 1e3
            a, b = np.abs(early.t - t) < 6e-4, np.abs(late.t - t) < 6e-4
            if dx is not None and a.sum() == 1 and b.sum() == 1:
                assert dx == pytest.approx(
                    float(early.mean[a, 0][0] - late.mean[b, 0][0]), rel=1e-3, abs=2e-3
                )
                checked += 1
    assert checked > 500


def test_sensor_bins_hold_each_use_of_a_sensor(full_run, causal):
    data = full_run.html.data
    for one in data["tracks"]:
        rows = causal.take(causal.track_id == one["id"])
        for k, name in enumerate(data["sensors"]):
            ms = 1e3 * rows.t[rows.used >> rows.sensors.index(name) & 1 > 0] - data["start_ms"]
            for use in ms.tolist():
                bins = np.array(one["used"][k])
                low = one["from"] + bins * one["bin"]
                assert ((low <= use + 1.5) & (use <= low + one["bin"] + 1.5)).any()


def test_inputs_version_and_timings_stand_on_the_page(full_run):
    record = json.loads((full_run.run / "run.json").read_text())
    inputs = full_run.html.tables["Inputs"][0]
    assert inputs["SHA-256"] == record["inputs"][0]["sha256"]
    assert inputs["bytes"] == str(record["inputs"][0]["bytes"])
    assert f"jeat-graph {record['version']}" in full_run.html.said
    timings = {row["what"]: row["value"] for row in full_run.html.tables["Timings"]}
    assert timings["track_s"] == f"{record['timings']['track_s']:.4f}"


def test_filter_against_smoother_brings_the_pictures_of_compare_with_a_text(full_run):
    pictures = full_run.html.attributes("img")
    assert len(pictures) == 3
    assert all(len(one["alt"]) > 40 for one in pictures)
    assert any("px/s² for the whole track" in one["alt"] for one in pictures)


def test_headings_go_down_one_level_at_a_time(full_run):
    levels = [int(tag[1]) for tag, _ in full_run.html.tags if re.fullmatch(r"h\d", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(b - a <= 1 for a, b in pairwise(levels))


def test_controls_have_names(full_run):
    html = full_run.html
    assert html.attributes("html")[0]["lang"] == "en"
    labelled = {one["for"] for one in html.attributes("label")}
    selects = {one["id"] for one in html.attributes("select")}
    assert selects
    assert selects <= labelled
    heads = html.attributes("th")
    assert heads
    assert all("scope" in one for one in heads)
    assert html.attributes("svg")[0]["aria-label"].startswith("Map of the picture plane")
