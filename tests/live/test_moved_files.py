"""Files that are moved away or emptied while a run writes them (logrotate): no row is lost or doubled."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.errors import DataError, InputWarning
from jeat_graph.io.files.growing import GrowingFile
from jeat_graph.live.late import LiveTracker
from jeat_graph.live.messages import decode_scans
from jeat_graph.live.session import Ends, Session
from jeat_graph.live.smoothed_file import SmoothedFile
from jeat_graph.tracking.tracker import Tracker

HEAD = b"t,x\n"
CONFIG = load_config("default", ["smoother.lag_s=0.2", "sensors.rgb={}"])
MESSAGES = 400


def message(k):
    t = 0.05 * k
    scan = {"t": t, "sensor": "rgb", "boxes": [[100 + 20 * t, 100, 40, 30]], "scores": [0.9]}
    return decode_scans(json.dumps({"v": 1, "source": "g7", "seq": k, "scans": [scan]}).encode(), "x", 1)


class Run:
    """A session that writes smoothed rows into `rows.csv` of a folder; without a checkpoint, or with one."""

    def __init__(self, folder, checkpoint=True):
        self.path, state = folder / "rows.csv", folder / "state.npz" if checkpoint else None
        live, more = LiveTracker(Tracker(CONFIG)), {}
        if state is not None and state.is_file():
            live, more = LiveTracker.load(state, CONFIG)
        self.file = SmoothedFile(self.path, more.get("smoothed"))
        self.file.__enter__()
        ends = Ends(tracks=lambda *_: None, warn=lambda _: None, smoothed=self.file)
        self.session = Session(live, ends, state, 2.0, more)

    def take(self, first, last):
        for k in range(first, last):
            self.session.accept(message(k))

    def end(self):
        self.session.finish()
        self.file.__exit__()

    def kill(self):
        """End it as a crash would: what the system has stays, and no more is written."""
        self.file._file.close()


@pytest.fixture
def whole(tmp_path):
    """The smoothed file, as bytes, of a run in which it is not moved."""
    (tmp_path / "whole").mkdir()
    run = Run(tmp_path / "whole")
    run.take(0, MESSAGES)
    run.end()
    return run.path.read_bytes()


def rows(*files):
    """The rows of some files, one after the other; each must begin with the header."""
    found = []
    for file in files:
        head, *lines = file.read_bytes().splitlines(keepends=True)
        assert head.startswith(b"t,track_id,")
        found += lines
    return found


@pytest.mark.parametrize("checkpoint", [True, False])
@pytest.mark.parametrize("created", [True, False])
def test_a_file_that_is_moved_away_is_followed_by_a_new_one(checkpoint, created, whole, tmp_path):
    run = Run(tmp_path, checkpoint)
    run.take(0, 150)
    run.path.rename(tmp_path / "rows.csv-1")
    if created:  # as logrotate does with `create`
        run.path.touch()
    run.take(150, MESSAGES)
    run.end()
    old, new = rows(tmp_path / "rows.csv-1"), rows(run.path)
    assert min(len(old), len(new)) > 50
    assert old + new == whole.splitlines(keepends=True)[1:]


def test_a_run_goes_on_in_the_new_file_from_a_checkpoint_after_the_move(whole, tmp_path):
    run = Run(tmp_path)
    run.take(0, 150)
    run.path.rename(tmp_path / "rows.csv-1")
    run.take(150, 305)  # checkpoints at 8, 10, 12, 14 s
    run.kill()
    assert len(rows(run.path)) > 0
    run = Run(tmp_path)
    run.take(250, MESSAGES)
    run.end()
    assert rows(tmp_path / "rows.csv-1", run.path) == whole.splitlines(keepends=True)[1:]


def test_after_a_crash_between_the_move_and_a_checkpoint_no_row_is_missing(whole, tmp_path):
    run = Run(tmp_path)
    run.take(0, 230)
    run.path.rename(tmp_path / "rows.csv-1")
    run.take(230, 239)
    run.session.drain()
    run.kill()
    with pytest.warns(InputWarning, match=r"rows\.csv: was moved away after the checkpoint; rows since then"):
        run = Run(tmp_path)
    run.take(200, MESSAGES)
    run.end()
    old, new = rows(tmp_path / "rows.csv-1"), rows(run.path)
    expected = whole.splitlines(keepends=True)[1:]
    assert new == expected[-len(new) :]
    assert old == expected[: len(old)]
    assert len(expected) < len(old) + len(new)  # those since the checkpoint are in both


def test_a_file_with_other_rows_that_is_shorter_than_at_the_checkpoint_is_refused(tmp_path):
    run = Run(tmp_path)
    run.take(0, 150)
    run.kill()
    lines = run.path.read_bytes().splitlines(keepends=True)
    run.path.write_bytes(b"".join(lines[:2]))
    with pytest.raises(DataError, match=r"rows\.csv: has \d+ bytes, and had \d+ when the checkpoint was"):
        Run(tmp_path)
    assert run.path.read_bytes() == b"".join(lines[:2])


def test_a_file_that_is_emptied_in_its_place_begins_with_the_header_again(whole, tmp_path):
    run = Run(tmp_path)
    run.take(0, 150)
    copy = tmp_path / "rows.csv-1"
    copy.write_bytes(run.path.read_bytes())  # as logrotate does with `copytruncate`
    os.truncate(run.path, 0)
    run.take(150, MESSAGES)
    run.end()
    assert rows(copy, run.path) == whole.splitlines(keepends=True)[1:]


def test_lines_go_to_the_end_of_a_file_that_somebody_else_has_put_there(tmp_path):
    file = GrowingFile(tmp_path / "a.csv")
    file.begin(HEAD)
    file.write(b"1,2\n")
    (tmp_path / "b.csv").write_bytes(HEAD + b"3,4\n")
    (tmp_path / "b.csv").replace(tmp_path / "a.csv")
    assert file.follow() == len(HEAD) + 4
    file.write(b"5,6\n")
    file.close()
    assert (tmp_path / "a.csv").read_bytes() == HEAD + b"3,4\n5,6\n"


def test_a_pipe_is_neither_cut_nor_followed(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    file = GrowingFile(tmp_path / "pipe")
    file.begin(HEAD)
    file.write(b"1,2\n")
    (tmp_path / "pipe").unlink()
    file.follow()
    file.write(b"3,4\n")
    file.close()
    assert os.read(reader, 100) == HEAD + b"1,2\n3,4\n"
    os.close(reader)


def test_a_table_of_the_road_is_followed_too(tmp_path):
    from jeat_graph.road import lag_table
    from jeat_graph.road.results import empty_road_columns

    class Table:
        """Gives one row a step."""

        def step(self, t, _):
            columns = empty_road_columns()
            return {
                name: np.array([1 if name == "track_id" else t], of.dtype) for name, of in columns.items()
            }

        def finish(self):
            return empty_road_columns()

    path = tmp_path / "road.csv"
    with lag_table.RoadFile(path, Table()) as road:
        road.take(0.0, None, np.array([1]))
        path.rename(tmp_path / "road.csv-1")
        road.take(1.0, None, np.array([1]))
    old, new = (file.read_text().splitlines() for file in (tmp_path / "road.csv-1", path))
    assert old[0] == new[0] == ",".join(empty_road_columns())
    assert [line.partition(",")[0] for line in (old[1], new[1])] == ["0", "1"]
    assert (len(old), len(new)) == (2, 2)
