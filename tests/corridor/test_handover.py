"""Vehicles of a simulated corridor: who was who, the clocks, travel times, and what is refused."""

from __future__ import annotations

import csv

import numpy as np
import pytest
import yaml

from jeat_graph.cli.main import main
from jeat_graph.corridor.corridor_tables import mean_travel_time
from jeat_graph.corridor.handover import KnownGap, chain
from jeat_graph.corridor.passages import read_passages
from jeat_graph.data.errors import DataError


def rows_of(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def vehicles(road):
    return {(row["camera"], int(row["track_id"])): int(row["vehicle"]) for row in rows_of(road / "truth.csv")}


def test_most_vehicles_are_followed_and_few_wrongly(road, through):
    who = vehicles(road)
    links = rows_of(through / "passages.csv")
    right = [
        who[row["from"], int(row["from_track_id"])] == who[row["to"], int(row["to_track_id"])]
        for row in links
    ]
    seen = {name: {v for (camera, _), v in who.items() if camera == name and v >= 0} for name in "ABC"}
    common = len(seen["A"] & seen["B"]) + len(seen["B"] & seen["C"])
    assert 2.0 * sum(right) / (len(links) + common) > 0.93
    # Its probabilities are right: the expected number of right links is near the true one.
    assert sum(float(row["probability"]) for row in links) == pytest.approx(sum(right), rel=0.04)


def test_the_clocks_are_found_within_what_is_said(road, through):
    truth = yaml.safe_load((road / "corridor_truth.yaml").read_text())["clock_s"]
    gaps = yaml.safe_load((through / "corridor.yaml").read_text())["gaps"]
    for gap, true in zip(gaps, (truth["B"], truth["C"] - truth["B"]), strict=True):
        sd = gap["covariance"][0][0] ** 0.5
        assert abs(gap["offset_s"] - true) < 3.0 * sd
        assert sd < 0.5


def test_identities_join_what_the_gaps_join(through):
    links = rows_of(through / "passages.csv")
    own = {(row["camera"], row["track_id"]): row["identity"] for row in rows_of(through / "identities.csv")}
    for row in links:
        assert own[row["from"], row["from_track_id"]] == own[row["to"], row["to_track_id"]] == row["identity"]
    cameras = [(row["identity"], row["camera"]) for row in rows_of(through / "identities.csv")]
    assert len(cameras) == len(set(cameras))


def test_travel_times_hold_the_truth(road, through):
    truth = rows_of(road / "truth.csv")
    clock = yaml.safe_load((road / "corridor_truth.yaml").read_text())["clock_s"]
    t = {name: {} for name in "ABC"}
    for row in truth:
        if int(row["vehicle"]) >= 0:
            t[row["camera"]][row["vehicle"]] = float(row["t_true"])
    rows = [row for row in rows_of(through / "travel_times.csv") if row["class"] == "all" and row["mean_s"]]
    held = []
    for row in rows:
        a, b = t[row["from"]], t[row["to"]]
        assert clock["A"] == 0.0  # so that the first camera's clock is the true one
        true = [b[k] - a[k] for k in a if k in b and float(row["begin"]) <= a[k] < float(row["end"])]
        if len(true) > 10:
            held.append(float(row["low_s"]) <= np.mean(true) <= float(row["high_s"]))
            assert float(row["mean_s"]) == pytest.approx(np.mean(true), rel=0.03)
    assert len(held) >= 4
    assert np.mean(held) >= 0.75


def test_every_passage_begins_or_goes_on_somewhere(road, through):
    rows = rows_of(through / "od.csv")
    total = sum(len(read_passages(road / name, name)) for name in "ABC")
    handed = len(rows_of(through / "passages.csv"))
    assert sum(int(row["vehicles"]) for row in rows) == total - handed
    assert sum(float(row["expected"]) for row in rows) == pytest.approx(total - handed, rel=0.05)


def test_an_earlier_corridor_is_taken_up(road, through, tmp_path):
    cameras = [f"{name}={road / name}" for name in "ABC"]
    corridor = ["--corridor", str(through / "corridor.yaml")]
    assert main(["handover", *cameras, *corridor, "--out", str(tmp_path / "again")]) == 0
    first, again = (
        yaml.safe_load((folder / "corridor.yaml").read_text())["gaps"]
        for folder in (through, tmp_path / "again")
    )
    for one, other in zip(first, again, strict=True):
        assert other["offset_s"] == pytest.approx(one["offset_s"], abs=0.1)
        assert other["covariance"][0][0] <= one["covariance"][0][0]


def test_the_distance_follows_from_known_clocks(road, tmp_path):
    truth = yaml.safe_load((road / "corridor_truth.yaml").read_text())["clock_s"]
    told = ["--clock", f"A-B={truth['B']}±0.02"]
    assert main(["handover", f"A={road / 'A'}", f"B={road / 'B'}", *told, "--out", str(tmp_path)]) == 0
    (gap,) = yaml.safe_load((tmp_path / "corridor.yaml").read_text())["gaps"]
    assert gap["distance_m"] == pytest.approx(300.0, abs=3.0 * gap["covariance"][1][1] ** 0.5)


def refused(arguments, capsys):
    assert main(["handover", *arguments]) == 2
    return capsys.readouterr().err


def test_roads_without_vehicles_in_common_are_refused(road, other_road, tmp_path, capsys):
    message = refused(
        [f"A={road / 'A'}", f"B={other_road / 'B'}", "--distance", "A-B=300±3", "--out", str(tmp_path / "x")],
        capsys,
    )
    assert "traffic does not show its clock" in message
    assert not (tmp_path / "x").exists()


def test_neither_clock_nor_distance_is_refused(road, through, tmp_path, capsys):
    text = (through / "corridor.yaml").read_text()
    (tmp_path / "c.yaml").write_text(text.replace("distance_m", "length_m"))
    arguments = [f"A={road / 'A'}", f"B={road / 'B'}", "--out", str(tmp_path / "x")]
    assert "how far" in refused(arguments, capsys)
    assert "must have from, to" in refused([*arguments, "--corridor", str(tmp_path / "c.yaml")], capsys)


def test_too_few_vehicles_are_refused(road, tmp_path, capsys):
    few = tmp_path / "few"
    few.mkdir()
    for name in ("crossings.csv", "speeds.csv"):
        lines = (road / "A" / name).read_text().splitlines(keepends=True)
        (few / name).write_text("".join(lines[:31]))
    message = refused(
        [f"A={few}", f"B={road / 'B'}", "--distance", "A-B=300±3", "--out", str(tmp_path / "x")], capsys
    )
    assert "fewer than 40" in message


def test_gaps_must_be_a_chain():
    a_b, b_c = KnownGap("A", "B", 1.0, 1.0), KnownGap("B", "C", 1.0, 1.0)
    assert chain([b_c, a_b], ["C", "B", "A"]) == ["A", "B", "C"]
    for gaps, cameras in (
        ([a_b], "ABC"),
        ([a_b, KnownGap("A", "C")], "ABC"),
        ([a_b, KnownGap("B", "A")], "AB"),
    ):
        with pytest.raises(DataError):
            chain(gaps, list(cameras))
    with pytest.raises(DataError, match="no camera 'C'"):
        chain([b_c], ["A", "B"])


def test_a_line_that_is_crossed_both_ways_asks_which(road, tmp_path):
    lines = (road / "A" / "crossings.csv").read_text().splitlines(keepends=True)
    both = [line.replace("right", "left") if k % 2 else line for k, line in enumerate(lines)]
    (tmp_path / "crossings.csv").write_text("".join(both))
    (tmp_path / "speeds.csv").write_text((road / "A" / "speeds.csv").read_text())
    with pytest.raises(DataError, match="crossed both ways"):
        read_passages(tmp_path, "A")
    left, right = (len(read_passages(tmp_path, "A", direction=way)) for way in ("left", "right"))
    assert abs(left - right) < 20
    with pytest.raises(DataError, match="has no line"):
        read_passages(tmp_path, "A", line="north")


def test_the_mean_of_all_vehicles_followed_surely_is_exact():
    expected, mean, low, high, median = mean_travel_time(np.array([10.0, 12.0, 14.0]), np.ones(3), 3.0, 0.0)
    assert (expected, mean, low, high, median) == (3.0, 12.0, 12.0, 12.0, 12.0)
    _, _, low, high, _ = mean_travel_time(np.array([10.0, 12.0, 14.0]), np.ones(3), 6.0, 0.0)
    # Half of six were followed: σ² (1 − 3/6) / 3.
    assert high - low == pytest.approx(2.0 * 1.959964 * (4.0 * 0.5 / 3.0) ** 0.5)
