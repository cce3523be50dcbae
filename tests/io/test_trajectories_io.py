"""Trajectory tables: what is kept, to which digit, and results in other formats."""

from __future__ import annotations

import hashlib
import itertools
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.formats.kitti import write_kitti
from jeat_graph.io.formats.motchallenge import write_motchallenge
from jeat_graph.io.tables.trajectories_io import (
    COLUMNS,
    TrajectoryWriter,
    read_trajectories,
    write_trajectories,
)

FORMATS = pytest.mark.parametrize("name", ["t.csv", "t.parquet"])


def table(n: int, seed: int = 0, sensors: tuple[str, ...] = ("rgb", "evt")) -> Trajectories:
    """Rows with values of every size, 100 tracks at a time."""
    rng = np.random.default_rng(seed)
    return Trajectories(
        t=1.7e9 + (np.arange(n) // 100) * 0.0100001,
        track_id=np.arange(n) % 100 + 2**40,
        boxes=rng.uniform(0, 2000, (n, 4)),
        existence=rng.random(n),
        mean=rng.normal(0, 1e3, (n, 6)),
        var=rng.uniform(1, 10, (n, 6)) * 10.0 ** rng.integers(-12, 12, (n, 6)),
        used=rng.integers(0, 1 << len(sensors), n),
        sensors=sensors,
        size_var=rng.uniform(1, 10, (n, 2)) * 10.0 ** rng.integers(-12, 12, (n, 2)),
    )


def has_motion(table: Trajectories) -> bool:
    """Whether a table holds estimates of motion, rather than boxes only."""
    return bool(np.isfinite(table.var).any())


def simple(*rows: tuple[float, int, float], existence: float = 0.5) -> Trajectories:
    """Rows of (t, track, left); boxes 30 x 40 at top 20."""
    n = len(rows)
    left = np.array([row[2] for row in rows])
    return Trajectories(
        t=np.array([row[0] for row in rows]),
        track_id=np.array([row[1] for row in rows], dtype=np.int64),
        boxes=np.stack([left, np.full(n, 20.0), np.full(n, 30.0), np.full(n, 40.0)], axis=1),
        existence=np.full(n, existence),
        mean=np.zeros((n, 6)),
        var=np.ones((n, 6)),
        used=np.zeros(n, dtype=np.int64),
    )


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@FORMATS
def test_values_come_back_to_the_digits_that_are_kept(tmp_path, name):
    before = table(1000)
    write_trajectories(before, tmp_path / name)
    after = read_trajectories(tmp_path / name)
    assert np.array_equal(after.t, before.t)
    assert np.array_equal(after.track_id, before.track_id)
    assert np.abs(after.boxes - before.boxes).max() <= 0.0005 + 1e-9
    assert np.abs(after.mean - before.mean).max() <= 0.0005 + 1e-9
    assert np.abs(after.existence - before.existence).max() <= 5e-7 + 1e-12
    assert np.abs(after.var / before.var - 1).max() <= 5e-6 * (1 + 1e-9)
    assert np.abs(after.size_var / before.size_var - 1).max() <= 5e-6 * (1 + 1e-9)
    assert after.sensor_text() == before.sensor_text()


@given(
    n=st.integers(0, 30),
    seed=st.integers(0, 2**32 - 1),
    sensors=st.permutations(["rgb", "evt", "lidar", "with, comma"]),
    name=st.sampled_from(["t.csv", "t.parquet"]),
)
def test_a_table_that_was_read_is_written_as_the_same_bytes(n, seed, sensors, name):
    with tempfile.TemporaryDirectory() as folder:
        first, second = Path(folder) / f"1{name}", Path(folder) / f"2{name}"
        write_trajectories(table(n, seed, tuple(sensors)), first)
        write_trajectories(read_trajectories(first), second)
        assert digest(first) == digest(second)


def test_the_csv_is_what_the_contract_says(tmp_path):
    row = Trajectories(
        t=np.array([1700000000.1234567]),
        track_id=np.array([7]),
        boxes=np.array([[1.23456, -0.0001, 3.0, 4.5]]),
        existence=np.array([0.12345678]),
        mean=np.array([[2.7346, 2.25, -12.3456, 0, 1e-9, -1e-9]]),
        var=np.array([[1.23456789, 0.000123456789, 123456789.0, 1e-30, 1e5, np.nan]]),
        used=np.array([3]),
        sensors=("rgb", "evt"),
        size_var=np.array([[0.25, np.nan]]),
    )
    write_trajectories(row, tmp_path / "t.csv")
    head, line = (tmp_path / "t.csv").read_text(encoding="utf-8").splitlines()
    assert head == (
        "t,track_id,left,top,width,height,existence,x,y,vx,vy,ax,ay,"
        "var_x,var_y,var_vx,var_vy,var_ax,var_ay,sensors,var_width,var_height"
    )
    fields = line.split(",")
    assert float(fields[0]) == 1700000000.1234567
    assert fields[1:7] == ["7", "1.235", "0", "3", "4.5", "0.123457"]
    assert fields[7:13] == ["2.735", "2.25", "-12.346", "0", "0", "0"]
    assert [float(field) for field in fields[13:17]] == [1.23457, 0.000123457, 123457000, 0.0]
    assert fields[17:] == ["100000", "", "rgb|evt", "0.25", ""]


def test_a_table_of_an_earlier_version_says_nothing_of_how_sure_sizes_are(tmp_path):
    write_trajectories(table(5), tmp_path / "t.csv")
    lines = (tmp_path / "t.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "old.csv").write_text("\n".join(line.rsplit(",", 2)[0] for line in lines) + "\n")
    now, old = read_trajectories(tmp_path / "t.csv"), read_trajectories(tmp_path / "old.csv")
    assert np.isnan(old.size_var).all()
    assert np.array_equal(old.var, now.var)
    assert old.sensor_text() == now.sensor_text()


@FORMATS
def test_a_run_without_tracks_has_a_table_without_rows(tmp_path, name):
    write_trajectories(Trajectories.empty(), tmp_path / name)
    assert len(read_trajectories(tmp_path / name)) == 0


@FORMATS
def test_the_bytes_do_not_depend_on_the_pieces(tmp_path, name):
    whole = table(67_000)
    write_trajectories(whole, tmp_path / f"whole-{name}")
    for cuts in ([1], [65_530, 65_541], list(range(0, 67_000, 4_999))):
        path = tmp_path / f"{len(cuts)}-{cuts[0]}-{name}"
        with TrajectoryWriter(path) as writer:
            for start, end in itertools.pairwise([0, *cuts, len(whole)]):
                writer.append(whole.take(np.arange(start, end)))
            assert not path.exists()
        assert digest(path) == digest(tmp_path / f"whole-{name}"), cuts


@FORMATS
def test_a_run_that_fails_leaves_no_file(tmp_path, name):
    def run():
        with TrajectoryWriter(tmp_path / name) as writer:
            writer.append(table(100_000))
            raise KeyError

    with pytest.raises(KeyError):
        run()
    assert list(tmp_path.iterdir()) == []


def test_the_caller_may_use_its_arrays_again(tmp_path):
    rows = table(10)
    with TrajectoryWriter(tmp_path / "t.csv") as writer:
        writer.append(rows)
        rows.boxes[:] = -1
    assert np.abs(read_trajectories(tmp_path / "t.csv").boxes - table(10).boxes).max() < 0.001


def test_rows_are_on_disk_before_the_end(tmp_path):
    with TrajectoryWriter(tmp_path / "t.csv") as writer:
        for k in range(5):
            writer.append(table(50_000, seed=k))
        (beside,) = tmp_path.iterdir()
        assert beside.stat().st_size > 10_000_000


def test_a_bar_in_a_sensor_name_is_refused(tmp_path):
    with pytest.raises(DataError, match=r"must not hold '\|'"):
        write_trajectories(table(1, sensors=("a|b",)), tmp_path / "t.csv")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("t", "", "t is missing"),
        ("track_id", "1.5", "track_id must be a whole number"),
        ("x", "nan", "x must be a finite number"),
        ("var_x", "inf", "var_x must be a finite number"),
        ("existence", "1.5", "existence must be in [0, 1]"),
        ("width", "-1", "must not be negative"),
        ("t", "1", "track 3 is there twice at t = 1"),
    ],
)
def test_a_bad_row_is_named_by_its_line(write, column, value, words):
    good = dict.fromkeys(COLUMNS, "0.5") | {"t": "1", "track_id": "3", "sensors": "rgb"}
    bad = good | {"t": "2", column: value}
    lines = [",".join(COLUMNS), ",".join(good.values()), "", ",".join(bad.values())]
    path = write("t.csv", "\n".join(lines))
    with pytest.raises(DataError) as caught:
        read_trajectories(path)
    assert str(caught.value).startswith(f"{path}:4: ")
    assert words in str(caught.value)


def test_a_box_may_reach_beyond_the_picture(write):
    row = dict.fromkeys(COLUMNS, "0.5") | {"track_id": "3", "left": "-7", "top": "-9", "sensors": "rgb"}
    found = read_trajectories(write("t.csv", "\n".join([",".join(COLUMNS), ",".join(row.values())])))
    assert found.boxes.tolist() == [[-7, -9, 0.5, 0.5]]


class TestMotChallenge:
    def test_the_result_has_frames_from_1_and_the_last_row_of_a_track_in_a_frame(self, tmp_path):
        rows = simple((0.0, 2, 9), (0.0, 1, 10), (0.099, 1, 11), (0.101, 1, 12), (0.26, 1, 13.12345))
        write_motchallenge(rows, tmp_path / "r.txt", rate_hz=10)
        assert (tmp_path / "r.txt").read_text(encoding="utf-8") == (
            "1,1,10,20,30,40,0.5,-1,-1,-1\n"
            "1,2,9,20,30,40,0.5,-1,-1,-1\n"
            "2,1,12,20,30,40,0.5,-1,-1,-1\n"
            "4,1,13.123,20,30,40,0.5,-1,-1,-1\n"
        )

    def test_a_result_is_read_as_boxes_without_motion(self, tmp_path):
        write_motchallenge(simple((0.0, 1, 10), (0.1, 1, 11)), tmp_path / "r.txt", rate_hz=10)
        found = read_trajectories(tmp_path / "r.txt", rate_hz=10)
        assert found.t.tolist() == [0.0, 0.1]
        assert found.mean.tolist() == [[25, 40, 0, 0, 0, 0], [26, 40, 0, 0, 0, 0]]
        assert np.isnan(found.var).all()
        assert not has_motion(found)
        assert has_motion(simple((0.0, 1, 10)))

    def test_a_confidence_that_is_none_counts_as_certain(self, write):
        found = read_trajectories(
            write("r.txt", "1,1,1,2,3,4,-1,-1,-1,-1\n2,1,1,2,3,4,0.25,-1,-1,-1\n"), rate_hz=1
        )
        assert found.existence.tolist() == [1.0, 0.25]

    def test_a_time_before_the_first_frame_is_refused(self, tmp_path):
        with pytest.raises(DataError, match="before the first frame"):
            write_motchallenge(simple((-1.0, 1, 10)), tmp_path / "r.txt", rate_hz=10)

    def test_a_track_twice_in_a_frame_is_named_by_its_line(self, write):
        path = write("r.txt", "1,1,1,2,3,4,1\n1,2,1,2,3,4,1\n1,1,1,2,3,4,1\n")
        with pytest.raises(DataError, match=r"r\.txt:3: track 1 is there twice"):
            read_trajectories(path, rate_hz=10)

    def test_a_real_result_is_read(self, shared_data):
        found = read_trajectories(shared_data / "tud" / "TUD-Campus" / "test.txt", rate_hz=25)
        assert (len(found), found.boxes[0].tolist()) == (222, [113.84, 274.5, 57.307, 130.05])


class TestKitti:
    def test_the_result_has_frames_from_0_and_a_score(self, tmp_path):
        write_kitti(simple((0.0, 1, 10), (0.1, 1, 11), existence=0.75), tmp_path / "r.txt")
        assert (tmp_path / "r.txt").read_text(encoding="utf-8") == (
            "0 1 Car -1 -1 -10 10 20 40 60 -1 -1 -1 -1000 -1000 -1000 -10 0.75\n"
            "1 1 Car -1 -1 -10 11 20 41 60 -1 -1 -1 -1000 -1000 -1000 -10 0.75\n"
        )

    def test_a_result_is_read_back(self, tmp_path):
        before = simple((0.0, 1, 10), (0.3, 2, 11), existence=0.75)
        write_kitti(before, tmp_path / "r.txt")
        after = read_trajectories(tmp_path / "r.txt")
        assert np.array_equal(after.t, before.t)
        assert np.array_equal(after.boxes, before.boxes)
        assert np.array_equal(after.existence, before.existence)

    def test_a_type_of_two_words_is_refused(self, tmp_path):
        with pytest.raises(DataError, match="one word"):
            write_kitti(simple((0.0, 1, 10)), tmp_path / "r.txt", object_type="sports car")


@pytest.mark.parametrize("name", ["x.mot.txt", "x.TXT"])
def test_a_name_of_text_by_frame_is_not_filled_with_csv(name, tmp_path):
    with pytest.raises(DataError, match=r"written_formats\(\)"):
        write_trajectories(Trajectories.empty(), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_run_without_classes_has_no_columns_of_them(tmp_path):
    from jeat_graph.cli.main import main

    rows = "".join(f"{k / 10},rgb,{k},1,30,30,0.9\n" for k in range(3))
    (tmp_path / "d.csv").write_text("t,sensor,left,top,width,height,score\n" + rows)
    assert main(["track", str(tmp_path / "d.csv"), "--out", str(tmp_path / "r"), "--image", "640x480"]) == 0
    assert "class" not in (tmp_path / "r" / "causal.csv").read_text().splitlines()[0]
