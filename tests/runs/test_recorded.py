"""What a run's files say of it, and what is said of those that are missing."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.io.tables.trajectories_io import write_trajectories
from jeat_graph.runs.recorded import load_run_data, rows_of_tracks

from .tables import uniform_motion

T = 0.05 * np.arange(10)


@pytest.fixture
def folder(tmp_path):
    """A run without a record, a smoothed table and diagnostics."""
    write_trajectories(uniform_motion(T, track_id=7), tmp_path / "causal.csv")
    return tmp_path


def test_a_run_is_read_with_a_note_on_everything_it_lacks(folder):
    data = load_run_data(folder)
    assert data.track_ids().tolist() == [7]
    assert data.sensors == ("rgb",)
    assert data.span_s() == (0.0, pytest.approx(0.45))
    assert data.smoothed is None
    lacks = ("no run.json", "no smoothed table", "no diagnostics.csv", "No truth was given")
    assert [any(what in note for note in data.notes) for what in lacks] == [True] * 4


def test_the_picture_is_as_large_as_configured_else_as_far_as_boxes_reach(folder):
    assert load_run_data(folder).size_px() == (65.0, 60.0)  # right edge 45 + 20, bottom 50 + 10
    record = {"config": {"image": {"width": 1280, "height": 720}}}
    (folder / "run.json").write_text(json.dumps(record), encoding="utf-8")
    assert load_run_data(folder).size_px() == (1280.0, 720.0)


def test_a_record_that_is_no_json_is_refused_with_its_line(folder):
    (folder / "run.json").write_text('{\n"version": \n', encoding="utf-8")
    with pytest.raises(DataError, match=r"run\.json:\d: .*is not JSON"):
        load_run_data(folder)
    (folder / "run.json").write_text("[]", encoding="utf-8")
    with pytest.raises(DataError, match="is not the record of a run"):
        load_run_data(folder)


def test_rows_of_a_track_come_in_order_of_time():
    track_id, t = np.array([5, 2, 5, 2, 5]), np.array([3.0, 1.0, 1.0, 0.0, 2.0])
    rows = {one: part.tolist() for one, part in rows_of_tracks(track_id, t).items()}
    assert rows == {2: [3, 1], 5: [2, 4, 0]}
    assert list(rows) == [2, 5]
    assert rows_of_tracks(track_id[:0], t[:0]) == {}
