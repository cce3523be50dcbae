"""The page's script and style sheet: they parse, and the script's pure functions say what they should."""

from __future__ import annotations

import itertools
import json
import math
import re
import shutil
import subprocess
from importlib.resources import files
from pathlib import Path

import pytest

from jeat_graph.drawing.palette import DAY, NIGHT

NODE = shutil.which("node")
SCRIPT = files("jeat_graph.drawing.page") / "page.js"
CSS = (files("jeat_graph.drawing.page") / "page.css").read_text(encoding="utf-8")
needs_node = pytest.mark.skipif(NODE is None, reason="no node on PATH")


def ask(*questions):
    """Answers of the script's pure functions."""
    command = [NODE, str(Path(__file__).with_name("pure_functions.mjs")), str(SCRIPT)]
    done = subprocess.run(command, input=json.dumps(questions), capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


@needs_node
def test_the_script_parses_and_a_broken_one_would_not(tmp_path):
    assert subprocess.run([NODE, "--check", str(SCRIPT)], check=False).returncode == 0
    broken = tmp_path / "broken.js"
    broken.write_text(SCRIPT.read_text(encoding="utf-8").replace("=> {", "=> {{", 1), encoding="utf-8")
    assert subprocess.run([NODE, "--check", str(broken)], capture_output=True, check=False).returncode != 0


@needs_node
def test_the_last_entry_not_above_a_value_is_found():
    times = [0, 10, 20, 20, 30]
    questions = [-1, 0, 5, 20, 29, 30, 99]
    assert ask(*(["last", times, t] for t in questions)) == [
        sum(one <= t for one in times) - 1 for t in questions
    ]
    curve = {"t": [0, 10], "v": [0.5, None], "s": [1.5, 2.5]}
    assert ask(["at", curve, -1], ["at", curve, 9], ["at", curve, 10], ["at", curve, 12, "s"]) == [
        None,
        0.5,
        None,
        2.5,
    ]


@needs_node
@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-3.2, 7.9), (0.001, 0.0042), (1e5, 1.3e5)])
def test_ticks_are_round_evenly_spaced_within_the_range_and_not_too_many(low, high):
    (ticks,) = ask(["ticks", low, high, 4])
    steps = [b - a for a, b in itertools.pairwise(ticks)]
    assert 2 <= len(ticks) <= 5
    assert steps == pytest.approx([steps[0]] * len(steps))
    leading = steps[0] / 10.0 ** math.floor(math.log10(steps[0]) + 1e-9)
    assert min(abs(leading - wanted) for wanted in (1.0, 2.0, 5.0)) < 1e-6
    assert all(low - 1e-9 <= tick <= high + 1e-9 * (high - low) + 1e-9 for tick in ticks)


@needs_node
def test_the_range_leaves_one_wild_value_out_and_holds_zero_if_asked():
    calm = [1.0 + k / 1000 for k in range(500)]
    (low, high), (with_zero, _), empty = ask(
        ["range", [[*calm, 1e6]]], ["range", [calm], True], ["range", [[None]]]
    )
    assert low < 1.02
    assert 1.4 < high < 2.0
    assert with_zero < 0.0
    assert empty == [0, 1]


@needs_node
def test_numbers_are_written_with_three_digits_and_absent_ones_as_a_dash():
    values = [None, 1.234, 12.34, -123.4]
    assert ask(*(["number", v] for v in values)) == ["–", "1.23", "12.3", "-123"]
    assert ask(["seconds", 1234], ["label", 0.30000000000000004], ["twice", [1, None], -1]) == [
        "1.73 s",
        "0.3",
        [-2, None],
    ]


@needs_node
def test_a_track_without_diagnostics_has_the_panels_that_its_table_allows():
    curve = {"t": [0, 10], "v": [0.5, 1.0]}
    motion = {"t": [0, 10], "vx": [1, 2], "svx": [1, 1], "vy": [0, 0], "svy": [1, 1]}
    track = {"from": 0, "to": 10, "bin": 1, "used": [[0], [1]], "existence": curve, "motion": motion}
    (panels,) = ask(["panels", track])
    assert [one["title"].split(" (")[0] for one in panels] == [
        "Which sensor gave a detection",
        "Existence probability",
        "Velocity x",
        "Velocity y",
    ]


def test_every_colour_of_the_style_sheet_is_declared_and_braces_are_closed():
    declared = set(re.findall(r"(--[a-z0-9-]+):", CSS))
    assert set(re.findall(r"var\((--[a-z0-9-]+)\)", CSS)) - declared == {"--h"}  # set on each track
    assert CSS.count("{") == CSS.count("}")


@pytest.mark.parametrize(("theme", "block"), [(DAY, 0), (NIGHT, 1)])
def test_what_the_page_and_the_picture_of_a_run_share_has_one_colour(theme, block):
    colours = dict(re.findall(r"(--[a-z0-9-]+): (#[0-9a-f]{6})", CSS.split(":root {")[block + 1]))
    assert (colours["--paper"], colours["--plane"]) == (theme.paper, theme.picture)
    assert [colours[f"--s{k}"] for k in (0, 1, 3)] == [theme.single[k] for k in (0, 1, 3)]
