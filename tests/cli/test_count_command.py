"""`jeat-graph count`."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest

from jeat_graph.cli.main import main

HEADER = "t,track_id,left,top,width,height,existence,x,y,vx,vy,ax,ay," + ",".join(
    f"var_{name}" for name in ("x", "y", "vx", "vy", "ax", "ay")
)


@pytest.fixture
def run(tmp_path):
    """A table of two vehicles that drive down the picture and one that drives up."""
    rows = []
    for track, (x, start, speed) in enumerate([(20, 0, 100), (40, -30, 100), (70, 100, -100)], 1):
        for k in range(11):
            y = start + speed * 0.1 * k
            rows.append(f"{0.1 * k},{track},{x - 5},{y - 5},10,10,0.99,{x},{y},0,{speed},0,0,1,1,1,1,1,1,rgb")
    path = tmp_path / "causal.csv"
    path.write_text(HEADER + ",sensors\n" + "\n".join(rows) + "\n")
    return path


def test_counts_are_printed_and_written(run, tmp_path, capsys):
    out, single = tmp_path / "counts.csv", tmp_path / "crossings.csv"
    line = ["--line", "gate=0,50,100,50"]
    assert main(["count", str(run), *line]) == 0
    shown = capsys.readouterr().out
    assert "gate" in shown
    assert "right" in shown
    assert main(["count", str(run), *line, "--out", str(out), "--crossings", str(single)]) == 0
    counts = pd.read_csv(out)
    assert dict(zip(counts.direction, counts["count"], strict=True)) == {"left": 1, "right": 2}
    found = pd.read_csv(single)
    assert sorted(found.t.round(6)) == pytest.approx([0.5, 0.5, 0.8])


def test_intervals_split_the_counts(run, tmp_path):
    out = tmp_path / "counts.csv"
    assert main(["count", str(run), "--line", "0,50,100,50", "--interval", "0.6", "--out", str(out)]) == 0
    counts = pd.read_csv(out).query("direction == 'right'")
    assert counts["count"].tolist() == [1, 1]
    assert counts.line.tolist() == ["line-1", "line-1"]


@pytest.mark.parametrize("text", ["0,50,100", "a,b,c,d", "0,50,0,50", "gate=1,2,3,nan"])
def test_a_line_that_is_none_is_one_clear_line(run, text, capsys):
    assert main(["count", str(run), "--line", text]) == 2
    error = capsys.readouterr().err
    assert error.startswith("jeat-graph count: ")
    assert error.count("\n") == 1


def test_a_result_without_variances_has_no_interval(tmp_path, capsys):
    result, out = tmp_path / "result.txt", tmp_path / "counts.csv"
    result.write_text("".join(f"{k},1,{10 * k},40,10,20,1,-1,-1,-1\n" for k in range(1, 11)))
    command = ["count", str(result), "--rate", "10", "--line", "50,0,50,100"]
    assert main(command) == 0
    shown = capsys.readouterr()
    assert shown.out.rstrip().endswith("1     –")
    assert "no interval: the table has no variances" in shown.err
    assert main([*command, "--out", str(out)]) == 0
    (row,) = pd.read_csv(out).to_dict("records")
    assert (row["count"], row["low"], row["high"]) == (1, 0, 1)
    assert np.isnan(row["expected"])


def late_run(tmp_path, start=0.0, alone=False):
    """A recording of a minute: vehicles cross at 13.2 and 34.4 s; nothing is there before and after."""
    folder = tmp_path / "run"
    folder.mkdir()
    rows = []
    for track, crossing in enumerate((13.2, 34.4), 1):
        for k in range(11):
            t, y = crossing + 0.1 * (k - 5), 100.0 * (k - 5)
            rows.append(f"{start + t:.3f},{track},10,{y - 5},10,10,0.99,15,{y},0,1000,0,0,1,1,1,1,1,1,rgb")
    (folder / "causal.csv").write_text(HEADER + ",sensors\n" + "\n".join(rows) + "\n")
    if not alone:
        scans = "".join(f"{start + k / 25:.2f},rgb,0\n" for k in range(1500))
        (folder / "scans.csv").write_text("t,sensor,detections\n" + scans)
    return folder


def counted(folder, tmp_path, *more):
    out = tmp_path / "counts.csv"
    assert main(["count", str(folder), "--line", "0,0,100,0", *more, "--out", str(out)]) == 0
    return pd.read_csv(out)


@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_intervals_begin_at_multiples_and_include_those_without_anybody(tmp_path, start):
    begin = start // 15 * 15
    found = counted(late_run(tmp_path, start), tmp_path, "--interval", "15")
    first = found.t_from.tolist()
    assert first == [begin + 15.0 * k for k in range(len(first))]
    assert found["count"].sum() == 2
    if start == 0.0:
        assert found["count"].tolist() == [1, 0, 1, 0]
        assert found.t_to.tolist() == [15.0, 30.0, 45.0, 60.0]


def test_an_interval_that_the_recording_just_fills_has_no_empty_one_behind(tmp_path):
    found = counted(late_run(tmp_path), tmp_path, "--interval", "20")
    assert found["count"].tolist() == [1, 1, 0]


def test_of_a_table_alone_the_first_interval_is_that_of_its_first_row(tmp_path):
    found = counted(late_run(tmp_path, alone=True) / "causal.csv", tmp_path, "--interval", "10")
    assert found.t_from.tolist() == [10.0, 20.0, 30.0]
    assert found["count"].tolist() == [1, 0, 1]


def test_a_line_that_nobody_crosses_counts_none_in_both_directions(tmp_path):
    found = counted(late_run(tmp_path), tmp_path, "--interval", "30", "--line", "other=0,5000,100,5000")
    other = found[found.line == "other"]
    assert other.direction.tolist() == ["left", "left", "right", "right"]
    assert other["count"].tolist() == [0, 0, 0, 0]


MARKS = "lines: {gate: [0, 50, 100, 50]}\nzones: {below: [[0, 60], [100, 60], [100, 120], [0, 120]]}\n"


def test_lines_and_zones_come_from_one_file(run, tmp_path):
    (tmp_path / "marks.yaml").write_text(MARKS + "masks: {sky: [[0, 0], [9, 0], [9, 9]]}\n")
    out, od = tmp_path / "counts.csv", tmp_path / "od.csv"
    words = ["count", str(run), "--lines", str(tmp_path / "marks.yaml"), "--out", str(out), "--od", str(od)]
    assert main(words) == 0
    counts = pd.read_csv(out).set_index(["line", "direction"])["count"]
    assert counts.to_dict() == {
        ("gate", "left"): 1,
        ("gate", "right"): 2,
        ("below", "in"): 2,
        ("below", "out"): 1,
    }
    ways = pd.read_csv(od, keep_default_na=False)
    assert ways.set_index(["origin", "destination"])["count"].to_dict() == {
        ("gate", "gate"): 0,
        ("gate", "below"): 2,
        ("gate", ""): 0,
        ("below", "gate"): 1,
        ("below", "below"): 0,
        ("below", ""): 0,
    }


def test_a_zone_is_given_by_its_corners(run, tmp_path):
    out = tmp_path / "counts.csv"
    assert main(["count", str(run), "--zone", "0,60,100,60,100,120,0,120", "--out", str(out)]) == 0
    assert pd.read_csv(out).set_index("direction")["count"].to_dict() == {"in": 2, "out": 1}


def test_complete_counts_have_every_direction_and_interval(tmp_path):
    found = counted(late_run(tmp_path), tmp_path, "--interval", "15", "--complete")
    assert found.direction.tolist() == ["left"] * 4 + ["right"] * 4
    assert found["count"].tolist() == [0, 0, 0, 0, 1, 0, 1, 0]


def test_intervals_are_of_the_clock_that_is_given(tmp_path):
    found = counted(late_run(tmp_path), tmp_path, "--interval", "30", "--begin", "2026-11-27T07:29:50")
    assert found.begin.tolist() == [
        "2026-11-27T07:29:30",
        "2026-11-27T07:30:00",
        "2026-11-27T07:30:30",
    ]
    assert found["count"].tolist() == [0, 2, 0]  # at 07:30:03.2 and 07:30:24.4
    assert found.t_from.tolist()[1] % 30 == 0


def test_stations_have_a_record_of_each_direction_and_interval(run, tmp_path):
    out = tmp_path / "stations.csv"
    words = ["count", str(run), "--line", "gate=0,50,100,50", "--interval", "1", "--stations", str(out)]
    assert main(words) == 0
    rows = pd.read_csv(out).set_index(["direction", "t_from"])
    assert rows.loc[("right", 0.0), "flow"] == 2
    assert rows.loc[("left", 0.0), "flow"] == 1
    # Boxes of 10 px at 100 px/s, two of them at .5 and .8 s.
    assert rows.loc[("right", 0.0), "occupancy"] == pytest.approx(20.0)
    assert rows.loc[("right", 0.0), "headway_s"] == pytest.approx(0.3)


def test_lanes_and_speeds_come_from_what_road_wrote(run, tmp_path):
    road, out = tmp_path / "road", tmp_path / "stations.csv"
    road.mkdir()
    (road / "crossings.csv").write_text(
        "track_id,line,t,lane,speed_kmh\n1,gate,0.5,lane-1,50\n2,gate,0.8,,\n"
    )
    words = ["count", str(run), "--line", "gate=0,50,100,50", "--stations", str(out), "--road", str(road)]
    assert main(words) == 0
    rows = pd.read_csv(out).query("direction == 'right'").set_index("lane")
    assert rows.loc["lane-1", "speed_kmh"] == 50.0
    assert rows.loc["lane-1", "flow"] == 1
    assert rows.flow.tolist() == [1, 1]


def test_numbers_have_the_digits_that_mean_something(run, tmp_path):
    """No 17 digits: times to a ms, flows to a tenth of a vehicle an hour."""
    names = ("counts", "single", "stations", "od")
    counts, single, stations, od = (tmp_path / f"{name}.csv" for name in names)
    words = [
        "count",
        str(run),
        "--line",
        "gate=0,49.7,100,50.1",
        "--line",
        "b=0,20,100,20",
        "--interval",
        "0.7",
    ]
    more = ["--out", str(counts), "--crossings", str(single), "--stations", str(stations), "--od", str(od)]
    assert main([*words, *more]) == 0
    decimals = {
        "t": 3,
        "t_from": 3,
        "t_to": 3,
        "expected": 3,
        "headway_s": 3,
        "occupancy": 2,
    }
    seen = set()
    for path in (counts, single, stations, od):
        for name, column in pd.read_csv(path, dtype=str).items():
            longest = max((len(text.partition(".")[2]) for text in column.dropna()), default=0)
            assert longest <= decimals.get(name, 12), (path.name, name)
            seen.add(name)
    assert set(decimals) <= seen
    assert pd.read_csv(stations).flow_per_hour.isna().all()  # of 0.7 s nothing an hour is told


def test_detections_are_to_be_tracked_first(tmp_path, fails):
    path = tmp_path / "cam.csv"
    path.write_text("t,sensor,left,top,width,height,score\n0,rgb,1,2,3,4,0.9\n")
    assert "run `jeat-graph track` on them first" in fails("count", str(path), "--line", "0,0,9,9")


DATEX = ["--begin", "2026-11-27T07:30:00+01:00", "--publisher", "de:city-of-bonn", "--datex", "d.xml"]


def test_stations_as_measured_data_of_datex_ii(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["count", str(run), "--line", "gate=0,50,100,50", "--interval", "1", *DATEX]
    assert main(words) == 0
    first = (tmp_path / "d.xml").read_bytes()
    text = first.decode()
    assert "<com:country>DE</com:country>" in text
    assert "<com:publicationTime>2026-11-27T07:30:01+01:00<" in text  # the recording lasts for a second
    assert text.count('id="gate-right"') == 1
    assert "<com:startOfPeriod>2026-11-27T07:30:00+01:00<" in text
    assert "<com:dataError>true<" in text  # of a second no flow an hour is told
    assert "<com:percentage>20<" in text
    assert main(words) == 0
    assert (tmp_path / "d.xml").read_bytes() == first
    assert main([*words, "--publication-time", "2026-11-28T00:00:00Z", "--site-table", "bridges"]) == 0
    text = (tmp_path / "d.xml").read_text()
    assert "<com:publicationTime>2026-11-28T00:00:00+00:00<" in text
    assert 'targetClass="roa:MeasurementSiteTable" id="bridges"' in text


def test_the_table_of_sites_is_written_beside_the_data(run, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "places.csv").write_text("station,latitude,longitude,bearing\ngate,50.7353,7.1002,\n")
    words = ["count", str(run), "--line", "gate=0,50,100,50", "--interval", "1", *DATEX]
    assert main([*words, "--site-places", "places.csv", "--site-table", "bridges"]) == 0
    data, sites = (tmp_path / name for name in ("d.xml", "d.sites.xml"))
    named = set(re.findall(r'MeasurementSite" id="([^"]+)"', data.read_text()))
    told = set(re.findall(r'<roa:measurementSite id="([^"]+)"', sites.read_text()))
    assert named == told != set()
    assert '<roa:measurementSiteTable id="bridges" version="1">' in sites.read_text()
    data.unlink()
    sites.unlink()
    (tmp_path / "places.csv").write_text("station,latitude,longitude\nbridge,50.7353,7.1002\n")
    assert main([*words, "--site-places", "places.csv"]) == 2
    assert "has no place: bridge have one" in capsys.readouterr().err
    assert not data.exists()
    assert not sites.exists()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ([], "nothing to count at: give --line, --zone or --lines"),
        (["--zone", "1,2,3,4"], "must be 3 corners or more"),
        (["--zone", "a=1,2,x"], "must read x1,y1"),
        (["--line", "a=0,0,1,1", "--zone", "a=0,0,1,1,2,0"], "a is the name of two lines or zones"),
        (["--line", "0,0,1,1", "--begin", "yesterday"], "--begin yesterday: must be a date and time"),
        (
            ["--line", "0,0,1,1", "--od", "od.csv"],
            "--od counts ways from one line or zone to another, and there is only one",
        ),
        (["--zone", "0,0,1,1,2,0", "--stations", "s.csv"], "--stations is of lines"),
        (
            ["--line", "0,0,1,1", "--datex", "d.xml"],
            "--datex needs the date and time of the recording's time 0",
        ),
        (["--line", "0,0,1,1", *DATEX[4:], "--begin", "2026-11-27T07:30:00"], "--datex needs a time zone"),
        (["--line", "0,0,1,1", *DATEX[4:], *DATEX[:2]], "--datex needs who publishes: --publisher CC:NAME"),
        (["--line", "0,0,1,1", *DATEX, "--publisher", "Bonn"], "--datex needs who publishes"),
        (
            ["--line", "0,0,1,1", *DATEX, "--publication-time", "now"],
            "--publication-time now: must be a date",
        ),
        (["--line", "0,0,1,1", *DATEX[2:4]], "--publisher says nothing without --datex"),
        (["--zone", "0,0,1,1,2,0", *DATEX], "is of lines"),
        (["--line", "0,0,1,1", "--road", "road"], "--road says nothing without --stations"),
        (["--lines", "marks.yaml"], "marks.yaml: must hold lines: {name: [x1, y1, x2, y2]} or zones"),
    ],
)
def test_what_cannot_be_counted_is_one_clear_line(run, tmp_path, monkeypatch, fails, more, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "marks.yaml").write_text("masks: {sky: [[0, 0], [9, 0], [9, 9]]}\n")
    assert words in fails("count", str(run), *more)
    assert not list(tmp_path.glob("o*.csv"))


@pytest.mark.parametrize("needs", [("--line", "0,0,1,1", "--od"), ("--zone", "0,0,1,1,2,0", "--stations")])
def test_too_few_places_are_refused_before_anything_is_read_or_written(tmp_path, monkeypatch, fails, needs):
    monkeypatch.chdir(tmp_path)
    said = fails("count", "no-such-run", *needs, "table.csv", "--out", "c.csv", "--crossings", "x.csv")
    assert "no-such-run" not in said
    assert list(tmp_path.iterdir()) == []


def dated(tmp_path):
    """A vehicle that passes x = 260 px on the first of May, by dates with a zone."""
    rows = [f"2026-05-01T08:00:{k / 10:06.3f}+02:00,1,{200 + 15 * k},300,80,50\n" for k in range(20)]
    path = tmp_path / "dated.csv"
    path.write_text("t,track_id,left,top,width,height\n" + "".join(rows))
    return path


def test_dates_of_a_table_are_its_clock_and_begin_gives_the_zone(tmp_path):
    """Not the sum of both, in the year 2082."""
    line = ["--line", "260,0,260,720", "--interval", "60", "--out", str(tmp_path / "n.csv")]
    for begin, hour in (("2026-05-01T08:00:00+02:00", "08"), ("2026-05-01T06:00:00Z", "06")):
        assert main(["count", str(dated(tmp_path)), *line, "--begin", begin]) == 0
        found = pd.read_csv(tmp_path / "n.csv")
        assert found.begin[0].startswith(f"2026-05-01T{hour}:00:00")
        assert found["count"].tolist() == [1]


def test_another_begin_than_the_table_has_is_refused(tmp_path, capsys):
    command = [
        "count",
        str(dated(tmp_path)),
        "--line",
        "260,0,260,720",
        "--begin",
        "2026-05-02T08:00:00+02:00",
    ]
    assert main(command) == 2
    assert "has dates of its own, from 2026-05-01T08:00:00+02:00 on" in capsys.readouterr().err


def test_an_empty_table_has_the_columns_kinds_of_a_full_one(tmp_path):
    from pyarrow import parquet

    head = "t,track_id,left,top,width,height\n"
    (tmp_path / "none.csv").write_text(head)
    (tmp_path / "one.csv").write_text(head + "0,1,10,300,80,50\n1,1,500,300,80,50\n2,1,900,300,80,50\n")
    kinds = []
    for name in ("none", "one"):
        out = tmp_path / f"{name}.parquet"
        line = ["--line", "400,0,400,720", "--crossings", str(out)]
        assert main(["count", str(tmp_path / f"{name}.csv"), *line]) == 0
        kinds.append([(field.name, str(field.type)) for field in parquet.read_schema(out)])
    assert kinds[0] == kinds[1]
