"""`jeat-graph render`: what is drawn lies where the tables have it."""

from __future__ import annotations

import json
import re

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.cli.main import main
from jeat_graph.data.events import EventArray
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.drawing.movie.backgrounds import accumulate
from jeat_graph.drawing.movie.marks import Canvas, dashes
from jeat_graph.drawing.movie.moments import TracksAt, TruthAt
from jeat_graph.drawing.palette import BRIGHTER, DARK, DARKER, track_rgb
from jeat_graph.io.tables.trajectories_io import read_trajectories, write_trajectories
from jeat_graph.io.tables.truth_io import write_truth

from .conftest import HEIGHT, WIDTH, grey_frame, read_movie, truth_of, vehicle


def blank():
    return np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)


def extent(image):
    """First and last column and row (x0, y0, x1, y1) that is not black."""
    rows, columns = np.nonzero(image.any(axis=2))
    return columns.min(), rows.min(), columns.max(), rows.max()


def close_to(image, colour, tolerance=40):
    return (np.abs(image.astype(int) - np.array(colour)).max(axis=2) <= tolerance) & (image.max(axis=2) > 30)


def test_a_thin_box_lies_on_the_edges_of_the_box():
    canvas = Canvas(blank(), (1.0, 1.0))
    canvas.thin_box(np.array([20.0, 30.0, 40.0, 24.0]), (255, 255, 255))
    assert extent(canvas.image) == pytest.approx((20, 30, 60, 54), abs=1)
    assert canvas.image[42, 40].max() == 0


def test_coordinates_are_scaled_to_the_picture():
    canvas = Canvas(blank(), (0.5, 0.25))
    canvas.thin_box(np.array([40.0, 80.0, 80.0, 160.0]), (255, 255, 255))
    assert extent(canvas.image) == pytest.approx((20, 20, 60, 60), abs=1)


def test_the_ellipse_reaches_two_standard_deviations():
    canvas = Canvas(blank(), (1.0, 1.0))
    canvas.ellipse(np.array([80.0, 48.0]), np.array([15.0, 6.0]), (255, 255, 255))
    assert extent(canvas.image) == pytest.approx((50, 36, 110, 60), abs=1)


def test_no_ellipse_where_the_variance_is_not_known():
    canvas = Canvas(blank(), (1.0, 1.0))
    canvas.ellipse(np.array([80.0, 48.0]), np.array([np.nan, np.nan]), (255, 255, 255))
    assert canvas.image.max() == 0


@pytest.mark.parametrize("far", [1e5, -1e5, 1e9])
def test_what_lies_far_outside_does_no_harm(far):
    canvas = Canvas(blank(), (1.0, 1.0))
    box = np.array([far, far, 40.0, 30.0])
    canvas.solid_box(box, (255, 0, 0), 2)
    canvas.dashed_box(box, (255, 0, 0), 2)
    canvas.ellipse(box[:2], np.array([5.0, 5.0]), (255, 0, 0))
    canvas.trail(np.array([box[:2], box[:2] + 1]), (255, 0, 0), 2)
    assert canvas.image[10:-10, 10:-10].max() == 0


@given(width=st.floats(0.5, 500), height=st.floats(0.5, 500), dash=st.floats(1, 20), gap=st.floats(1, 20))
def test_dashes_lie_on_the_outline_and_cover_its_corners(width, height, dash, gap):
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]])
    pieces = dashes(corners, dash, gap)
    x, y = pieces[..., 0], pieces[..., 1]
    on_edge = np.isclose(x, 0) | np.isclose(x, width) | np.isclose(y, 0) | np.isclose(y, height)
    assert on_edge.all()
    assert (x >= -1e-9).all()
    assert (x <= width * (1 + 1e-9)).all()
    for corner in corners:
        assert np.isclose(pieces.reshape(-1, 2), corner, atol=1e-6).all(axis=1).any()
    if width > 2 * (dash + gap):
        top = pieces[np.isclose(y, 0).all(axis=1)]
        assert np.abs(np.diff(top[..., 0], axis=1)).sum() < width


def test_a_dashed_box_has_gaps_and_a_solid_one_has_none():
    box = np.array([20.0, 20.0, 100.0, 50.0])
    solid, dashed = Canvas(blank(), (1.0, 1.0)), Canvas(blank(), (1.0, 1.0))
    solid.solid_box(box, (255, 255, 255), 1)
    dashed.dashed_box(box, (255, 255, 255), 1)
    assert (solid.image[20, 21:119].max(axis=1) > 100).all()
    lit = dashed.image[20, 21:119].max(axis=1) > 100
    assert 0.3 < lit.mean() < 0.9


def test_the_causal_box_is_drawn_at_its_rows_place(run, picture):
    image = picture(run, 0.5, "--only", "causal", "--size", f"{WIDTH}x{HEIGHT}")
    reach = read_size(run)
    scale = np.array([WIDTH / reach[0], HEIGHT / reach[1]])
    left, top = (np.array([30 + 25 - 12, 40 + 5 - 8]) * scale).round().astype(int)
    right, bottom = (np.array([30 + 25 + 12, 40 + 5 + 8]) * scale).round().astype(int)
    lit = image.max(axis=2) > 90
    assert lit[(top + bottom) // 2, left - 1 : left + 2].any()
    assert lit[(top + bottom) // 2, right - 1 : right + 2].any()
    assert lit[top - 1 : top + 2, (left + right) // 2].any()
    assert lit[bottom - 1 : bottom + 2, (left + right) // 2].any()


def read_size(run):
    """Without run.json the picture reaches as far as the boxes do."""
    table = read_trajectories(run / "causal.csv")
    return np.ceil((table.boxes[:, :2] + table.boxes[:, 2:]).max(axis=0))


def test_causal_tracks_are_predicted_and_smoothed_ones_interpolated():
    times = np.array([0.32, 0.37])
    table = vehicle([0.0, 0.3, 0.6])
    now = TracksAt(table, times, "causal").at(0)
    late = TracksAt(table, times, "smoothed").at(1)
    np.testing.assert_allclose(now.centre[0], [30 + 0.32 * 50, 40 + 3.2])
    np.testing.assert_allclose(late.centre[0], [30 + 0.37 * 50, 40 + 3.7])


def test_nothing_of_a_causal_table_that_came_later_is_drawn():
    table = vehicle([0.0, 0.1, 0.2, 0.3])
    changed = vehicle([0.0, 0.1, 0.2, 0.3])
    changed.mean[3] = 1.0
    for k, t in enumerate([0.05, 0.25]):
        a = TracksAt(table, np.array([0.05, 0.25]), "causal").at(k)
        b = TracksAt(changed, np.array([0.05, 0.25]), "causal").at(k)
        np.testing.assert_array_equal(a.boxes, b.boxes)
        np.testing.assert_array_equal(a.trails[0], b.trails[0])
        assert len(a.trails[0]) == 1 + (1 if t < 0.1 else 3)


def test_a_trail_holds_the_last_second_of_its_own_track():
    table = vehicle(np.arange(0, 61) * 0.05)
    other = vehicle(np.arange(0, 61) * 0.05, track_id=2, start=(100.0, 10.0))
    both = Trajectories.concatenate([other, table])
    marks = TracksAt(both, np.array([2.5]), "causal").at(0)
    mine = marks.trails[marks.track_id.tolist().index(1)]
    wanted = 30.0 + 50.0 * np.array([*(np.arange(30, 51) * 0.05), 2.5])
    np.testing.assert_allclose(mine[:, 0], wanted)


def test_truth_between_frames_lies_on_the_straight_way():
    truth = truth_of(vehicle([0.0, 0.1, 0.2]))
    for t in (0.0, 0.03, 0.08, 0.2):
        boxes, ignored = TruthAt(truth).at(t)
        np.testing.assert_allclose(boxes[0, :2], [30 + 50 * t - 12, 40 + 10 * t - 8])
        assert len(ignored) == 0
    assert len(TruthAt(truth).at(0.4)[0]) == 0


def test_truth_that_is_ignored_is_drawn_apart():
    table = vehicle([0.0, 0.0])
    truth = GroundTruth(table.t, np.array([1, 2]), table.boxes, None, np.array([False, True]))
    wanted, ignored = TruthAt(truth).at(0.0)
    assert (len(wanted), len(ignored)) == (1, 1)


def test_truth_is_drawn_as_thin_outline(segment, picture):
    image = picture(segment, 0.25)
    left, bottom = 30 + 12.5 - 12, 40 + 2.5 + 8
    row = round(bottom) - 4
    assert image[row, round(left) - 1 : round(left) + 2].min(axis=1).max() > 120


def test_events_are_counted_by_pixel_and_kind():
    events = EventArray(
        t_us=np.arange(4),
        x=np.array([3, 3, 5, 200], dtype=np.uint16),
        y=np.array([2, 2, 7, 2], dtype=np.uint16),
        polarity=np.array([1, 1, 0, 1], dtype=np.uint8),
    )
    image = accumulate(events, (10, 8))
    strength = 1 - np.exp(-2.0)
    wanted = np.rint((1 - strength) * np.array(DARK) + strength * np.array(BRIGHTER))
    np.testing.assert_array_equal(image[2, 3], wanted)
    strength = 1 - np.exp(-1.0)
    wanted = np.rint((1 - strength) * np.array(DARK) + strength * np.array(DARKER))
    np.testing.assert_array_equal(image[7, 5], wanted)
    rest = np.ones((8, 10), dtype=bool)
    rest[2, 3] = rest[7, 5] = False
    assert (image[rest] == DARK).all()


def test_a_segment_shows_its_frame_beside_the_events_of_the_time_before(segment, picture, events):
    image = picture(segment, 0.26, "--window", 0.03)
    assert image.shape == (HEIGHT, 2 * WIDTH, 3)
    inside = np.s_[60:76, 100:150]  # clear of box and texts
    assert (image[:, :WIDTH][inside] == grey_frame(4)[0, 0, 0]).all()
    shown = (events.t_us > 230_000) & (events.t_us <= 260_000)
    np.testing.assert_array_equal(
        image[:, WIDTH:][inside], accumulate(events.take(shown), (WIDTH, HEIGHT))[inside]
    )


def test_a_frame_is_shown_until_the_next_one(segment, picture):
    for t, k in ((0.0, 0), (0.05, 0), (0.0999, 0), (0.1, 1), (0.5, 9), (0.9, 9)):
        assert picture(segment, t)[70, 120, 0] == grey_frame(k)[0, 0, 0]


def test_events_of_a_table_are_drawn_like_those_of_a_file(segment, run, picture, capsys):
    """A CSV file says nothing of its picture's size; the option does."""
    from jeat_graph.io.events.opening import open_events

    with open_events(segment / "events.h5") as reader:
        events = EventArray.concatenate(list(reader.pieces()))
    columns = np.c_[events.t_us, events.x, events.y, events.polarity]
    table = segment / "events.csv"
    np.savetxt(table, columns, fmt="%d", delimiter=",", header="time_us,x,y,p", comments="")
    size = ["--event-size", f"{WIDTH}x{HEIGHT}"]
    image = picture(run, 0.3, "--events", table, *size, "--only", "causal")
    expected = picture(run, 0.3, "--events", segment / "events.h5", "--only", "causal")
    np.testing.assert_array_equal(image, expected)


def test_tracks_lie_on_frames_and_events_alike(segment, run, picture):
    image = picture(run, 0.3, "--frames", segment, "--events", segment / "events.h5", "--only", "causal")
    lit = close_to(image, track_rgb(1), 60)
    box = np.s_[30:60, 25:65]
    assert lit[:, :WIDTH][box].sum() > 50
    np.testing.assert_allclose(lit[:, :WIDTH][box].sum(), lit[:, WIDTH:][box].sum(), rtol=0.2)


def test_only_leaves_the_other_table_out(run, picture):
    both = picture(run, 0.5)
    causal = picture(run, 0.5, "--only", "causal")
    smoothed = picture(run, 0.5, "--only", "smoothed")
    assert (both != causal).any()
    assert (both != smoothed).any()
    assert (causal != smoothed).any()


def test_a_movie_has_each_frame_at_the_frames_own_rate(segment, tmp_path):
    out = tmp_path / "x.mp4"
    assert main(["render", str(segment), "--codec", "vp9", "--out", str(out)]) == 0
    frames, rate = read_movie(out)
    assert frames.shape == (10, HEIGHT, 2 * WIDTH, 3)
    assert rate == pytest.approx(20.0)
    # OpenCV's way to the film's colours and back truncates: of any grey, whatever the codec, it takes 3, 1
    # and 4 levels off red, green and blue. The frames are 10 levels apart.
    seen = frames[:, 55:70, 100:150].mean(axis=(1, 2))
    shown = 20.0 + 10.0 * np.arange(10)[:, None] - [3.0, 1.0, 4.0]
    assert np.abs(seen - shown).max() < 1.5


def test_rate_start_and_end_choose_the_times(run, tmp_path):
    out = tmp_path / "x.mp4"
    command = ["render", str(run), "--out", str(out), "--output-rate", "10", "--start", "0.2", "--end", "0.7"]
    assert main([*command, "--size", "320x180"]) == 0
    frames, rate = read_movie(out)
    assert frames.shape == (6, 180, 320, 3)
    assert rate == pytest.approx(10.0)


def test_odd_sizes_are_made_even(run, tmp_path):
    out = tmp_path / "x.mp4"
    assert main(["render", str(run), "--out", str(out), "--size", "101x77", "--end", "0.1"]) == 0
    assert read_movie(out)[0].shape[1:3] == (78, 102)


def test_the_same_run_gives_the_same_bytes(run, tmp_path):
    for name in ("a.mp4", "b.mp4"):
        assert main(["render", str(run), "--out", str(tmp_path / name)]) == 0
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_a_smaller_copy_of_the_video_is_drawn_on_in_its_own_scale(tmp_path, picture, recording_of_size):
    run, frames = recording_of_size((320, 192), (WIDTH, HEIGHT))
    image = picture(run, 0.1, "--frames", frames, "--only", "causal", "--size", "320x192")
    same = picture(run, 0.1, "--only", "causal")
    np.testing.assert_array_equal(
        close_to(image, track_rgb(1), 30)[60:], close_to(same, track_rgb(1), 30)[60:]
    )


def test_frames_of_another_shape_are_warned_of(capsys, picture, recording_of_size):
    run, frames = recording_of_size((400, 192), (WIDTH, HEIGHT))
    picture(run, 0.1, "--frames", frames)
    assert "400 x 192" in capsys.readouterr().err


@pytest.fixture
def recording_of_size(tmp_path):
    """A run configured for one size of picture, and frames of another."""

    def make(configured, actual):
        run, frames = tmp_path / "sized", tmp_path / "frames"
        run.mkdir()
        frames.mkdir()
        write_trajectories(vehicle(np.arange(5) * 0.05, start=(150.0, 120.0)), run / "causal.csv")
        image = {"width": configured[0], "height": configured[1]}
        (run / "run.json").write_text(json.dumps({"config": {"image": image}}))
        for k in range(3):
            cv2.imwrite(str(frames / f"{k}.png"), np.full((actual[1], actual[0], 3), DARK[::-1], np.uint8))
        (frames / "frames.csv").write_text("index,t_us\n0,0\n1,50000\n2,100000\n")
        return run, frames

    return make


def test_a_strip_is_moments_from_first_to_last_one_below_the_other(run, tmp_path):
    def drawn(*arguments):
        out = tmp_path / "x.png"
        assert main(["render", str(run), "--out", str(out), *arguments]) == 0
        return cv2.imread(str(out))

    strip = drawn("--strip", "3", "--output-rate", "10")
    alone = [drawn("--at", t) for t in ("0", "0.5", "1")]
    np.testing.assert_array_equal(strip, np.concatenate(alone))


def test_truth_alone_may_be_far_longer_than_the_tracks(run, tmp_path):
    gt = tmp_path / "gt.csv"
    write_truth(truth_of(vehicle(np.arange(41) * 0.05)), gt)
    out = tmp_path / "x.mp4"
    assert main(["render", str(run), "--gt", str(gt), "--out", str(out), "--output-rate", "10"]) == 0
    assert len(read_movie(out)[0]) == 21


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--out", "x.avi"], "must end in .mp4"),
        (["--out", "x.png"], "--at"),
        (["--out", "x.mp4", "--at", "1"], "must end in .png"),
        (["--out", "x.mp4", "--strip", "2"], "must end in .png"),
        (["--out", "x.mp4", "--start", "5"], "nothing to draw from 5 s; the recording lasts from 0 s to 1 s"),
        (["--out", "x.mp4", "--start", "5", "--end", "4"], "--end 4 s lies before the start, 5 s"),
        (["--out", "x.mp4", "--start", "5", "--end", "6"], "lasts from 0 s to 1 s"),
        (["--out", "x.mp4", "--frames", "gone.mp4"], "gone.mp4"),
        (["--out", "x.mp4", "--events", "gone.h5"], "gone.h5"),
        (["--out", "x.mp4", "--gt", "gone.csv"], "gone.csv"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line_and_leaves_nothing(
    run, tmp_path, monkeypatch, capsys, arguments, message
):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    assert main(["render", str(run), *arguments]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert re.search(message, err)
    assert sorted(tmp_path.iterdir()) == before


def test_a_whole_data_set_is_refused_with_the_way_on(segment, tmp_path, capsys):
    root = tmp_path / "set"
    (root / "segments").mkdir(parents=True)
    assert main(["render", str(root), "--out", str(tmp_path / "x.mp4")]) == 2
    assert "segments/000000" in capsys.readouterr().err


def test_an_input_is_not_overwritten(segment, run, tmp_path, capsys):
    film = tmp_path / "film.mp4"
    assert main(["render", str(run), "--out", str(film)]) == 0
    before = film.read_bytes()
    assert main(["render", str(run), "--frames", str(film), "--out", str(film)]) == 2
    assert "would be replaced" in capsys.readouterr().err
    assert film.read_bytes() == before


def test_a_failure_halfway_leaves_no_movie(segment, tmp_path, capsys):
    (segment / "frames" / "000006.png").write_bytes(b"no picture")
    out = tmp_path / "out" / "x.mp4"
    assert main(["render", str(segment), "--out", str(out)]) == 2
    assert "000006.png" in capsys.readouterr().err
    assert list(out.parent.glob("*")) == []
