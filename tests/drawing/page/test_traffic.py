"""The page of traffic: its numbers are those of the tables."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.drawing.page.passages import read_traffic
from jeat_graph.drawing.page.traffic import render_traffic, v85

#: 7:00 of a day in the zone +01:00 (s since 1970).
SEVEN = 1795759200.0


@pytest.fixture
def road(tmp_path):
    folder = tmp_path / "measured"
    folder.mkdir()
    rng = np.random.default_rng(0)
    rows = ["track_id,line,t,time,lane,speed_kmh,low_kmh,high_kmh,direction"]
    for k in range(60):
        t, way = SEVEN + 30.0 * k + 5.0, "left" if k % 3 else "right"
        speed = "" if k == 7 else f"{80.0 + 5.0 * rng.standard_normal():.1f}"
        rows.append(f"{k},gate,{t},2026-11-27T07:00:00+01:00,1,{speed},,,{way}")
    (folder / "crossings.csv").write_text("\n".join(rows))
    kinds = [f"{k},1,{'truck' if k % 5 == 0 else 'car'}" for k in range(60)]
    (folder / "speeds.csv").write_text("\n".join(["track_id,lane,class", *kinds]))
    counts = [f"gate,{SEVEN + a},{SEVEN + b},{o}" for a, b, o in ((0, 900, 100), (900, 1800, 100))]
    (folder / "counts.csv").write_text("\n".join(["line,t_start,t_end,observed", *counts]))
    (folder / "left_out.csv").write_text(
        "track_id,t_first,t_last,reason,line\n77,1,2,too little of it is on the road,\n"
    )
    return folder


def test_a_table_by_interval_direction_and_class_has_all_vehicles(road):
    page = render_traffic(read_traffic(road), 900.0)
    rows = re.findall(r"<tr>(.*?)</tr>", page.split("</table>")[0])
    head = re.findall(r"<th[^>]*>(.*?)</th>", rows[0])
    cells = [dict(zip(head, re.findall(r"<td[^>]*>(.*?)</td>", row), strict=True)) for row in rows[1:]]
    assert [row["from"] for row in cells] == ["27.11. 07:00", "27.11. 07:15", "all"]
    assert [int(row["left all"]) for row in cells] == [20, 20, 40]
    assert [int(row["right car"]) + int(row["right truck"]) for row in cells] == [10, 10, 20]
    assert [int(row["right truck"]) for row in cells] == [2, 2, 4]
    assert "1 × a track: too little of it is on the road" in page
    assert "1 × counted, but the speed is not known" in page
    assert "v85 km/h" in page
    assert "@media print" in page
    assert "http" not in page.replace("http-equiv", "")


def test_v85_holds_that_of_the_traffic():
    """Speeds drawn from a normal distribution: 95 % of the intervals hold its 85th percentile."""
    rng, true = np.random.default_rng(1), 80.0 + 8.0 * 1.0364333894937898
    found = [v85(80.0 + 8.0 * rng.standard_normal(60)) for _ in range(300)]
    held = np.mean([low <= true <= high for _, low, high in found])
    assert 0.92 <= held <= 0.995
    assert all(low <= value <= high for value, low, high in found)
    assert v85(np.array([50.0, 60.0]))[2] == np.inf


def test_the_command_draws_ways_as_wide_as_many(road, tmp_path, capsys):
    od = tmp_path / "od.csv"
    od.write_text("origin,destination,t_from,t_to,count\nn,s,0,9,30\nn,,0,9,10\ns,n,0,9,0\n")
    out = tmp_path / "page.html"
    assert main(["report", str(road), "--od", str(od), "--interval", "300", "--out", str(out)]) == 0
    assert "60 crossings" in capsys.readouterr().out
    page = out.read_text()
    assert "n to s: 30" in page
    assert "n to not known: 10" in page
    assert "s to n" not in page
    bands = re.findall(r'd="M160.0 ([\d.]+)C[^V]*V[\d.]+C.*? 160.0 ([\d.]+)Z"', page)
    wide = [float(b) - float(a) for a, b in bands]
    assert sorted(wide) == pytest.approx([95.0, 285.0], abs=0.2)  # 380 px for 40 vehicles
    again = tmp_path / "again.html"
    main(["report", str(road), "--od", str(od), "--interval", "300", "--out", str(again)])
    assert again.read_bytes() == out.read_bytes()


def test_a_table_of_crossings_is_a_page_too_and_what_it_lacks_is_said(tmp_path, capsys):
    table = tmp_path / "crossings.csv"
    rows = [f"n,{k},{10.0 * k},right,1" for k in range(20)]
    table.write_text("\n".join(["line,track_id,t,direction,probability", *rows]))
    out = tmp_path / "page.html"
    assert main(["report", str(table), "--interval", "60", "--out", str(out)]) == 0
    page = out.read_text()
    assert "No speeds are known" in page
    assert "Begin and end of the recording are not known" in page
    starts = re.findall(r"<td>(\d+):00 min</td>", page)
    assert [int(b) - int(a) for a, b in pairwise(starts)] == [1, 1, 1]
    assert main(["report", str(table), "--gt", "gt.csv", "--out", str(out)]) == 2
    assert "--gt is of a run" in capsys.readouterr().err


@pytest.fixture
def through(tmp_path):
    folder = tmp_path / "through"
    folder.mkdir()
    head = "from,to,begin,end,class,vehicles,expected,mean_s,low_s,high_s,median_s"
    rows = [
        f"A,B,{SEVEN},{SEVEN + 900},all,40,41.2,18.26,17.9,18.6,18.0",
        f"A,B,{SEVEN},{SEVEN + 900},car,30,30.9,17.5,17.1,17.9,17.3",
        f"A,B,{SEVEN + 900},{SEVEN + 1800},all,0,0.2,,,,",
    ]
    (folder / "travel_times.csv").write_text("\n".join([head, *rows]) + "\n")
    ways = ["begin,end,from,to,vehicles,expected,low,high", "0,900,A,B,38,1,1,1", "0,900,A,A,5,1,1,1"]
    ways += ["900,1800,A,B,2,1,1,1"]
    (folder / "od.csv").write_text("\n".join(ways) + "\n")
    return folder


def test_travel_times_and_ways_of_a_handover_are_on_the_page(road, through, tmp_path):
    out = tmp_path / "page.html"
    assert main(["report", str(road), "--through", str(through), "--out", str(out)]) == 0
    part = out.read_text().split("<h2>Travel times</h2>")[1]
    rows = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", part)]
    first = ["27.11. 07:00", "27.11. 07:15", "all", "40", "41", "18.3", "17.9 to 18.6"]
    assert first in rows
    assert ["27.11. 07:15", "27.11. 07:30", "all", "0", "0"] in [row[:5] for row in rows]
    assert ["A", "B", "40"] in rows
    assert ["A", "A", "5"] in rows
    assert part.count("<rect") == 1  # of the interval in which somebody was followed
    # What was drawn is what the table says: the band from 17.9 to 18.6 s, the greatest being 1.1 × 18.6.
    tall = float(re.search(r'<rect [^>]*height="([\d.]+)"', part)[1])
    assert tall == pytest.approx((220 - 26 - 10) * 0.7 / (1.1 * 18.6), abs=0.1)


def test_a_folder_without_travel_times_is_refused(road, tmp_path, capsys):
    assert main(["report", str(road), "--through", str(road), "--out", str(tmp_path / "x.html")]) == 2
    assert "travel_times.csv" in capsys.readouterr().err
    assert not (tmp_path / "x.html").exists()
