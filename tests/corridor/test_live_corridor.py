"""Vehicles followed while they drive: as right as afterwards, and from any state on."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
import yaml

from jeat_graph.corridor.corridor_file import read_learnt_gaps
from jeat_graph.corridor.live_corridor import LiveCorridor
from jeat_graph.corridor.live_gap import LivePassage
from jeat_graph.corridor.passages import read_passages
from jeat_graph.data.errors import DataError

EVERY_S = 4.0


def rows_of(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def drive(road, through):
    """Vehicles in the order of true time: (common time, camera, offset of its clock, passage)."""
    gaps = yaml.safe_load((through / "corridor.yaml").read_text())["gaps"]
    clock = {"A": 0.0, "B": gaps[0]["offset_s"], "C": gaps[0]["offset_s"] + gaps[1]["offset_s"]}
    rows = []
    for name in "ABC":
        p = read_passages(road / name, name)
        for k in range(len(p)):
            numbers = (p.t[k], p.sigma_t[k], p.log_speed[k], p.sigma_speed[k])
            one = LivePassage(
                int(p.track_id[k]), *map(float, numbers), p.lanes[p.lane[k]], p.kinds[p.kind[k]]
            )
            rows.append((one.t - clock[name], name, one))
    return clock, sorted(rows, key=lambda row: row[0])


def follow(live, drive, until=np.inf, since=-np.inf, silent=()):
    """Send the passages of a stretch of time; those of `silent` (camera, from, until) come later."""
    clock, rows = drive
    events, step = [], max(EVERY_S * (rows[0][0] // EVERY_S), since)
    end = min(rows[-1][0] + 200.0, until)
    k = sum(row[0] <= step for row in rows) if since > -np.inf else 0
    held = []
    while step < end:
        step = min(step + EVERY_S, end)
        hushed = {name for name, start, stop in silent if start <= step < stop}
        while k < len(rows) and rows[k][0] <= step:
            held.append(rows[k])
            k += 1
        for row in [row for row in held if row[1] not in hushed]:
            live.passed(row[1], row[2])
            held.remove(row)
        for name in clock:
            if name not in hushed:
                live.at(name, step + clock[name])
        events += live.decide()
    return events


def links_of(events):
    return {
        ((one["from"], one["from_track_id"]), (one["to"], one["to_track_id"]))
        for one in events
        if one["event"] == "passage"
    }


def f1(links, road):
    who = {(row["camera"], int(row["track_id"])): int(row["vehicle"]) for row in rows_of(road / "truth.csv")}
    seen = {name: {v for (camera, _), v in who.items() if camera == name and v >= 0} for name in "ABC"}
    common = len(seen["A"] & seen["B"]) + len(seen["B"] & seen["C"])
    return 2.0 * sum(who[a] == who[b] >= 0 for a, b in links) / (len(links) + common)


@pytest.fixture(scope="module")
def events(through, drive):
    live = LiveCorridor(read_learnt_gaps(through / "corridor.yaml"), 150.0)
    return follow(live, drive), live.shown()


def test_they_are_followed_as_well_as_afterwards(road, through, events):
    found, _ = events
    later = {
        ((row["from"], int(row["from_track_id"])), (row["to"], int(row["to_track_id"])))
        for row in rows_of(through / "passages.csv")
    }
    assert f1(links_of(found), road) > f1(later, road) - 0.03
    ends = [end for link in links_of(found) for end in ({link[0]}, {link[1]})]
    assert len(links_of(found)) * 2 == len(ends)
    assert len({link[0] for link in links_of(found)}) == len({link[1] for link in links_of(found)})


def test_travel_times_are_those_of_the_tables(through, events):
    found, _ = events
    later = {
        (row["from"], float(row["begin"])): float(row["mean_s"])
        for row in rows_of(through / "travel_times.csv")
        if row["class"] == "all" and int(row["vehicles"]) > 10
    }
    told = {(one["from"], one["begin"]): one["mean_s"] for one in found if one["event"] == "travel-time"}
    assert len(later) >= 3
    for key, mean in later.items():
        assert told[key] == pytest.approx(mean, rel=0.02)


def test_every_way_ends_once(events, drive):
    found, shown = events
    total = sum(way["vehicles"] for one in found if one["event"] == "od" for way in one["ways"])
    assert total == sum(one["vehicles"] for one in shown["od"]) == len(drive[1]) - len(links_of(found))
    assert shown["problems"] == []


def test_a_state_goes_on_where_it_was_and_who_is_reported_again_counts_once(through, drive, events):
    gaps = read_learnt_gaps(through / "corridor.yaml")
    stop, first = 80.0, LiveCorridor(gaps, 150.0)
    found = follow(first, drive, until=stop)
    again = LiveCorridor(gaps, 150.0)
    again.set_state(json.loads(json.dumps(first.state())))
    for t, name, one in drive[1]:  # a camera that begins again tells its last passages again
        if stop - 30.0 < t <= stop:
            assert not again.passed(name, one)
    found += follow(again, drive, since=stop)
    assert links_of(found) == links_of(events[0])


def test_a_camera_that_is_silent_for_a_while_costs_nobody(road, through, drive, events):
    """Its messages wait at the broker, and come when it is back."""
    live = LiveCorridor(read_learnt_gaps(through / "corridor.yaml"), 150.0)
    found = follow(live, drive, silent=[("A", 100.0, 130.0), ("C", 140.0, 260.0)])
    assert f1(links_of(found), road) > f1(links_of(events[0]), road) - 0.02


def test_clocks_that_disagree_are_warned_of(through, drive):
    live = LiveCorridor(read_learnt_gaps(through / "corridor.yaml"), 150.0)
    shifted = [(t, name, one._replace(t=one.t + (20.0 if name == "B" else 0.0))) for t, name, one in drive[1]]
    follow(live, (drive[0], shifted), until=250.0)
    assert any("do the clocks still agree" in text for text in live.shown()["problems"])


def test_memory_is_bounded_when_the_next_camera_is_dead(through, drive):
    live = LiveCorridor(read_learnt_gaps(through / "corridor.yaml"), 150.0)
    one = drive[1][0][2]
    for k in range(4000):
        live.passed("A", one._replace(track_id=k, t=float(k)))
        live.at("A", float(k))
        if k % 50 == 0:
            live.decide()
    assert live.shown()["gaps"][0]["on_way"] < 1200  # 900 s and the longest travel time


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [("model:", "modell:", "has no model"), ("carry:", "carri:", "its model has no valid 'carry'")],
)
def test_a_corridor_without_its_model_is_refused(old, new, words, through, tmp_path):
    (tmp_path / "c.yaml").write_text((through / "corridor.yaml").read_text().replace(old, new))
    with pytest.raises(DataError, match=words):
        read_learnt_gaps(tmp_path / "c.yaml")
