"""The page of a recount: pairs one to one, Wilson's intervals, and nothing shown before the end."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest

import jeat_graph.drawing.page
from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.drawing.page.head import beside
from jeat_graph.drawing.page.passages import Passed
from jeat_graph.drawing.page.recount import Film, drawn_stretches, render_recount
from jeat_graph.eval.counting import Line, crossings
from jeat_graph.eval.zones import Zone

NORTH = Line(100, 200, 500, 200, "north")
FILM = Film(Path("a.mp4"), (640, 480))
NODE = shutil.which("node")
needs_node = pytest.mark.skipif(NODE is None, reason="no node on PATH")


def script(expression, tmp_path):
    """Value of an expression with the functions of the page."""
    file = tmp_path / "recount.js"
    file.write_text(beside(jeat_graph.drawing.page.__name__, "recount.js"), encoding="utf-8")
    text = f"const m = require({json.dumps(str(file))}); console.log(JSON.stringify({expression}))"
    out = subprocess.run([NODE, "-e", text], capture_output=True, text=True, timeout=60, check=True)
    return json.loads(out.stdout)


@needs_node
def test_the_interval_is_wilsons(tmp_path):
    cases = [(0, 10), (7, 10), (10, 10), (193, 200), (1, 1)]
    found = script(f"{json.dumps(cases)}.map(([a, b]) => m.wilson(a, b))", tmp_path)
    for (hits, of), ends in zip(cases, found, strict=True):
        want = binomtest(hits, of).proportion_ci(method="wilson")
        assert ends == pytest.approx([want.low, want.high], abs=1e-9)


@needs_node
def test_vehicles_are_paired_one_to_one_within_reach(tmp_path):
    """A third is missed, one is wrong, and one just before the begin excuses the key that came late."""
    person, counter = [10.1, 12.0, 20.0, 30.4], [9.9, 12.5, 25.0, 30.0]
    found = script(f"m.compare({person}, {counter}, 10, 40, 2)", tmp_path)
    assert found == {"hits": 2, "missed": 1, "wrong": 1}
    assert script("m.compare([], [9.5, 40.5], 10, 40, 2)", tmp_path) == {"hits": 0, "missed": 0, "wrong": 0}
    both = script("m.compare([10, 10.2], [10.1], 0, 40, 2)", tmp_path)
    assert both == {"hits": 1, "missed": 1, "wrong": 0}


@needs_node
def test_all_stretches_and_only_the_direction_count(tmp_path):
    stretches = [
        {"begin": 0, "end": 10, "counted": {"left": [1, 5], "right": [2]}},
        {"begin": 20, "end": 30, "counted": {"left": [21], "right": []}},
    ]
    presses = [
        [{"t": 5.3, "direction": "left"}, {"t": 1.2, "direction": "left"}],
        [{"t": 28, "direction": "left"}],
    ]
    found = script(f"m.summary({json.dumps(stretches)}, {json.dumps(presses)}, 'left', 2)", tmp_path)
    assert (found["hits"], found["missed"], found["wrong"], found["seen"], found["told"]) == (2, 1, 1, 3, 3)


def test_stretches_are_whole_do_not_overlap_and_are_all_as_likely():
    count = np.zeros(10)
    for seed in range(400):
        found = drawn_stretches((3.0, 609.0), 60.0, 4, seed)
        assert [round(one.end - one.begin, 9) for one in found] == [60.0] * 4
        assert all(a.end <= b.begin for a, b in pairwise(found))
        count[[round((one.begin - 3.0) / 60.0) for one in found]] += 1
    assert np.abs(count - 160.0).max() < 5.0 * np.sqrt(400 * 0.4 * 0.6)
    assert len(drawn_stretches((0.0, 130.0), 60.0, 4, 0)) == 2
    with pytest.raises(DataError, match="no stretch of 60 s fits"):
        drawn_stretches((0.0, 59.0), 60.0, 4, 0)


def test_the_page_holds_the_counters_times_of_the_stretches_alone(tmp_path):
    passed = [Passed("north", "left" if k % 2 else "right", "", 10.0 * k, np.nan) for k in range(30)]
    page = render_recount(
        [*passed, Passed("south", "left", "", 61.0, np.nan)],
        drawn_stretches((0.0, 300.0), 60.0, 1, 1),
        NORTH,
        Film(tmp_path / "videos" / "a b.mp4", (640, 480)),
        tmp_path / "page.html",
    )
    data = json.loads(re.search(r'id="data">(.*?)</script>', page).group(1))
    (one,) = data["stretches"]
    times = sorted(one["counted"]["left"] + one["counted"]["right"])
    assert times == [t for t in np.arange(0.0, 300.0, 10.0) if one["begin"] - 2.0 <= t < one["end"] + 2.0]
    assert 'src="videos/a%20b.mp4"' in page
    with pytest.raises(DataError, match="there are: north"):
        render_recount(passed, [], replace(NORTH, name="east"), FILM, tmp_path / "page.html")


def texts_of(page):
    found = re.findall(r'<text x="([-\d.]+)" y="([-\d.]+)">(.*?)</text>', page)
    return {text: (float(x), float(y)) for x, y, text in found}


def test_the_line_is_drawn_with_the_keys_at_the_sides_that_they_are_of(tmp_path):
    passed = [Passed("north", way, "", 5.0, np.nan) for way in ("left", "right")]
    page = render_recount(passed, [], NORTH, FILM, tmp_path / "page.html")
    assert 'viewBox="0 0 640 480"' in page
    assert 'points="100,200 500,200"' in page
    texts = texts_of(page)
    # Who stands on the first point and looks at the second, to the right, has left above.
    assert texts["← left"][0] == texts["→ right"][0] == 300.0
    assert texts["← left"][1] < 200.0 < texts["→ right"][1]
    back = render_recount(passed, [], Line(500, 200, 100, 200, "north"), FILM, tmp_path / "page.html")
    assert texts_of(back)["→ right"][1] < 200.0 < texts_of(back)["← left"][1]


def test_the_sides_are_those_of_the_counter():
    t, y = np.arange(9.0), np.linspace(300.0, 100.0, 9)
    mean = np.zeros((9, 6))
    mean[:, 0], mean[:, 1] = 300.0, y
    boxes = np.stack([np.full(9, 290.0), y - 10.0, np.full(9, 20.0), np.full(9, 20.0)], axis=1)
    tracks = Trajectories(
        t, np.ones(9, dtype=np.int64), boxes, np.ones(9), mean, np.full((9, 6), 1e-4),
        np.ones(9, dtype=np.int64), ("rgb",),
    )  # fmt: skip
    (one,) = crossings(tracks, NORTH)
    assert one.direction == "left", "from below to above"


def test_a_zone_is_drawn(tmp_path):
    passed = [Passed("yard", way, "", 5.0, np.nan) for way in ("in", "out")]
    zone = Zone("yard", ((10.0, 10.0), (110.0, 10.0), (60.0, 100.0)))
    page = render_recount(passed, [], zone, FILM, tmp_path / "page.html")
    assert 'points="10,10 110,10 60,100"' in page
    assert texts_of(page)["← in, → out"] == (60.0, 40.0)


def test_where_the_line_is_has_to_be_said(tmp_path, capsys):
    table, marks = tmp_path / "crossings.csv", tmp_path / "marks.yaml"
    table.write_text("line,track_id,t,direction\nn,1,5,left\n")
    marks.write_text("lines: {south: [0, 0, 9, 9]}\n")
    words = ["recount", str(table), "--video", "a.mp4", "--line", "n", "--out", str(tmp_path / "page.html")]
    assert main(words) == 2
    assert "say where 'n' is: --lines FILE.yaml, or --line n=X1,Y1,X2,Y2" in capsys.readouterr().err
    assert main([*words, "--lines", str(marks)]) == 2
    assert "has no line or zone 'n': south" in capsys.readouterr().err


def test_times_of_a_clock_are_refused(tmp_path, capsys):
    table = tmp_path / "crossings.csv"
    table.write_text("line,track_id,t,time,direction\nn,1,5,1970-01-01T00:00:05,left\n")
    words = ["recount", str(table), "--video", "a.mp4", "--line", "n=0,0,9,9"]
    assert main([*words, "--out", str(tmp_path / "page.html")]) == 2
    assert "has times of a clock" in capsys.readouterr().err
