"""`demo`: simulate, track, judge, draw."""

from __future__ import annotations

import pytest

from jeat_graph.cli.main import main

SHORT = ["--duration", "2"]


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo")
    assert main(["demo", "--out", str(folder), *SHORT]) == 0
    return folder


def test_it_writes_run_scores_and_pictures(demo):
    names = {path.relative_to(demo).as_posix() for path in demo.rglob("*") if path.is_file()}
    assert {
        "detections.csv",
        "gt.csv",
        "scores.md",
        "tracks.png",
        "tracks.svg",
        "run/causal.csv",
        "run/run.json",
        "run/scans.csv",
    } <= names
    assert (demo / "tracks.png").read_bytes().startswith(b"\x89PNG")


def test_both_sensors_beat_each_alone(demo):
    rows = [line.split("|")[1:4] for line in (demo / "scores.md").read_text().splitlines()[2:]]
    mota = {name.strip(): float(value) for name, value, _ in rows}
    assert mota["evt + rgb"] > max(mota["evt alone"], mota["rgb alone"])
    assert mota["evt + rgb, smoothed"] > mota["evt + rgb"]


def test_repetition_gives_the_same_bytes(demo, tmp_path):
    assert main(["demo", "--out", str(tmp_path), *SHORT]) == 0
    for name in ("tracks.png", "tracks.svg", "scores.md", "run/causal.csv", "gt.csv"):
        assert (tmp_path / name).read_bytes() == (demo / name).read_bytes(), name


def test_the_table_and_the_next_step_go_to_stdout(tmp_path, capsys):
    assert main(["demo", "--out", str(tmp_path), "--duration", "1", "--scenario", "day"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("sensors")
    assert "jeat-graph track my.csv --out run" in out


def test_its_run_can_be_judged_by_eval(demo, capsys):
    assert main(["eval", str(demo / "run"), "--gt", str(demo / "gt.csv")]) == 0
    judged = capsys.readouterr().out.splitlines()[2].split()
    shown = (demo / "scores.md").read_text().splitlines()[2].split("|")
    assert judged[1] == shown[2].strip()


def test_a_configuration_without_its_sensors_is_refused_before_anything_is_written(tmp_path, fails):
    config = tmp_path / "radar.yaml"
    config.write_text("input: {undeclared: refuse}\nsensors: {radar: {rate_hz: 10}}\n")
    message = fails("demo", "--config", config, "--out", tmp_path / "demo", *SHORT)
    assert "sensors 'evt', 'rgb' are not declared (declared: radar)" in message
    assert not (tmp_path / "demo").exists()


def test_its_run_can_be_compared(demo, tmp_path):
    arguments = [str(demo / "run"), "--gt", str(demo / "gt.csv"), "--out", str(tmp_path / "comparison")]
    assert main(["compare", *arguments, "--no-plots", "--lags", "0.2"]) == 0
    assert (tmp_path / "comparison" / "compare.json").is_file()
