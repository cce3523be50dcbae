"""From detections to labels: by other sensors or by itself, in the picture and on the clock of who learns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.io.tables.detections_io import write_detections
from jeat_graph_sehn.teaching.lesson import LessonRequest, make_lesson
from jeat_graph_sehn.teaching.recordings import EventRecording, chosen_frames, later_of

from .drawn_road import SIZE, detections_of, vehicles_at

#: The event camera sees the same in twice as many pixels, and its clock is late.
LATE_S = 0.3
OWN = (2 * SIZE[0], 2 * SIZE[1])
RIG = f"""
image: [{SIZE[0]}, {SIZE[1]}]
sensors:
  rgb: {{image: [{SIZE[0]}, {SIZE[1]}], to_picture: none}}
  evt: {{image: [{OWN[0]}, {OWN[1]}], to_picture: scale, offset_s: {LATE_S}}}
"""


@pytest.fixture(scope="module")
def rigged(tmp_path_factory):
    """A folder with a minute of both sensors' detections, each in its own picture, and their rig."""
    folder = tmp_path_factory.mktemp("rigged")
    seen = detections_of(("rgb",), 60.0)
    own = detections_of(("evt",), 60.0, seed=1)
    own = replace(own, scan_t=own.scan_t + LATE_S, boxes=own.boxes * 2.0)
    write_detections(Detections.concatenate([seen, own]), folder / "detections.csv")
    (folder / "rig.yaml").write_text(RIG, encoding="utf-8")
    return folder


def request_of(folder, **more):
    return LessonRequest((folder / "detections.csv",), "evt", OWN, rig=folder / "rig.yaml", **more)


def test_labels_are_in_the_own_picture_and_on_the_own_clock(rigged):
    lesson = make_lesson(request_of(rigged, later_s=100.0))
    assert (lesson.teachers, lesson.judges, lesson.own_judge) == (("evt", "rgb"), ("rgb",), False)
    for labels in lesson.parts:
        truth = labels.truth
        rows = np.flatnonzero(~truth.ignore)
        assert len(rows) > 100
        for row in rows[:: len(rows) // 40]:
            _, true = vehicles_at(truth.t[row] + 100.0 - LATE_S)
            away = np.abs(2.0 * true - truth.boxes[row]).max(axis=1)
            assert away.min() < 2.0
    assert "tracks of rgb" in lesson.described()[1]


def test_who_has_no_other_sensor_is_judged_by_itself_and_that_is_said(rigged, tmp_path):
    late = detections_of(("evt",), 60.0)
    write_detections(replace(late, scan_t=late.scan_t + 0.05), tmp_path / "one.csv")
    known = ("sensors.evt.latency_s=0.05",)
    lesson = make_lesson(LessonRequest((tmp_path / "one.csv",), "evt", SIZE, overrides=known))
    assert (lesson.judges, lesson.own_judge) == (("evt",), True)
    assert "this says less than another sensor would" in lesson.described()[2]
    # Labels are of the times at which the sensor saw, not of those at which its detector had done.
    truth = lesson.parts.judged.truth
    for row in np.flatnonzero(~truth.ignore)[::20]:
        _, true = vehicles_at(truth.t[row])
        assert np.abs(true - truth.boxes[row]).max(axis=1).min() < 1.0


def test_sensors_and_files_that_are_not_there_are_refused(rigged, tmp_path):
    with pytest.raises(ConfigError, match="--from lidar: is none of the sensors that detected: evt, rgb"):
        make_lesson(request_of(rigged, teachers=("lidar",)))
    with pytest.raises(DataError, match=r"holds no detections\.csv: give a file of detections, or the run"):
        make_lesson(LessonRequest((tmp_path,), "evt", SIZE))
    with pytest.raises(DataError, match="no such file"):
        make_lesson(LessonRequest((tmp_path / "none.csv",), "evt", SIZE))


def test_the_offset_that_a_file_says_is_taken_where_times_need_it():
    events = EventRecording(Path("e.h5"), SIZE, end_s=60.0, later_s=1000.0)
    assert later_of(events, np.array([0.5, 59.0]), None) == 0.0
    assert later_of(events, np.array([1000.5, 1059.0]), None) == 1000.0
    assert later_of(events, np.array([0.5, 59.0]), 7.0) == 7.0
    with pytest.raises(DataError, match=r"has events from 0 to 60\.0 s, and the detections are from 500\.0"):
        later_of(events, np.array([500.0, 559.0]), None)


def test_frames_are_chosen_evenly_and_apart():
    times = np.arange(100) * 0.1
    assert chosen_frames(times, (1.0, 2.0), most=100, apart_s=0.2) == [10, 12, 14, 16, 18, 20]
    assert chosen_frames(times, (1.0, 2.0), most=3, apart_s=0.2) == [10, 14, 20]
    assert chosen_frames(times, (20.0, 30.0), most=3, apart_s=0.2) == []
