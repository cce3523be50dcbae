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
