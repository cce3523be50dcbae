"""`track --identities`: tracks that a person corrected come back, and the model smooths along them."""

from __future__ import annotations

import csv
import zipfile

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.io.tables.trajectories_io import read_trajectories

IMAGE = ("--image", "1280x720")
ROWS = ("t", "track_id", "left", "top", "width", "height")
LOW, HIGH = 150.0, 450.0  # tops of the two objects


def written(path, rows, header=ROWS):
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([header, *rows])
    return path


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A folder with the detections of two objects, one of them hidden for 3 s, and a run of them."""
    folder = tmp_path_factory.mktemp("first")
    rng = np.random.default_rng(4)
    rows = []
    for k in range(140):
        t = k / 20
        for top in (LOW, HIGH):
            if top == HIGH or not 2.0 < t < 5.0:
                noise = rng.normal(scale=0.5, size=2)
                rows.append((t, "rgb", 100 + 80 * t + noise[0], top + noise[1], 60, 45, 0.9))
        if not rows or rows[-1][0] != t:
            rows.append((t, "rgb", "", "", "", "", ""))
    header = ("t", "sensor", "left", "top", "width", "height", "score")
    written(folder / "detections.csv", rows, header)
    assert main(["track", str(folder / "detections.csv"), *IMAGE, "--out", str(folder / "run")]) == 0
    return folder


@pytest.fixture
def again(first, tmp_path):
    """Track along rows (t, track_id, left, top, width, height), or along a file; return table and notes."""

    def run(rows):
        path = written(tmp_path / "corrected.csv", rows) if isinstance(rows, list) else rows
        out = tmp_path / "again"
        detections = str(first / "detections.csv")
        command = ["track", detections, *IMAGE, "--rate", "20", "--out", str(out)]
        assert main([*command, "--identities", str(path)]) == 0
        with (out / "disagreements.csv").open() as file:
            return read_trajectories(out / "smoothed.csv"), list(csv.DictReader(file))

    return run


def rows_of(first):
    table = read_trajectories(first / "run" / "smoothed.csv")
    return [
        (t, k, *box)
        for t, k, box in zip(table.t.tolist(), table.track_id.tolist(), table.boxes.tolist(), strict=True)
    ]


def tops(table):
    """Mean top of each track's boxes, by identity."""
    return {int(k): float(table.boxes[table.track_id == k, 1].mean()) for k in np.unique(table.track_id)}


def the_three(first):
    """Identities of the low object before and behind the gap, and of the high one."""
    rows = rows_of(first)
    before, behind = (next(r[1] for r in rows if r[3] < 300 and r[0] >= t) for t in (0.0, 5.0))
    high = next(r[1] for r in rows if r[3] > 300)
    assert len({before, behind, high}) == 3
    return before, behind, high


def test_what_comes_back_unchanged_gives_the_same_identities_and_rows(first, again):
    before = read_trajectories(first / "run" / "smoothed.csv")
    after, said = again(first / "run" / "smoothed.csv")
    assert said == []
    np.testing.assert_array_equal(after.track_id, before.track_id)
    np.testing.assert_array_equal(after.t, before.t)
    np.testing.assert_allclose(after.boxes, before.boxes, atol=0.3)
    assert after.causal_id is not None


def test_two_identities_that_were_swapped_are_swapped(first, again):
    before, _, high = the_three(first)
    other = {before: high, high: before}
    rows = [(t, other.get(k, k), *box) for t, k, *box in rows_of(first)]
    after, said = again(rows)
    assert said == []
    found = tops(after)
    assert found[high] == pytest.approx(LOW, abs=1)
    assert found[before] == pytest.approx(HIGH, abs=1)


def test_a_track_that_was_deleted_is_gone(first, again):
    before, behind, high = the_three(first)
    after, said = again([row for row in rows_of(first) if row[1] != high])
    assert said == []
    assert set(after.track_id.tolist()) == {before, behind}
    assert (after.boxes[:, 1] < 300).all()


def test_two_tracks_that_were_merged_are_one(first, again):
    before, behind, high = the_three(first)
    rows = [(t, before if k == behind else k, *box) for t, k, *box in rows_of(first)]
    after, said = again(rows)
    assert said == []
    assert set(after.track_id.tolist()) == {before, high}
    own = after.t[after.track_id == before]
    assert own.min() < 0.5
    assert own.max() == pytest.approx(6.95)


def test_a_track_that_was_split_is_two(first, again):
    *_, high = the_three(first)
    rows = [(t, 77 if k == high and t > 3.5 else k, *box) for t, k, *box in rows_of(first)]
    after, _ = again(rows)
    assert after.t[after.track_id == high].max() == pytest.approx(3.5)
    assert after.t[after.track_id == 77].min() == pytest.approx(3.55)
    assert tops(after)[77] == pytest.approx(HIGH, abs=1)


@pytest.mark.parametrize(("by", "what"), [(20.0, "moved"), (70.0, "added")])
def test_boxes_that_were_moved_are_named_and_followed(first, again, by, what):
    """By less than the box the row is of the old detection still; by more it is a detection of its own."""
    *_, high = the_three(first)
    moved = {round(3.0 + k / 20, 3) for k in range(20)}
    rows = [
        (t, k, left, top + by * (k == high and round(t, 3) in moved), *size)
        for t, k, left, top, *size in rows_of(first)
    ]
    after, said = again(rows)
    named = {round(float(one["t"]), 3) for one in said if one["what"] == what}
    assert named == moved
    assert {int(one["track_id"]) for one in said} == {high}
    # The model does not fill all of a gap in which a sensor that misses nothing sees nothing.
    assert all(float(one["sigma"]) > 3 for one in said if one["sigma"] or what == "moved")
    middle = after.boxes[(after.track_id == high) & (np.abs(after.t - 3.5) < 0.2), 1]
    assert middle.mean() == pytest.approx(HIGH + by, abs=0.15 * by)


def test_an_identity_that_jumps_as_nothing_moves_is_named(first, again):
    """The two objects change their identities in the middle of the recording."""
    before, behind, high = the_three(first)
    rows = [(t, behind if k == high and t > 5.0 else high if k == behind else k, *box)
            for t, k, *box in rows_of(first)]  # fmt: skip
    rows = [row for row in rows if not (row[1] == high and 4.9 < row[0] < 5.2)]
    after, said = again(rows)
    assert set(after.track_id.tolist()) == {before, behind, high}
    assert {(int(one["track_id"]), one["what"]) for one in said} == {(high, "identity")}
    assert {round(float(one["t"]), 2) for one in said} >= {5.2, 5.25, 5.3}


def test_a_track_that_no_detection_is_behind_becomes_one(first, again):
    own = [(1.0 + k / 20, 90, 900.0, 300.0, 50.0, 50.0) for k in range(60)]
    after, said = again([*rows_of(first), *own])
    assert {(one["track_id"], one["sigma"], one["what"]) for one in said} == {("90", "", "added")}
    assert len(said) == 60
    assert after.boxes[after.track_id == 90][-1] == pytest.approx([900, 300, 50, 50], abs=1)


def test_a_row_when_no_sensor_looked_is_said_to_be_unseen(first, again):
    late = [(9.0, 91, 900.0, 300.0, 50.0, 50.0)]
    after, said = again([*rows_of(first), *late])
    assert [(one["t"], one["track_id"], one["what"]) for one in said] == [("9", "91", "unseen")]
    assert 91 not in after.track_id


def test_what_cvat_exports_is_read(first, again, tmp_path):
    before, behind, high = the_three(first)
    lines = [
        f"{round(t * 20) + 1},{k},{','.join(f'{x:.2f}' for x in box)},1,1,1"
        for t, k, *box in rows_of(first)
        if k != behind
    ]
    with zipfile.ZipFile(tmp_path / "cvat.zip", "w") as file:
        file.writestr("gt/gt.txt", "\n".join(lines) + "\n")
        file.writestr("gt/labels.txt", "vehicle\n")
    after, said = again(tmp_path / "cvat.zip")
    assert said == []
    assert set(after.track_id.tolist()) == {before, high}


def test_the_count_is_printed_and_the_file_is_recorded(first, tmp_path, capsys):
    smoothed = first / "run" / "smoothed.csv"
    command = ["track", str(first / "detections.csv"), *IMAGE, "--out", str(tmp_path / "run")]
    main([*command, "--identities", str(smoothed)])
    assert f"0 rows of {smoothed} lie off the model by more than 3 sigma" in capsys.readouterr().out
    from jeat_graph.runs.directory import read_record

    record = read_record(tmp_path / "run")
    assert record["identities"][0]["path"] == str(smoothed)
    assert record["counts"]["disagreements"] == 0
    assert not (tmp_path / "run" / "links.csv").exists()
    # A run without them leaves nothing of it behind.
    main(command)
    assert not (tmp_path / "run" / "disagreements.csv").exists()


@pytest.mark.parametrize(
    ("header", "row", "words"),
    [
        (ROWS, (1.0, 5, 10, 600, 30, 30), "corrected.csv:2: no row of the file lies on a detection"),
        (("t", "left", "top", "width", "height"), (1.0, 10, 600, 3, 3), "corrected.csv:1: has no column"),
        (("t", "track_id", "left", "top", "widht", "height"), (1.0, 5, 1, 6, 3, 3), "corrected.csv:1: "),
        (ROWS, (1.0, 5, 10, 600, 0, 30), "corrected.csv:2: width and height must be positive, got 0 x 30"),
        (ROWS, (1.0, -5, 10, 600, 9, 30), "corrected.csv:2: track_id must not be negative, got -5"),
        (ROWS, (1.0, "x", 10, 600, 9, 30), "corrected.csv:2: "),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(first, tmp_path, fails, header, row, words):
    path, out = written(tmp_path / "corrected.csv", [row], header), tmp_path / "out"
    known = ("--set", "sensors={rgb: {rate_hz: 20}}")  # so that nothing else is said
    line = fails("track", first / "detections.csv", *IMAGE, *known, "--identities", path, "--out", out)
    assert words in line
    assert not out.exists()


def test_a_track_twice_at_one_time_is_refused(first, tmp_path, fails):
    path = written(tmp_path / "corrected.csv", [(1.0, 5, 10, 600, 9, 30), (1.0, 5, 90, 600, 9, 30)])
    line = fails("track", first / "detections.csv", "--identities", path, "--out", tmp_path / "out")
    assert "corrected.csv:3: track 5 is there twice at t = 1" in line


@pytest.mark.parametrize("setting", [("--smoother", "none"), ("--config", "paper")])
def test_what_cannot_smooth_along_them_refuses(first, tmp_path, fails, setting):
    run = ("track", first / "detections.csv", "--identities", first / "run" / "smoothed.csv")
    assert "--identities does not go with" in fails(*run, *setting, "--out", tmp_path / "out")
