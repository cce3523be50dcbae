"""`jeat-graph stream`: tracks appear while scans arrive, and are those of `track`."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import selectors
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.io.tables.trajectories_io import MEAN, VAR, read_trajectories

COMMAND = [sys.executable, "-m", "jeat_graph.cli.main", "stream"]
PATIENCE_S = 120.0
IMAGE = ("--image", "1280x720")
#: What the recording's table says of its sensors, which `track` reads and scans do not say.
KINDS = ("--set", "sensors.evt.kind=event", "--set", "sensors.rgb.kind=camera")
#: A sensor that is not declared is told of on stderr.
DECLARED = ("--set", "sensors.rgb.rate_hz=20")


def begun(*arguments):
    """The command as a user starts it."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    pipe = subprocess.PIPE
    command = [*COMMAND, *map(str, arguments)]
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, env=environment)


@contextmanager
def live(process):
    """Have its stdin and stdout in our hands; it is killed if it does not end by itself."""
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        for pipe_end in (process.stdin, process.stdout, process.stderr):
            with suppress(BrokenPipeError):
                pipe_end.close()


def answer(process) -> bytes:
    """The next line of output, or a failure if there is none in time."""
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        assert selector.select(PATIENCE_S), "no output while the input is still open"
    return process.stdout.readline()


def scan_line(scan) -> str:
    return json.dumps(as_object(scan)) + "\n"


def as_object(scan):
    return {"t": scan.t, "sensor": scan.sensor, "boxes": scan.boxes.tolist(), "scores": scan.scores.tolist()}


def stream(text, monkeypatch, capsys, *arguments):
    """Run the command in this process; exit code, stdout, stderr."""
    raw = text if isinstance(text, bytes) else text.encode()
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(raw)))
    capsys.readouterr()
    code = main(["stream", *map(str, arguments)])
    caught = capsys.readouterr()
    return code, caught.out, caught.err


@pytest.fixture(scope="module")
def detections(recording):
    return read_detections(recording / "detections.csv")


@pytest.fixture(scope="module")
def tracked(recording, tmp_path_factory):
    out = tmp_path_factory.mktemp("tracked")
    identities = ["--set", "smoother.identities=causal"]  # those of a stream
    assert main(["track", str(recording / "detections.csv"), *IMAGE, *identities, "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def joint_lines(detections):
    """One line a time, with all scans of it."""
    return "".join(json.dumps([as_object(scan) for scan in batch]) + "\n" for batch in detections.batches())


BOX = {"boxes": [[100, 100, 40, 30]], "scores": [0.99]}


def line(t, sensor="rgb", **other):
    return json.dumps({"t": t, "sensor": sensor, **BOX, **other}) + "\n"


def test_each_line_is_answered_while_the_input_is_open():
    with live(begun()) as process:
        for k in range(10):
            process.stdin.write(line(0.05 * k).encode())
            process.stdin.flush()
            said = json.loads(answer(process))
            assert said["t"] == 0.05 * k
        assert [track["track_id"] for track in said["tracks"]] == [1]
        assert said["tracks"][0]["sensors"] == ["rgb"]
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 0


def test_an_empty_line_of_csv_completes_a_scan_at_once(start):
    with live(start("stream", "--format", "csv")) as process:
        process.stdin.write(b"t,sensor,left,top,width,height,score\n")
        for k in range(6):
            process.stdin.write(f"{0.05 * k},rgb,100,100,40,30,0.99\n\n".encode())
            process.stdin.flush()
        # The header comes with the first answer, which shows whether there are classes.
        assert answer(process).startswith(b"t,track_id,left,")
        assert answer(process).split(b",")[1] == b"1"


def test_csv_out_is_byte_for_byte_the_causal_table_of_track(joint_lines, tracked, monkeypatch, capsys):
    code, out, _ = stream(joint_lines, monkeypatch, capsys, *IMAGE, *KINDS, "--format", "csv")
    assert code == 0
    assert out == (tracked / "causal.csv").read_text()


def test_csv_in_and_out_is_the_causal_table_too(
    recording, detections, tracked, monkeypatch, capsys, tmp_path
):
    from jeat_graph.io.tables.detections_io import write_detections

    write_detections(detections, tmp_path / "ordered.csv")
    text = (tmp_path / "ordered.csv").read_bytes()
    code, out, _ = stream(text, monkeypatch, capsys, *IMAGE, *KINDS, "--format", "csv")
    assert code == 0
    assert out == (tracked / "causal.csv").read_text()


def test_joint_takes_scans_of_one_time_together_as_track_does(detections, tracked, monkeypatch, capsys):
    lines = "".join(scan_line(scan) for scan in reversed_within_times(detections))
    code, out, _ = stream(lines, monkeypatch, capsys, *IMAGE, *KINDS, "--joint", "--format", "csv")
    assert code == 0
    assert out == (tracked / "causal.csv").read_text()


def reversed_within_times(detections):
    """Scans in time order, those of one time in the other order of sensors."""
    return [scan for batch in detections.batches() for scan in reversed(batch)]


def test_json_out_holds_the_numbers_of_the_causal_table(joint_lines, tracked, monkeypatch, capsys):
    _, out, _ = stream(joint_lines, monkeypatch, capsys, *IMAGE, *KINDS)
    table = read_trajectories(tracked / "causal.csv")
    steps = [json.loads(text) for text in out.splitlines()]
    rows = [(step["t"], track) for step in steps for track in step["tracks"]]
    np.testing.assert_array_equal([t for t, _ in rows], table.t)
    np.testing.assert_array_equal([track["track_id"] for _, track in rows], table.track_id)
    np.testing.assert_array_equal([track["box"] for _, track in rows], table.boxes)
    np.testing.assert_array_equal([track["mean"] for _, track in rows], table.mean)
    np.testing.assert_array_equal([track["var"] for _, track in rows], table.var)
    np.testing.assert_array_equal([track["size_var"] for _, track in rows], table.size_var)
    np.testing.assert_array_equal([track["existence"] for _, track in rows], table.existence)
    assert ["|".join(track["sensors"]) for _, track in rows] == table.sensor_text()
    assert len(rows[0][1]["mean"]) == len(MEAN)
    assert len(rows[0][1]["var"]) == len(VAR)


def test_smoothed_has_the_rows_of_the_smoothed_table_of_track(
    joint_lines, tracked, monkeypatch, capsys, tmp_path
):
    path = tmp_path / "s.csv"
    code, _, _ = stream(joint_lines, monkeypatch, capsys, *IMAGE, *KINDS, "--smoothed", path)
    assert code == 0
    written, table = (file.read_text().splitlines() for file in (path, tracked / "smoothed.csv"))
    assert written[0] == table[0]
    assert sorted(written) == sorted(table)
    last: dict[str, float] = {}
    for row in written[1:]:  # of each track in order of time
        t, track = row.split(",")[:2]
        assert last.get(track, -1.0) < float(t)
        last[track] = float(t)


def test_a_scan_that_found_nothing_is_answered_too(monkeypatch, capsys):
    code, out, _ = stream(line(1.5, boxes=[], scores=[]), monkeypatch, capsys)
    assert (code, json.loads(out)) == (0, {"t": 1.5, "tracks": []})


def test_no_input_is_no_error(monkeypatch, capsys):
    assert stream("", monkeypatch, capsys) == (0, "", "")
    assert stream("\n\n", monkeypatch, capsys) == (0, "", "")


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ("{", "is not JSON"),
        ("[\n", "is not JSON: .*; a scan must be whole on its line"),
        ('[{"image_id": 1, "bbox": [1, 2, 3, 4], "score": 1}]', "unknown key 'image_id'; a scan has t"),
        ("[]", "at least one"),
        ("3", "is not JSON|an object such as|is missing"),
        ('["a"]', "an object such as"),
        ('{"t": 1, "sensor": "rgb", "scores": []}', "boxes is missing"),
        ('{"t": 1, "sensor": "rgb", "boxes": [], "score": []}', "unknown key 'score'"),
        ('{"t": "1", "sensor": "rgb", "boxes": [], "scores": []}', "t must be a number"),
        ('{"t": NaN, "sensor": "rgb", "boxes": [], "scores": []}', "must be finite"),
        ('{"t": 1, "sensor": 5, "boxes": [], "scores": []}', "sensor must be a name"),
        ('{"t": 1, "sensor": "r|d", "boxes": [], "scores": []}', "cannot be a name"),
        ('{"t": 1, "sensor": "rgb", "boxes": [[1, 2, -3, 4]], "scores": [1]}', "must be positive"),
        ('{"t": 1, "sensor": "rgb", "boxes": [[1, 2, 3, 4]], "scores": [1.5]}', r"\[0, 1\]"),
        ('{"t": 1, "sensor": "rgb", "boxes": [[1, 2, 3, 4]], "scores": []}', "shape"),
        ('{"t": 1, "sensor": "rgb", "boxes": "x", "scores": []}', "shape"),
        (
            '[{"t": 1, "sensor": "rgb", "boxes": [], "scores": []},'
            ' {"t": 2, "sensor": "evt", "boxes": [], "scores": []}]',
            "one and the same t",
        ),
        ("\xff".encode("latin-1"), "is not UTF-8"),
        ("[" * 100_000, "is not JSON"),
    ],
)
def test_a_bad_line_ends_it_with_one_line_that_names_it(bad, message, monkeypatch, capsys):
    raw = bad if isinstance(bad, bytes) else bad.encode()
    code, out, err = stream(line(0.0).encode() + b"\n" + raw + b"\n", monkeypatch, capsys, *DECLARED)
    assert code == 2
    assert len(out.splitlines()) == 1
    assert err.count("\n") == 1
    assert re.search(rf"^jeat-graph stream: <stdin>:3: .*({message})", err), err


@pytest.mark.parametrize(
    ("rows", "number", "message"),
    [
        ("t,sensor,left\n", 1, "column top is missing"),
        ("0,rgb,1,2,3,4,x\n", 2, "score must be a number"),
        ("0,rgb,1,2,3,4\n", 2, "score is missing"),
        ("0,,1,2,3,4,1\n", 2, "sensor is missing"),
        ("0,rgb,1,2,-2,4,1\n", 2, "must be positive"),
    ],
)
def test_a_bad_row_of_csv_is_named_too(rows, number, message, monkeypatch, capsys):
    head = "" if number == 1 else "t,sensor,left,top,width,height,score\n"
    code, _, err = stream(head + rows, monkeypatch, capsys)
    assert code == 2
    assert err.startswith(f"jeat-graph stream: <stdin>:{number}: ")
    assert message in err


def test_a_bad_line_costs_nothing_that_was_smoothed(monkeypatch, capsys, tmp_path):
    good = "".join(line(0.05 * k) for k in range(30))
    code, _, _ = stream(good + "{\n", monkeypatch, capsys, "--smoothed", tmp_path / "s.csv")
    assert code == 2
    assert len(read_trajectories(tmp_path / "s.csv")) == 30


def test_bad_lines_are_passed_over_and_counted_if_asked(monkeypatch, capsys, tmp_path):
    good = [line(0.05 * k) for k in range(30)]
    text = "".join([*good[:10], "{\n", *good[10:20], line(0.5, sensor="r|d"), "\udcff\n", *good[20:]])
    raw = text.encode("utf-8", "surrogateescape")
    record = tmp_path / "record.json"
    options = ("--on-error", "skip", "--record", record)
    code, out, err = stream(raw, monkeypatch, capsys, *options)
    assert code == 0
    assert [json.loads(text)["t"] for text in out.splitlines()] == [0.05 * k for k in range(30)]
    assert json.loads(record.read_text())["unreadable"] == 3
    assert [f"<stdin>:{k}" in err for k in (11, 22, 23)] == [True] * 3
    assert "3 messages could not be read" in err


def test_a_scan_that_the_tracker_refuses_is_passed_over_like_a_bad_line(monkeypatch, capsys):
    looks = [[[1.0, 2.0, 3.0]]] * 6
    looks[3] = [[1.0, 2.0]]
    text = "".join(line(0.05 * k, embeddings=one) for k, one in enumerate(looks))
    code, out, err = stream(text, monkeypatch, capsys, "--on-error", "skip")
    assert code == 0
    assert [json.loads(text)["t"] for text in out.splitlines()] == [0.05 * k for k in (0, 1, 2, 4, 5)]
    assert "<stdin>:4: embeddings must have 3 numbers" in err
    code, out, err = stream(text, monkeypatch, capsys)
    assert code == 2
    assert "<stdin>:4: embeddings must have 3 numbers" in err


def test_bad_rows_of_csv_are_passed_over_too(monkeypatch, capsys):
    text = "nonsense\nt,sensor,left,top,width,height,score\n0,rgb,1,2,3,4,x\n0,rgb\n0.1,rgb\n"
    code, out, err = stream(text, monkeypatch, capsys, "--on-error", "skip")
    assert code == 0
    assert [json.loads(text)["t"] for text in out.splitlines()] == [0.0, 0.1]
    assert "2 messages could not be read" in err


def test_times_of_another_unit_are_read_as_seconds(monkeypatch, capsys):
    times = [0.05 * k for k in range(6)]
    code, expected, _ = stream("".join(map(line, times)), monkeypatch, capsys)
    assert code == 0
    assert expected
    millis = "".join(line(1000.0 * t) for t in times)
    assert stream(millis, monkeypatch, capsys, "--time-unit", "ms")[:2] == (0, expected)


def test_late_scans_go_where_they_belong(monkeypatch, capsys, detections, tracked, tmp_path):
    """Pictures that come 80 ms late: the smoothed table is that of `track` but for the numbers of tracks."""
    delay = np.where(np.array(detections.sensors)[detections.scan_sensor] == "rgb", 0.08, 0.005)
    order = np.argsort(detections.scan_t + delay, kind="stable")
    lines = "".join(scan_line(detections.scan(int(k))) for k in order)
    path, record = tmp_path / "s.csv", tmp_path / "record.json"
    options = (*IMAGE, *KINDS, "--smoothed", path, "--record", record)
    code, out, err = stream(lines, monkeypatch, capsys, *options)
    assert code == 0
    assert len(out.splitlines()) == detections.num_scans
    # But for the tracks' numbers, which stay what was given out: each stands for one of the other table.
    rows, plain = (
        sorted((row[0], *row[2:], row[1]) for row in csv.reader(file.read_text().splitlines()))
        for file in (path, tracked / "smoothed.csv")
    )
    assert [row[:-1] for row in rows] == [row[:-1] for row in plain]
    pairs = {(one[-1], other[-1]) for one, other in zip(rows, plain, strict=True)}
    assert len(pairs) == len({one for one, _ in pairs}) == len({other for _, other in pairs})
    lateness = json.loads(record.read_text())["lateness"]
    assert lateness["rgb"]["dropped"] == 0
    assert lateness["rgb"]["median_s"] > 0.05
    assert "sensor 'rgb'" in err


def test_late_scans_are_refused_if_asked(monkeypatch, capsys):
    code, out, err = stream(line(1.0) + line(0.5), monkeypatch, capsys, *DECLARED, "--late", "refuse")
    assert code == 2
    assert len(out.splitlines()) == 1
    assert re.search(r"^jeat-graph stream: <stdin>:2: .*older than the last one", err), err


def test_a_sensor_that_falls_silent_is_named_on_both_outputs(monkeypatch, capsys):
    lines = [line(0.01 * k, "evt") for k in range(400)]
    lines += [line(0.05 * k, "rgb") for k in range(80) if not 20 <= k < 60]
    lines.sort(key=lambda text: json.loads(text)["t"])
    code, out, err = stream("".join(lines), monkeypatch, capsys)
    assert code == 0
    events = [json.loads(text) for text in out.splitlines() if '"event"' in text]
    assert [(one["event"], one["sensor"]) for one in events] == [
        ("sensor-silent", "rgb"),
        ("sensor-back", "rgb"),
    ]
    assert events[0]["t"] == pytest.approx(1.96, abs=0.011)
    assert "sensor 'rgb' has given no scan since t = 0.950 s" in err


def test_late_scans_are_passed_over_if_asked(monkeypatch, capsys):
    code, out, err = stream(line(1.0) + line(0.5) + line(1.1), monkeypatch, capsys, "--late", "skip")
    assert code == 0
    assert [json.loads(text)["t"] for text in out.splitlines()] == [1.0, 1.1]
    assert "<stdin>:2" in err


def test_a_checkpoint_goes_on_with_the_same_answer_to_late_scans_or_not_at_all(monkeypatch, capsys, tmp_path):
    options = ("--checkpoint", tmp_path / "state.npz", "--late")
    code, out, _ = stream(line(1.0), monkeypatch, capsys, *options, "skip")
    assert (code, len(out.splitlines())) == (0, 1)
    code, out, err = stream(line(1.1), monkeypatch, capsys, *options, "refuse")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "was saved with --late skip, not refuse; give the same, or start over without the file" in err
    code, out, _ = stream(line(1.0) + line(1.1), monkeypatch, capsys, *options, "skip")
    assert (code, json.loads(out)["t"]) == (0, 1.1)


def test_a_line_that_never_ends_is_passed_over_in_bounded_memory(monkeypatch, capsys):
    monkeypatch.setattr("jeat_graph.io.streams.stream_text.LONGEST_LINE", 1000)
    monkeypatch.setattr("jeat_graph.io.streams.stream_text._REST", 64)
    text = line(1.0) + "[" * 100_000 + "\n" + line(1.1)
    code, out, err = stream(text, monkeypatch, capsys, "--on-error", "skip")
    assert code == 0
    assert [json.loads(text)["t"] for text in out.splitlines()] == [1.0, 1.1]
    assert "<stdin>:2: is a line of more than 1000 bytes; passed over" in err
    code, _, err = stream(text, monkeypatch, capsys)
    assert (code, err.splitlines()[-1]) == (
        2,
        "jeat-graph stream: <stdin>:2: is a line of more than 1000 bytes",
    )


def test_smoothed_without_a_smoother_is_refused(monkeypatch, capsys, tmp_path):
    options = ("--smoothed", tmp_path / "s.csv", "--set", "smoother.engine=none")
    code, _, err = stream("", monkeypatch, capsys, *options)
    assert code == 2
    assert "smoother" in err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_cleanly_and_keeps_the_smoothed_trajectories(number, start, tmp_path):
    path = tmp_path / "s.csv"
    with live(start("stream", "--smoothed", path)) as process:
        for k in range(30):
            process.stdin.write(line(0.05 * k).encode())
            process.stdin.flush()
            answer(process)
        process.send_signal(number)
        assert process.wait(PATIENCE_S) == 128 + number
        err = process.stderr.read().decode()
    assert "Traceback" not in err
    assert err.splitlines()[-1] == "jeat-graph stream: interrupted"
    assert len(read_trajectories(path)) == 30


def test_a_reader_that_goes_away_ends_it_cleanly(start):
    with live(start("stream")) as process:
        process.stdin.write(line(0.0).encode())
        process.stdin.flush()
        answer(process)
        process.stdout.close()
        try:
            for k in range(1, 2000):
                process.stdin.write(line(0.05 * k).encode())
                process.stdin.flush()
                time.sleep(0.0005)
        except BrokenPipeError:
            pass
        assert process.wait(PATIENCE_S) == 0
        assert b"Traceback" not in process.stderr.read()


def tables(count: int = 40) -> dict[str, str]:
    """One recording as people have it: by times, dates, frame numbers and names of pictures."""
    rows = [f"{100 + 4 * k},200,{160 + 4 * k},240,1,3" for k in range(count)]
    columns = "x1,y1,x2,y2,class_id,tracker_id"
    when = {
        "t": [f"{k / 20}" for k in range(count)],
        "timestamp": [f"1970-01-01T00:00:{k / 20:05.2f}Z" for k in range(count)],
        "frame": [f"{k + 1}" for k in range(count)],
        "image_name": [f"street/{k + 1:06d}.jpg" for k in range(count)],
    }
    return {
        name: f"{name},sensor,{columns}\n"
        + "".join(f"{t},rgb,{row}\n" for t, row in zip(values, rows, strict=True))
        for name, values in when.items()
    }


@pytest.mark.parametrize("form", ["t", "timestamp", "frame", "image_name"])
def test_stream_takes_what_track_takes_from_tables(form, tmp_path, monkeypatch, capsys):
    """The causal rows of `track` are the oracle."""
    path = tmp_path / "detections.csv"
    path.write_text(tables()[form])
    how = ["--rate", "20", "--classes", "car,truck", "--image", "1280x720"]
    assert main(["track", str(path), "--out", str(tmp_path / "run"), *how]) == 0
    capsys.readouterr()
    settings = ["--set", "sensors.rgb.rate_hz=20", "--format", "csv"]
    code, out, _ = stream(path.read_bytes(), monkeypatch, capsys, *how, *settings)
    assert code == 0
    (tmp_path / "stream.csv").write_text(out)
    found = read_trajectories(tmp_path / "stream.csv")
    wanted = read_trajectories(tmp_path / "run" / "causal.csv")
    assert found.t.tolist() == wanted.t.tolist()
    assert found.boxes == pytest.approx(wanted.boxes, abs=0.5)
    assert set(found.classes) == set(wanted.classes) == {"truck"}


def test_stream_takes_frames_from_where_they_are_said_to_begin(monkeypatch, capsys):
    text = tables(5)["frame"].encode()
    code, out, _ = stream(text, monkeypatch, capsys, "--rate", "20", "--first-frame", "0")
    assert code == 0
    assert json.loads(out.splitlines()[0])["t"] == 0.05
    code, _, err = stream(text, monkeypatch, capsys)
    assert code == 2
    assert "<stdin>:2: has frame numbers only; give their rate with --rate" in err


def test_classes_of_which_nothing_came_are_told_of_at_the_end(monkeypatch, capsys):
    rows = tables(5)["t"].encode()
    code, _, err = stream(rows, monkeypatch, capsys, "--class", "car", "bus")
    assert code == 0
    assert "warning: nothing was of class car or bus; there were: 1 (--classes FILE names them" in err
    code, _, err = stream(rows, monkeypatch, capsys, "--class", "car", "--classes", "bus,car")
    assert (code, "nothing was of class" in err) == (0, False)


def test_videos_that_are_passed_over_are_told_of_once(monkeypatch, capsys):
    rows = "t,sensor,left,top,width,height,video\n" + "".join(f"{k},rgb,1,2,30,40,v{k}\n" for k in range(9))
    code, out, err = stream(rows, monkeypatch, capsys, "--only-video", "v8")
    assert code == 0
    assert len(out.splitlines()) == 1
    assert err.count("passed over") == 1


def test_paper_pairs_scans_of_two_sensors_where_it_holds_them_back(monkeypatch, capsys):
    text = "".join(f'{{"t": {t}, "sensor": "{s}", "boxes": []}}\n' for t, s in [(0, "rgb"), (0.001, "evt")])
    pair = ("--config", "paper", "--set", "paper.pair_within_s=0.002")
    code, out, _ = stream(text, monkeypatch, capsys, *pair, "--joint")
    assert (code, [json.loads(line)["t"] for line in out.splitlines()]) == (0, [0.001])
    assert stream(text, monkeypatch, capsys, *pair)[::2] == (
        2,
        "jeat-graph stream: paper.pair_within_s holds scans of stdin back: it needs --joint\n",
    )
