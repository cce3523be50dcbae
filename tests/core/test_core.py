"""The core takes arrays of the right type, layout and length, and nothing else; a missing one is named."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import jeat_graph
from jeat_graph.core import detection, events, io, road

ROOT = Path(__file__).parents[2]


#: What the filter on the road reads of its configuration.
MOVES = (
    *("acceleration_std", "acceleration_s", "lateral_std", "lateral_s", "speed_std", "strip_std"),
    *("edge_px", "gate", "pause", "most_beyond"),
)


def columns(rows=64):
    return tuple(np.empty(rows, kind) for kind in (np.int64, np.uint16, np.uint16, np.uint8))


def edges(rows=8):
    return tuple(np.empty(rows, kind) for kind in (np.int64, np.uint8, np.uint8))


def marked(*rows):
    """Pixels of a column, row, group and weight each."""
    return tuple(np.ascontiguousarray(np.array(rows, np.int32).reshape(-1, 4).T)[k] for k in range(4))


DECODERS = {name: getattr(events, name) for name in dir(events) if name.startswith("decode_")}
WORD = {"decode_evt2": np.uint32, "decode_evt3": np.uint16}


@pytest.mark.parametrize("name", DECODERS)
def test_a_decoder_refuses_columns_of_different_lengths(name):
    words = np.zeros(4, WORD.get(name, np.uint64))
    t, x, y, p = columns()
    with pytest.raises(ValueError, match="different lengths"):
        DECODERS[name](words, events.DecoderState(), (t, x[:-1], y, p), edges(), (64, 48))
    channel = edges()[1][:-1]
    with pytest.raises(ValueError, match="different lengths"):
        DECODERS[name](words, events.DecoderState(), columns(), (edges()[0], channel, channel), (64, 48))


@pytest.mark.parametrize("name", DECODERS)
def test_a_decoder_refuses_a_state_with_more_than_there_is_room_for(name):
    words = np.zeros(4, WORD.get(name, np.uint64))
    for place, value in (("filled", 65), ("filled", -1), ("triggers", 9)):
        state = events.DecoderState()
        setattr(state, place, value)
        with pytest.raises(ValueError, match="than there is room"):
            DECODERS[name](words, state, columns(), edges(), (64, 48))


@pytest.mark.parametrize("name", DECODERS)
def test_an_array_of_another_type_or_layout_is_refused_and_not_copied(name):
    word = WORD.get(name, np.uint64)
    other = np.zeros(4, np.int8)
    strided = np.zeros(8, word)[::2]
    for words in (other, strided):
        with pytest.raises(TypeError):
            DECODERS[name](words, events.DecoderState(), columns(), edges(), (64, 48))
    t, x, y, p = columns()
    for x_of in (x.astype(np.int32), np.empty(128, np.uint16)[::2]):
        with pytest.raises(TypeError):
            DECODERS[name](np.zeros(4, word), events.DecoderState(), (t, x_of, y, p), edges(), (64, 48))


@pytest.mark.parametrize("rows", [0, 1, 31, 32])
@pytest.mark.parametrize("name", DECODERS)
def test_a_decoder_stops_where_there_is_no_room(name, rows):
    rng = np.random.default_rng(rows)
    words = rng.integers(0, 1 << 16, (1000, 4)).astype(np.uint16).reshape(-1).view(WORD.get(name, np.uint64))
    state = events.DecoderState()
    state.ended = True
    used = DECODERS[name](words, state, columns(rows), edges(1), (64, 48))
    assert 0 <= used <= len(words)
    assert 0 <= state.filled <= rows
    assert 0 <= state.triggers <= 1


def test_an_encoder_stops_where_there_is_no_room():
    t, x, y, p = (np.zeros(100, kind) for kind in (np.int64, np.uint16, np.uint16, np.uint8))
    for name, word in (("evt2", np.uint32), ("evt3", np.uint16), ("dat", np.uint64)):
        for room in range(12):
            words = np.empty(room, word)
            taken, written = getattr(events, f"encode_{name}")(t, x, y, p, words, events.EncoderState())
            assert 0 <= taken <= 100
            assert 0 <= written <= room
    with pytest.raises(ValueError, match="different lengths"):
        events.encode_dat(t[:-1], x, y, p, np.empty(4, np.uint64), events.EncoderState())


@pytest.mark.parametrize(
    "pixels",
    [
        [(3, 2, 1, 1), (2, 2, 1, 1)],  # a column that goes back
        [(3, 2, 1, 1), (3, 2, 1, 1)],  # a pixel twice
        [(3, 2, 1, 1), (3, 1, 1, 1)],  # a row that goes back
        [(-1, 2, 1, 1)],
        [(1, -2, 1, 1)],
        [(1, 2, -1, 1)],
        [(1, 2, 4, 1)],  # of groups up to 3
    ],
)
def test_pixels_that_do_not_come_row_by_row_or_of_no_group_are_refused(pixels):
    boxes = np.zeros((1, 4))
    for call in (
        lambda: detection.group_weights(3, marked(*pixels)),
        lambda: detection.measure_groups(3, marked(*pixels), 0.0),
        lambda: detection.cloud_extents(marked(*pixels), 4),
        lambda: detection.count_inside(marked(*pixels), boxes, boxes, 4),
    ):
        with pytest.raises(ValueError, match="row by row"):
            call()


def test_no_pixels_are_nothing():
    corners, weight, pixels = detection.measure_groups(2, marked(), 0.0)
    assert corners.tolist() == [[0, 0, 0, 0]] * 2
    assert weight.tolist() == pixels.tolist() == [0, 0]
    inside, near, count = detection.count_inside(marked(), np.zeros((0, 4)), np.zeros((0, 4)), 0)
    assert inside.shape == near.shape == (0, 0)
    assert count.shape == (0,)


def test_a_share_of_more_than_all_is_refused():
    with pytest.raises(ValueError, match="at most 1"):
        detection.measure_groups(1, marked((1, 1, 1, 1)), 1.5)


def test_places_outside_the_picture_are_refused():
    ring, slots = np.zeros((2, 2, 4, 6), np.uint8), np.array([0, 1])
    for sum_of in (detection.events_of_few, detection.events_of_many):
        for y, x in ((4, 0), (0, 6), (-1, 0), (0, -1)):
            with pytest.raises(IndexError):
                sum_of(ring, slots, np.array([y], np.int32), np.array([x], np.int32))
        with pytest.raises(IndexError):
            sum_of(ring, np.array([2]), np.zeros(1, np.int32), np.zeros(1, np.int32))
    bits = np.array([[1 << 7, 0]], np.uint64)
    with pytest.raises(IndexError):
        detection.collect_marked(bits, np.ones((1, 7), np.uint8))


def test_shapes_that_do_not_belong_together_are_refused():
    slot, total = np.zeros((2, 4, 6), np.uint8), np.zeros((4, 5), np.uint16)
    with pytest.raises(ValueError, match="size of the total"):
        detection.empty_bin(slot, total)
    hot, last = np.zeros((4, 6), bool), np.zeros((4, 6), np.int32)
    t, x, y, _ = (np.zeros(1, kind) for kind in (np.int64, np.uint16, np.uint16, np.uint8))
    with pytest.raises(ValueError, match="margin"):
        detection.judge_noise(t, x, y, last, hot, (0, 1000), np.zeros(1, bool))
    with pytest.raises(ValueError, match="four columns"):
        detection.nearest_boxes(np.zeros((1, 2)), np.zeros((1, 3)))


def a_camera():
    return road.Camera(np.eye(3), np.array([0.0, 0.0, 8.0]), (9.0, 9.0), (5.0, 5.0), (10.0, 10.0), (0.0, 0.0))


def boxes_of_the_road(n=3, sensors=2):
    """Times, variances, deviations, modes, sensors, their memories and weights."""
    whole, first, ones = np.zeros((n, 2), np.int64), np.zeros(n, np.int64), np.ones((n, 4))
    return [np.arange(float(n)), ones, ones.copy(), whole, first, np.ones(sensors), np.ones(n)]


@pytest.mark.parametrize("place", [0, 1, 2, 3, 4, 6])
def test_boxes_of_the_road_of_different_lengths_are_refused(place):
    boxes = boxes_of_the_road()
    boxes[place] = boxes[place][:-1].copy()
    with pytest.raises(ValueError, match="different lengths"):
        road.whiten(np.ones((3, 4, 2)), *boxes)


@pytest.mark.parametrize("sensor", [-1, 2])
def test_a_sensor_of_the_road_that_there_is_not_is_refused(sensor):
    boxes = boxes_of_the_road()
    boxes[4][1] = sensor
    with pytest.raises(ValueError, match="no such sensor"):
        road.whiten(np.ones((3, 4, 2)), *boxes)
    moves = SimpleNamespace(**dict.fromkeys(MOVES, 1.0))
    cov, extremes, two = np.eye(3), np.ones((2, 2, 3)), np.ones((1, 2))
    one = road.Filter(a_camera(), moves, np.ones(3), cov, extremes, np.ones((2, 2)))
    with pytest.raises(ValueError, match="no such sensor"):
        one.take(0.0, np.zeros(1, np.int64), np.full(1, sensor), two, two, two, two, two)


def test_rows_of_states_stay_within_their_room():
    boxes, slopes, right = boxes_of_the_road(), np.zeros((3, 4, 5)), np.zeros((3, 4))
    keys, bounds, n = np.array([0.0, 1.0, 2.0]), np.array([0, 2, 3]), 6 + 4 * 2
    out, counts, logs = np.zeros((2, n + 4 * 2, 2 * n + 4)), np.zeros(2, np.int64), np.zeros(2)
    given = (*boxes, slopes, right, np.ones(2))
    road.chain_rows(keys, bounds, *given, out, counts, logs)
    assert counts.tolist() == [n + 8, n + 4]
    with pytest.raises(ValueError, match="room for all rows"):
        road.chain_rows(keys, bounds, *given, np.zeros((2, n + 7, 2 * n + 4)), counts, logs)
    for wrong in ([0, 4, 3], [0, 2, 2], [1, 2, 3], [0, 2, 4]):
        with pytest.raises(ValueError, match=r"bounds|room"):
            road.chain_rows(keys, np.array(wrong), *given, out, counts, logs)


def test_what_is_written_to_must_be_writable():
    values = np.zeros(3)
    values.flags.writeable = False
    with pytest.raises(TypeError):
        io.round_significant(values, 3)


def test_a_missing_core_is_named_in_one_line(tmp_path):
    package = ROOT / "jeat_graph"
    if not package.samefile(Path(jeat_graph.__file__).parent):
        pytest.skip("the package that is tested is not this checkout's")
    for folder in ("jeat_graph", "filters", "configs"):
        kinds = shutil.ignore_patterns("_core*", "__pycache__", "weights")
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=kinds)
    code = "import sys; from jeat_graph.cli.main import main; sys.exit(main(['events', 'info', 'a.raw']))"
    (tmp_path / "a.raw").write_bytes(b"% evt 3.0\n% end\n")
    found = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert found.returncode == 2
    assert found.stderr.count("\n") == 1
    assert "compiled core" in found.stderr
    assert str(tmp_path / "jeat_graph" / "core") in found.stderr
    assert "make core" in found.stderr
