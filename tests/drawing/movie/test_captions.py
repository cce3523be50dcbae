"""What stands beside the boxes of a film, the lines that count in it, and the encoders that write it."""

from __future__ import annotations

import os
import stat
import subprocess
import sys

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.drawing.movie.captions import CLASS, NUMBER, PARTS, SPEED, Captions, read_speeds
from jeat_graph.drawing.movie.film import H264, VP9, MovieWriter
from jeat_graph.drawing.movie.marks import Canvas, draw_counters, draw_totals
from jeat_graph.drawing.movie.totals import COUNTER_RGB, Counter
from jeat_graph.eval.counting import Line
from jeat_graph.eval.zones import Zone
from jeat_graph.io.media import ffmpeg
from jeat_graph.io.tables.trajectories_io import write_trajectories

from .conftest import HEIGHT, WIDTH, read_movie, vehicle


def classed(names):
    from dataclasses import replace

    table = vehicle(np.arange(len(names)) * 0.1, 7)
    return replace(table, classes=np.array(names), class_probability=np.ones(len(names)))


def test_a_caption_is_class_number_and_speed():
    table = classed(["car", "car", "van"])
    speeds = (np.array([0.0, 0.1]), np.array([7, 7]), np.array([48.6, 52.2]))
    captions = Captions(table, PARTS, speeds)
    assert captions.of(7, 0.0) == "car #7: 49 km/h"
    assert captions.of(7, 0.1) == "car #7: 52 km/h"
    assert captions.of(7, 0.25) == "van #7: 52 km/h"
    assert captions.of(7, 9.0) == "van #7"  # a speed of long ago is none
    assert captions.of(8, 0.0) == "8"


def test_a_class_is_the_one_that_was_last_said():
    captions = Captions(classed(["", "car", "", "van"]), PARTS)
    assert [captions.of(7, t) for t in (0.0, 0.1, 0.2, 0.3)] == ["7", "car #7", "car #7", "van #7"]


def test_parts_are_chosen():
    table = classed(["car", ""])
    speeds = (np.array([0.0]), np.array([7]), np.array([np.nan]))
    assert Captions(table, (CLASS,)).of(7, 0.0) == "car"
    assert Captions(table, (NUMBER,)).of(7, 0.1) == "7"
    assert Captions(table, (SPEED,), speeds).of(7, 0.0) == ""
    assert Captions(vehicle([0.0], 7), PARTS).of(7, 0.0) == "7"


def test_speeds_are_those_of_the_road(tmp_path):
    rows = "t,track_id,speed_kmh,var_speed_kmh\n0.1,3,50.5,4\n0.2,3,,\n"
    (tmp_path / "road.csv").write_text(rows)
    t, track, speed = read_speeds(tmp_path / "road.csv")
    assert (t.tolist(), track.tolist(), speed[0]) == ([0.1, 0.2], [3, 3], 50.5)
    assert np.isnan(speed[1])


def test_no_speed_is_shown_that_the_road_does_not_tell(tmp_path):
    """Wider than ± 10 km/h and than half of the speed; and of a vehicle whose own speed is blank."""
    rows = ["0.1,3,50.5,4", "0.2,3,50.5,170", "0.1,4,50.5,4", "0.1,5,12,20"]
    (tmp_path / "road.csv").write_text("\n".join(["t,track_id,speed_kmh,var_speed_kmh", *rows]))
    (tmp_path / "speeds.csv").write_text("track_id,speed_kmh\n3,50\n4,\n5,12\n")
    _, _, speed = read_speeds(tmp_path / "road.csv")
    assert np.isnan(speed).tolist() == [False, True, True, False]


def test_a_line_counts_up_to_the_time_that_is_shown():
    table = vehicle(np.arange(11) * 0.1, start=(30.0, 40.0), velocity=(100.0, 0.0))
    gate = Counter(Line(80.0, 90.0, 80.0, 0.0, "gate"), table)
    assert gate.text(0.45) == "gate: left 0, right 0"
    assert gate.text(0.55) == "gate: left 0, right 1"
    yard = Counter(Zone("yard", ((60.0, 20.0), (90.0, 20.0), (90.0, 60.0), (60.0, 60.0))), table)
    assert [yard.text(t) for t in (0.2, 0.4, 0.7)] == [
        "yard: in 0, out 0",
        "yard: in 1, out 0",
        "yard: in 1, out 1",
    ]


@pytest.mark.parametrize("only", [[], ["--only", "causal"], ["--only", "smoothed"]])
def test_the_labels_of_a_film_have_the_classes_of_its_run(only, tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(Canvas, "names", lambda self, boxes, texts, *_, **__: written.extend(texts))
    for kind in ("causal", "smoothed"):
        write_trajectories(classed(["car", "car", "van"]), tmp_path / f"{kind}.csv")
    assert main(["render", str(tmp_path), *only, "--at", "0.1", "--out", str(tmp_path / "a.png")]) == 0
    assert written == ["car #7"]


@pytest.mark.parametrize(
    ("encoder", "words", "said"),
    [
        (None, [], "(VP9, as no FFmpeg with an encoder of H.264 was found)"),
        (None, ["--codec", "vp9"], "(VP9)"),
        (("true", "libx264"), ["--codec", "vp9"], "(VP9)"),
        (("true", "libx264"), [], "(H.264, by libx264 of FFmpeg)"),
    ],
)
def test_render_says_which_codec_it_used(encoder, words, said, run, tmp_path, monkeypatch, capsys):
    from jeat_graph.drawing.movie import film

    class Encoded:
        """Stands for FFmpeg."""

        def __init__(self, *_):
            pass

        def write(self, rgb):
            pass

        def release(self):
            pass

    monkeypatch.setattr(film, "h264_encoder", lambda: encoder)
    monkeypatch.setattr(film, "FfmpegVideo", Encoded)
    monkeypatch.setattr(film, "check_frames", lambda *_: None)
    out = tmp_path / "film.mp4"
    assert main(["render", str(run), "--output-rate", "5", *words, "--out", str(out)]) == 0
    assert capsys.readouterr().out.endswith(f" px {said}\n")


def test_lines_are_drawn_where_they_lie(run, tmp_path):
    import cv2

    out = tmp_path / "moment.png"
    words = ["--line", "gate=70,56,70,4", "--labels", "none", "--at", "0", "--trails", "0"]
    assert main(["render", str(run), *words, "--out", str(out)]) == 0
    picture = cv2.imread(str(out))[..., ::-1].astype(int)
    line = np.abs(picture - COUNTER_RGB).max(axis=2) < 40
    assert line[28:40, 68:73].any(axis=1).all()
    assert not line[28:40, :40].any()  # what it has counted is written above


def test_what_a_line_has_counted_stands_clear_of_a_level_line():
    canvas = Canvas(np.zeros((200, 400, 3), dtype=np.uint8), (1.0, 1.0))
    counter = Counter(Line(20.0, 100.0, 380.0, 100.0, "gate"), vehicle([0.0, 0.1], 7))
    draw_counters(canvas, [counter])
    line = canvas.image.any(axis=2)
    draw_totals(canvas, [counter], 0.0)
    written = canvas.image.any(axis=2) & ~line
    assert written.any()
    assert np.flatnonzero(written.any(axis=1)).max() < np.flatnonzero(line.any(axis=1)).min()


def test_what_is_shown_needs_tracks(fails, tmp_path):
    out = str(tmp_path / "film.mp4")
    assert "there is nothing to draw: give a RUN, --frames or --events" in fails("render", "--out", out)
    line = ("--frames", "x.mp4", "--line", "0,0,1,1")
    assert "lines and zones count tracks: give a RUN" in fails("render", *line, "--out", out)


@pytest.fixture
def fails(capsys):
    def run(*words):
        assert main([str(word) for word in words]) == 2
        return capsys.readouterr().err

    return run


def test_frames_alone_make_a_film(tmp_path):
    import cv2

    (tmp_path / "frames").mkdir()
    for k in range(4):
        cv2.imwrite(str(tmp_path / "frames" / f"{k}.png"), np.full((HEIGHT, WIDTH, 3), 60, dtype=np.uint8))
    out = tmp_path / "film.webm"
    assert main(["render", "--frames", str(tmp_path / "frames"), "--rate", "10", "--out", str(out)]) == 0
    assert len(read_movie(out)[0]) == 4


def test_events_alone_make_a_film(tmp_path):
    from jeat_graph.data.events import EventArray
    from jeat_graph.io.events.evt3_writer import Evt3Writer

    t = np.arange(0, 400_000, 100)
    place = (t // 100 % 90).astype(np.uint16)
    events = EventArray(t, place, place % 60, (t // 100 % 2).astype(np.uint8))
    with Evt3Writer(tmp_path / "events.raw", (100, 60)) as writer:
        writer.append(events)
    out = tmp_path / "film.webm"
    words = ["--events", str(tmp_path / "events.raw"), "--output-rate", "20", "--out", str(out)]
    assert main(["render", *words]) == 0
    assert len(read_movie(out)[0]) in (8, 9)


FAKE = """#!{python}
import sys
arguments = sys.argv[1:]
if "-encoders" in arguments:
    print(" V....D libx264  H.264")
    sys.exit()
sys.stdin.buffer.read(100)
print("no space left on device", file=sys.stderr)
sys.exit(1)
"""


@pytest.fixture
def program(tmp_path, monkeypatch):
    """A program called ffmpeg that encodes nothing."""
    folder = tmp_path / "bin"
    folder.mkdir()
    path = folder / "ffmpeg"
    path.write_text(FAKE.format(python=sys.executable))
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    ffmpeg.h264_encoder.cache_clear()
    yield path
    ffmpeg.h264_encoder.cache_clear()


def test_what_ffmpeg_says_is_the_error_and_nothing_is_left(program, tmp_path):
    assert ffmpeg.h264_encoder() == (str(program), "libx264")
    out = tmp_path / "out" / "film.mp4"
    frame = np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)

    def write():
        with MovieWriter(out, (WIDTH, HEIGHT), 20.0, H264) as film:
            for _ in range(50):
                film.append(frame)

    with pytest.raises(DataError, match=r"film\.mp4: cannot be written by FFmpeg: no space left on device"):
        write()
    assert not list(tmp_path.glob("out/*"))


def test_without_an_encoder_h264_is_refused_and_vp9_is_not(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    ffmpeg.h264_encoder.cache_clear()
    film = MovieWriter(tmp_path / "film.mp4", (WIDTH, HEIGHT), 20.0, H264)
    with pytest.raises(DataError, match="there is no FFmpeg with such an encoder here"), film:
        pass
    with MovieWriter(tmp_path / "film.mp4", (WIDTH, HEIGHT), 20.0, VP9) as film:
        film.append(np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8))
    ffmpeg.h264_encoder.cache_clear()


@pytest.mark.skipif(
    ffmpeg.h264_encoder() is None, reason="no ffmpeg with an encoder of H.264 on this machine"
)
def test_the_ffmpeg_of_the_machine_writes_h264_the_same_each_time(tmp_path):
    table = vehicle(np.arange(21) * 0.05)
    write_trajectories(table, tmp_path / "causal.csv")
    films = []
    for name in ("a.mp4", "b.mp4"):
        words = [str(tmp_path / "causal.csv"), "--codec", "h264", "--out", str(tmp_path / name)]
        assert main(["render", *words]) == 0
        films.append((tmp_path / name).read_bytes())
    assert films[0] == films[1]
    assert len(read_movie(tmp_path / "a.mp4")[0]) == 26
    program, _ = ffmpeg.h264_encoder()
    said = subprocess.run([program, "-hide_banner", "-i", tmp_path / "a.mp4"], capture_output=True, text=True)
    assert "h264" in said.stderr
