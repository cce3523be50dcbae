"""`benchmarks ablation`: that each term is off without its constants, and the sums of the table."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.ablation import TERMS, judged, nearby, tables, without
from benchmarks.constant_scores import made_ready, tables_of
from benchmarks.judging import CAUSAL
from benchmarks.recordings import RecordingSet
from benchmarks.simulated_sets import simulated
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.io.tables.detections_io import write_detections
from jeat_graph.io.tables.truth_io import write_truth

SHIPPED = ModelConstants()
#: Found only where something cuts boxes, where two sensors differ in size, where scores tell little, or where
#: a sensor is alone, or worse than what sides of compared sensors have at least; or what a few seconds do not
#: show, or recordings whose scores all mean something.
QUIET = {
    "learnt box noise",
    "sides that show again",
    "the decision threshold (fixed at even odds)",
    "gaps that begin with a box that confirms",
    "which of two sensors is off, by aspects",
    "scores that say nothing",
}


@pytest.fixture(scope="module")
def ready():
    return made_ready(RecordingSet("day", (simulated("day", 0, 6.0),)))


@pytest.mark.parametrize("term", list(TERMS))
def test_the_tracker_runs_without_a_term_and_notices_it(ready, term):
    shipped = tables_of(ready.recordings[0], SHIPPED)[CAUSAL]
    found = tables_of(ready.recordings[0], without(SHIPPED, term))[CAUSAL]
    assert len(found.t) > 0.5 * len(shipped.t)
    assert np.isfinite(found.boxes).all()
    if term not in QUIET:
        same = len(found.t) == len(shipped.t) and np.array_equal(found.boxes, shipped.boxes)
        assert not same


class Known:
    """Scores that a term changes by what is known: MOTA falls by 2 without second boxes, by 1 more nearby."""

    def fill(self, points, smoothed=False):
        """Nothing needs to be tracked."""

    def samples(self, point, kind=CAUSAL):
        near = point.constants.jerk != SHIPPED.jerk
        off = point.constants.duplicate_weight == 0.0
        return np.array([[80.0 - 5.0 * near - off * (2.0 + near) * point.group.scale, 60.0, 70.0]])


def test_changes_are_paired_summed_over_sets_and_averaged_over_points():
    sets = [SimpleNamespace(name="a", scale=1.0), SimpleNamespace(name="b", scale=-0.5)]
    (row,) = judged(sets, Known(), ["second boxes"], nearby(2))
    # Shipped: −2 + 1; nearby: −3 + 1.5. The points' own difference of 5 is in no change.
    assert row["change"] == pytest.approx([-1.25, 0.0, 0.0])
    assert row["std_error"] == pytest.approx([0.25, 0.0, 0.0])
    assert row["by_set"] == pytest.approx({"a": -2.5, "b": 1.25})
    shown = tables({"rows": [row]})["ablation"].render("markdown")
    assert "| second boxes | -1.2±0.2 | +0.0±0.0 | +0.0±0.0 | -2.5 a | +1.2 b |" in shown


def test_points_nearby_begin_with_the_shipped_constants():
    first, *others = nearby(3)
    assert first == SHIPPED
    assert len({SHIPPED, *others}) == 3


def test_the_command_writes_its_table_and_does_not_tell_the_folder(tmp_path, capsys):
    one = simulated("day", 0, 2.0)
    folder = tmp_path / "a-place" / "sets" / "day" / "one"
    folder.mkdir(parents=True)
    write_detections(one.detections, folder / "detections.csv")
    write_truth(one.truth, folder / "gt.csv")
    page = tmp_path / "page.md"
    page.write_text("<!-- table: ablation -->\n<!-- end -->\n")
    words = ["--terms", "second boxes", "heavy tails", "--nearby", "1", "--world-seconds", "0"]
    assert main(["ablation", str(tmp_path / "a-place" / "sets"), *words, "--readme", str(page)]) == 0
    text = page.read_text()
    assert "second boxes" in text
    assert "heavy tails" in text
    assert "a-place" not in text
    assert "ROOT" in text
    capsys.readouterr()
