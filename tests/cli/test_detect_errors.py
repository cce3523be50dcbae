"""What is wrong with raw recordings, options and settings is said in one line."""

from __future__ import annotations

import socket

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.evt3_writer import Evt3Writer

WIDE, HIGH = 64, 48


@pytest.fixture
def recording(tmp_path):
    """A folder of eight grey pictures at 20 Hz, and .4 s of events of the same size."""
    import cv2

    frames = tmp_path / "frames"
    frames.mkdir()
    for k in range(8):
        cv2.imwrite(str(frames / f"{k:06d}.png"), np.full((HIGH, WIDE), 90, dtype=np.uint8))
    write_events(tmp_path / "events.raw", (WIDE, HIGH), 0.4)
    return tmp_path


def write_events(path, size, seconds):
    rng = np.random.default_rng(0)
    t = np.sort(rng.integers(0, max(round(1e6 * seconds), 1), round(5000 * seconds)))
    x, y = rng.integers(0, size[0], len(t)), rng.integers(0, size[1], len(t))
    with Evt3Writer(path, size) as writer:
        writer.append(EventArray(t, x.astype(np.uint16), y.astype(np.uint16), (t % 2).astype(np.uint8)))


def command(recording, *more, name="detect", events="events.raw"):
    files = ["--frames", str(recording / "frames"), "--rate", "20"]
    files += [] if events is None else ["--events", str(recording / events)]
    return [name, *files, "--out", str(recording / ("out.csv" if name == "detect" else "out")), *more]


def refused(capsys, arguments):
    """The line that says why; nothing is written."""
    try:
        code = main(arguments)
    except SystemExit as end:  # what an option's value is not, argparse says
        code = end.code
    assert code == 2
    return capsys.readouterr().err.splitlines()[-1]


def test_cameras_of_different_pixels_are_not_tracked_together(recording, capsys):
    write_events(recording / "other.raw", (WIDE, HIGH + 2), 0.4)
    line = refused(capsys, command(recording, name="track", events="other.raw"))
    assert "64 x 48 px and the events 64 x 50: say how the pictures lie, with --rig RIG.yaml" in line
    assert not list(recording.glob("out*"))
    assert main(command(recording, events="other.raw")) == 0
    assert "`track` needs to know how they lie (--rig)" in capsys.readouterr().err


def test_events_that_give_no_scan_are_named_beside_pictures(recording, capsys):
    write_events(recording / "none.raw", (WIDE, HIGH), 0.0)
    assert main(command(recording, events="none.raw")) == 0
    assert "none.raw: not one scan" in capsys.readouterr().err
    assert main(command(recording)) == 0
    assert "not one scan" not in capsys.readouterr().err


def test_a_size_that_is_not_that_of_the_pictures_is_refused_at_once(recording, capsys):
    line = refused(capsys, command(recording, "--image", "32x32", name="track"))
    assert "64 x 48 px, not the 32 x 32 of --image" in line
    assert not list(recording.glob("out*"))
    assert main(command(recording, "--image", "64x48", name="track")) == 0


def test_a_picture_of_another_size_is_named(recording, capsys):
    import cv2

    cv2.imwrite(str(recording / "frames" / "000005.png"), np.zeros((HIGH, 2 * WIDE), dtype=np.uint8))
    assert "000005.png is 128 x 48 px" in refused(capsys, command(recording, events=None))


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--event-delay", "nan"], "--event-delay: must be a finite number"),
        (["--event-delay", "inf"], "--event-delay: must be a finite number"),
        (["--event-rate", "30"], "--event-rate: rate_hz: 30 gives .* 10, 20, 25, 40, 50, 100, 200 Hz"),
        (["--detection-set", "events.window_s=2.005"], "events.window_s: 2.005 s are more than 400 bins"),
        (["--detection-set", "events.window_s=1e12"], "more than 400 bins"),
        (["--detection-set", "model_frames.mean=[1]"], "model_frames.mean: must be 3 numbers"),
        (["--detection-set", "model_frames.std=[1, 1]"], "model_frames.std: must be 3 numbers"),
        (["--detection-config", "no.yaml"], "no.yaml: no such detection file"),
        (["--detection-config", "."], r"\.: is no file"),
    ],
)
def test_settings_that_cannot_be_are_refused(recording, capsys, more, says):
    import re

    assert re.search(says, refused(capsys, command(recording, *more)))


@pytest.mark.parametrize(
    ("text", "more", "says"),
    [
        ("frames: {sigma: 8}", [], "s.yaml: unknown key frames.sigma; did you mean"),
        ("frames: {sigmas: .nan}", ["frames.samples=9"], "s.yaml, and what was set over it: frames.sigmas"),
        ("frames:\n  sigmas: 8\n  sigmas: 9", [], "s.yaml:3: not valid YAML: sigmas comes twice"),
    ],
)
def test_a_file_of_settings_is_named(recording, capsys, text, more, says):
    path = recording / "s.yaml"
    path.write_text(text, encoding="utf-8")
    changes = [part for change in more for part in ("--detection-set", change)]
    assert says in refused(capsys, command(recording, "--detection-config", str(path), *changes))


def test_the_longest_window_and_means_of_three_colours_are_taken(recording):
    wide = ["--detection-set", "events.window_s=2", "--detection-set", "model_frames.mean=[1, 2, 3]"]
    assert main(command(recording, *wide)) == 0


def test_a_camera_that_never_answers_ends_a_recording_of_a_given_length(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("jeat_graph.detection.live_detecting._FIRST_S", 0.3)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))  # nobody listens there
        camera = f"rtsp://user:canary@127.0.0.1:{silent.getsockname()[1]}/x"
        out = tmp_path / "found.csv"
        code = main(
            [
                "detect",
                "--frames",
                camera,
                "--detector-frames",
                "motion",
                "--duration",
                "0.2",
                "--out",
                str(out),
            ]
        )
    last = capsys.readouterr().err.splitlines()[-1]
    assert code == 2
    assert last == f"jeat-graph detect: nothing came in 0.3 s from {camera.replace('user:canary', '***')}"
    assert not out.exists()
