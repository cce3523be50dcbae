"""`benchmarks constants`: choosing with a set left out, the page, and what the command refuses."""

from __future__ import annotations

import argparse
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.constant_moves import single_moves
from benchmarks.constant_scores import RESAMPLED
from benchmarks.constants import answers
from benchmarks.constants_page import tables
from benchmarks.leaving_out import (
    DIRECTION,
    NEAR_SPREAD,
    SHIPPED,
    START,
    START_SPREAD,
    WITH,
    WITHOUT,
    Study,
    most_influential,
    unnoticed,
)
from benchmarks.simulated_sets import simulated
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.io.tables.detections_io import write_detections
from jeat_graph.io.tables.truth_io import write_truth

BEST = {"near": 2.0, "far": 6.0, "farther": 18.0}
FACTOR = 1.2
NAMES = ("jerk", "cut_gate", "growth_noise")


class Parabolas:
    """Scores that fall with the squared ln distance of `jerk` from each set's own best."""

    def fill(self, points, smoothed=False):
        """Nothing needs to be tracked."""

    def samples(self, point, kind="causal"):
        """MOTA alone changes; no recording differs from another."""
        away = math.log(point.constants.jerk / BEST[point.group.name])
        scores = [80.0 - 10.0 * away**2 - 0.001 * point.constants.cut_gate, 60.0, 70.0]
        return np.tile(scores, (1 + RESAMPLED, 1))


@pytest.fixture
def study():
    sets = [SimpleNamespace(name=name, recordings=(None,) * 3) for name in BEST]
    return Study(sets, Parabolas(), ModelConstants(jerk=6.0))


@pytest.fixture
def found(study):
    asked = argparse.Namespace(most=1, seeds=[0, 1], sweeps=1)
    return answers(study, NAMES, [1.0 / FACTOR, FACTOR], asked)


def nearest(wanted, start):
    """The closed form: of what steps reach from a start, the best of a parabola around `wanted`."""
    return start * FACTOR ** round(math.log(wanted / start) / math.log(FACTOR))


@pytest.mark.parametrize("left_out", BEST)
def test_constants_come_to_the_best_of_the_other_sets(study, left_out):
    others = [math.log(best) for name, best in BEST.items() if name != left_out]
    best = math.exp(sum(others) / len(others))
    moves = single_moves(["jerk"], [1.0 / FACTOR, FACTOR])
    assert study.direction(moves, 1)[left_out].point.jerk == pytest.approx(nearest(best, 6.0))
    for seed in range(3):
        chosen = study.from_random(moves, seed, 2)
        assert abs(math.log(chosen.start.jerk / 6.0)) <= math.log(START_SPREAD)
        assert chosen.without[left_out].point.jerk == pytest.approx(nearest(best, chosen.start.jerk))
        # The mean of all three logarithms is that of the one in the middle.
        assert chosen.chosen.point.jerk == pytest.approx(nearest(6.0, chosen.start.jerk))


def test_a_set_has_less_of_what_was_chosen_without_it_and_the_rows_say_so(found):
    rows = {(row["set"], row["label"]): row["causal"] for row in found["rows"]}
    for name, best in BEST.items():
        shipped = rows[name, SHIPPED]
        assert shipped["change"] == 0.0
        assert shipped["scores"][0] == pytest.approx(80.0 - 10.0 * math.log(6.0 / best) ** 2, abs=0.1)
    for name in ("near", "farther"):
        assert rows[name, DIRECTION]["change"] < -1.0
        assert rows[name, WITHOUT]["change"] < rows[name, WITH]["change"] - 1.0
        assert rows[name, DIRECTION]["change_error"] == pytest.approx(0.0, abs=1e-12)
    starts = {row["set"] for row in found["rows"] if row["label"] == START}
    assert starts == set(BEST)


def test_constants_that_matter_come_first_and_those_that_no_set_notices_are_named(found):
    assert most_influential(found["singles"], 3) == ["jerk", "cut_gate", "growth_noise"]
    assert found["searched"] == ["jerk"]
    assert unnoticed(found["singles"]) == ["cut_gate", "growth_noise"]
    jerk = next(row for row in found["singles"] if row["name"] == "jerk")
    assert "smoothed" not in jerk
    assert jerk["change"] == pytest.approx(sum(jerk["by_set"].values()))
    # From ln distances −ln 3, 0 and ln 3 a step s costs 10 s² in each, and the first and last cancel.
    assert jerk["change"] == pytest.approx(-30.0 * math.log(FACTOR) ** 2)


def test_points_near_the_shipped_ones_scatter_as_their_factors_do(study, found):
    jerks = [point.jerk for point in study.near(NAMES, 50)]
    assert max(abs(math.log(one / 6.0)) for one in jerks) <= math.log(NEAR_SPREAD)
    assert len(set(jerks)) == 50
    row = next(r for r in found["rows"] if r["label"] == "near the shipped" and r["set"] == "farther")
    # 80 − 10 (ln 3 − x)²: the slope is 20 ln 3, and x is even within ±ln 1.05.
    assert row["causal"]["spread"] == pytest.approx(
        20.0 * math.log(3.0) * math.log(NEAR_SPREAD) / math.sqrt(3.0), rel=0.5
    )


def test_tables_show_the_changes_with_their_errors(found):
    shown = tables(found)
    assert list(shown) == ["constants-mean", "constants-sets", "constants-direction", "constants-influence"]
    direction = shown["constants-direction"].render("markdown")
    # Without `near` the best is 6 √3, three steps up; without `farther` it is as many down.
    assert "| jerk × 1.2, 3 times; " in direction
    assert "| jerk × 0.833333, 3 times; " in direction
    influence = shown["constants-influence"].render("markdown")
    assert "| `jerk` | 6 | -1.0±0.0 | -1.0±0.0 | -4.3 farther (× 0.833333) | 2 |" in influence
    sets = shown["constants-sets"].render("text")
    assert "80.0±0.0 / 60.0±0.0 / 70.0±0.0" in sets


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """Two sets of one short recording each, in our layout."""
    folder = tmp_path_factory.mktemp("recordings")
    for name, seed in (("one", 0), ("two", 1)):
        recording = simulated("day", seed, 1.0)
        (folder / name / "a").mkdir(parents=True)
        write_detections(recording.detections, folder / name / "a" / "detections.csv")
        write_truth(recording.truth, folder / name / "a" / "gt.csv")
    return folder


def test_a_page_names_its_command_without_the_folder_and_can_be_made_again(tmp_path, root, capsys):
    page, again = tmp_path / "constants.md", tmp_path / "again.md"
    words = ["constants", str(root), "--only", "jerk", "cut_gate", "--steps", "1.4", "--most", "1"]
    assert main([*words, "--jobs", "1", "--page", str(page), "--out", str(tmp_path)]) == 0
    text = page.read_text()
    assert "`python -m benchmarks constants ROOT --only jerk cut_gate --steps 1.4 --most 1` at commit" in text
    assert str(root) not in text
    assert "2 constants are moved" in text
    assert text.count("\n| `") == 2
    assert (tmp_path / "constants.counts.jsonl").is_file()
    shown = capsys.readouterr().out
    assert main(["constants", "--from", str(tmp_path / "constants.json"), "--page", str(again)]) == 0
    assert again.read_text() == text
    assert capsys.readouterr().out == shown
    rows = json.loads((tmp_path / "constants.json").read_text())["rows"]
    assert {row["set"] for row in rows} == {"one", "two"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--only", "jerks"], "--only jerks is no constant that is moved; the nearest is jerk"),
        (["--only", "learn_period_s"], "how often parameters are computed again"),
        (["--steps", "1", "2"], "--steps 1 moves nothing"),
        (["--sets", "one"], "leaving one out takes two or more"),
    ],
)
def test_what_cannot_be_asked_is_said_in_a_line(root, capsys, words, said):
    assert main(["constants", str(root), *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert "Traceback" not in error


def test_a_file_that_is_no_cache_is_refused(tmp_path, root, capsys):
    notes = tmp_path / "notes.txt"
    notes.write_text("mine\n")
    assert main(["constants", str(root), "--cache", str(notes)]) == 2
    assert "notes.txt: is no file of counts of `python -m benchmarks constants`" in capsys.readouterr().err
    assert notes.read_text() == "mine\n"
