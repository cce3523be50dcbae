"""Scores under constants: those of `eval`, their errors, and the file that they are kept in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.constant_scores import (
    CountJob,
    Point,
    ScoreBook,
    count,
    headline,
    made_ready,
    sampled,
    std_error,
    tables_of,
)
from benchmarks.judging import CAUSAL, HEADLINE, SMOOTHED, scores_of
from benchmarks.recordings import RecordingSet
from benchmarks.simulated_sets import simulated
from jeat_graph import load_config, track
from jeat_graph.data.errors import DataError
from jeat_graph.filters.model_constants import ModelConstants

SHIPPED = ModelConstants()


@pytest.fixture(scope="module")
def group():
    return RecordingSet("day", tuple(simulated("day", seed, 3.0) for seed in (0, 1, 2)))


@pytest.fixture(scope="module")
def ready(group):
    return made_ready(group)


def test_with_the_shipped_constants_tables_are_those_of_track(group, ready):
    config = load_config("default", ["smoother.identities=causal"])
    tracks = track(group.recordings[0].detections, config, image=group.recordings[0].image)
    found = tables_of(ready.recordings[0], SHIPPED, smoothed=True)
    for kind in (CAUSAL, SMOOTHED):
        theirs = getattr(tracks, kind)
        np.testing.assert_array_equal(found[kind].boxes, theirs.boxes)
        np.testing.assert_array_equal(found[kind].track_id, theirs.track_id)
    np.testing.assert_array_equal(tables_of(ready.recordings[0], SHIPPED)[CAUSAL].boxes, tracks.causal.boxes)


def test_the_constants_that_are_given_are_those_that_count(ready):
    deaf = tables_of(ready.recordings[0], replace(SHIPPED, report=1.1))
    assert len(deaf[CAUSAL].t) == 0 < len(tables_of(ready.recordings[0], SHIPPED)[CAUSAL].t)


def test_scores_of_counts_are_those_of_eval_pooled_and_of_each_recording(group, ready):
    """The oracle is `eval`."""
    tables = [tables_of(one, SHIPPED, smoothed=True) for one in ready.recordings]
    expected = scores_of(group.recordings, tables, group.sensors)
    found = count(CountJob(Point(ready, SHIPPED), True))
    for kind in (CAUSAL, SMOOTHED):
        pooled = sampled(np.array(found[kind]))[0]
        assert pooled == pytest.approx([expected[kind][name] for name in HEADLINE], abs=1e-5)
        for k, row in enumerate(found[kind]):
            alone = scores_of([group.recordings[k]], [tables[k]], group.sensors)[kind]
            assert headline(np.array(row)) == pytest.approx([alone[name] for name in HEADLINE], abs=1e-5)


def test_the_standard_error_of_a_mean_is_the_textbook_one():
    """With as many boxes in each recording MOTA is a mean: s/√R."""
    rng = np.random.default_rng(3)
    counts = np.zeros((8, 5 + 2 * 19))
    counts[:, 0] = 1000.0
    counts[:, 2] = rng.integers(300, 900, 8)
    counts[:, 1] = counts[:, 2]
    share = 100.0 * counts[:, 2] / 1000.0
    found = std_error(sampled(counts)[:, HEADLINE.index("MOTA")], 8)
    # The relative error of a standard deviation of B samples is 1/√(2B).
    assert found == pytest.approx(share.std(ddof=1) / np.sqrt(8.0), rel=4.0 / np.sqrt(1000.0))
    assert np.isnan(std_error(sampled(counts[:1])[:, 0], 1))


def test_changes_are_paired():
    """All recordings lose the same, so the change has no error although the scores have."""
    rng = np.random.default_rng(4)
    counts = np.zeros((5, 5 + 2 * 19))
    counts[:, 0] = 1000.0
    counts[:, 1] = counts[:, 2] = rng.integers(300, 900, 5)
    worse = counts.copy()
    worse[:, 3] += 10.0  # identity switches
    change = (sampled(worse) - sampled(counts))[:, HEADLINE.index("MOTA")]
    assert change == pytest.approx(np.full(len(change), -1.0))
    assert std_error(sampled(counts)[:, 0], 5) > 1.0


def test_what_was_tracked_is_read_again_and_what_was_cut_off_is_tracked_again(tmp_path, ready):
    path = tmp_path / "counts.jsonl"
    points = [Point(ready, SHIPPED), Point(ready, replace(SHIPPED, jerk=4.0))]
    with ScoreBook(path) as book:
        first = [book.samples(point) for point in points]
    assert not np.array_equal(*first)
    whole = path.read_text()
    head, one, two = whole.split("\n")
    other = one.replace('"causal": [[', '"causal": [[1')  # so that it is seen where counts come from
    path.write_text("\n".join([head, other, two[:50]]))
    with ScoreBook(path) as book:
        assert not np.array_equal(book.samples(points[0]), first[0])
        np.testing.assert_array_equal(book.samples(points[1]), first[1])
    assert path.read_text().split("\n")[3] == two
    path.write_text(whole)
    with ScoreBook(path) as book:
        for point, expected in zip(points, first, strict=True):
            np.testing.assert_array_equal(book.samples(point), expected)
    assert path.read_text() == whole


def test_processes_give_what_one_gives(ready):
    points = [Point(ready, replace(SHIPPED, jerk=jerk)) for jerk in (1.0, 2.0)]
    with ScoreBook(None) as alone, ScoreBook(None, jobs=2) as many:
        many.fill(points)
        for point in points:
            np.testing.assert_array_equal(alone.samples(point), many.samples(point))


def test_counts_hang_on_the_recordings(group, ready):
    fewer = made_ready(RecordingSet("day", group.recordings[:2]))
    assert fewer.digest != ready.digest == made_ready(group).digest


def test_another_file_is_refused_and_left_as_it_is(tmp_path):
    path = tmp_path / "notes.md"
    path.write_text("# Notes\n")
    with pytest.raises(DataError, match="is no file of counts"):
        ScoreBook(path)
    assert path.read_text() == "# Notes\n"
