"""Tables and folders as detectors, trackers and annotation tools write them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.io.tables.detections_io import read_detections, read_many
from jeat_graph.io.tables.trajectories_io import read_trajectories
from jeat_graph.io.tables.truth_io import read_truth

HZ = 20.0
#: Two vehicles over three frames, as MOTChallenge text: frame, identity, box, score.
ROWS = [(k, i, 100.0 * i + 8 * k, 300.0, 90.0, 60.0, 0.5 + 0.1 * i) for k in (1, 2, 3) for i in (1, 2)]
MOT = "".join(f"{k},{i},{x},{y},{w},{h},{s},-1,-1,-1\n" for k, i, x, y, w, h, s in ROWS)
#: Two videos, of which the second begins at frame 0 as well.
COCO_VIDEOS = {
    "videos": [{"id": 0, "name": "gantry"}, {"id": 1, "name": "bridge"}],
    "images": [
        {"id": 10 * v + k, "video_id": v, "frame_id": k, "file_name": f"{v}/{k}.jpg"}
        for v in (0, 1)
        for k in (0, 1, 2)
    ],
    "annotations": [
        {"image_id": 10 * v + k, "category_id": 1, "bbox": [100 * v + k, 5, 10, 10], "score": 0.5}
        for v in (0, 1)
        for k in (0, 2)
    ],
    "categories": [{"id": 1, "name": "car"}],
}


def same_as_mot(path: Path | str, **options) -> Detections:
    """Assert that a file holds what `MOT` holds, but for classes, and return it."""
    found = read_detections(path, **{"rate_hz": HZ, **options})
    np.testing.assert_allclose(found.scan_t, [0.0, 0.05, 0.1], rtol=1e-15)
    np.testing.assert_allclose(found.boxes, [row[2:6] for row in ROWS], atol=1e-3)
    np.testing.assert_allclose(found.scores, [row[6] for row in ROWS], rtol=1e-12)
    assert found.sensors == ("rgb",)
    return found


def corners(k: int, i: int) -> str:
    """The corners of a vehicle's box in a frame."""
    x = 100.0 * i + 8 * k
    return f"{x},300,{x + 90},360"


class TestFirstFrame:
    """Frames count from 0 where there is a frame 0, else from 1: with a header and without."""

    def test_frame_1_below_a_header_is_frame_1_of_mot_text(self, write):
        header = "frame,id,bb_left,bb_top,bb_width,bb_height,conf,x,y,z\n"
        same_as_mot(write("det.txt", MOT))
        same_as_mot(write("det.csv", header + MOT))

    def test_text_that_has_a_frame_0_counts_from_0(self, write):
        rows = MOT.splitlines()
        from_0 = "".join(f"{int(row[0]) - 1}{row[1:]}\n" for row in rows)
        same_as_mot(write("det.txt", from_0))
        same_as_mot(write("det.csv", "frame,id,left,top,width,height,conf,x,y,z\n" + from_0))

    @pytest.mark.parametrize("header", ["", "frame,id,left,top,width,height,conf,x,y,z\n"])
    def test_a_file_that_begins_later_counts_from_1_unless_it_is_told(self, write, header):
        path = write("det.csv" if header else "det.txt", header + "5,1,1,2,3,4,0.5,-1,-1,-1\n")
        assert read_detections(path, rate_hz=HZ).scan_t.tolist() == [0.2]
        assert read_detections(path, rate_hz=HZ, first_frame=0).scan_t.tolist() == [0.25]
        assert read_truth(path, rate_hz=HZ).t.tolist() == [0.2]
        assert read_trajectories(path, rate_hz=HZ, first_frame=0).t.tolist() == [0.25]

    def test_a_frame_before_the_first_is_refused(self, write):
        with pytest.raises(DataError, match=r"det\.txt:1: frames count from 1, got 0"):
            read_detections(write("det.txt", "0,1,1,2,3,4,0.5\n"), rate_hz=HZ, first_frame=1)
        with pytest.raises(DataError, match="frames count from 0 or 1, not from 2"):
            read_detections(write("det.txt", "3,1,1,2,3,4,0.5\n"), rate_hz=HZ, first_frame=2)

    def test_files_of_one_scene_count_alike(self, write):
        header = "frame,left,top,width,height\n"
        one, two = write("a.csv", header + "0,1,2,3,4\n"), write("b.csv", header + "2,1,2,3,4\n")
        found = read_many([f"rgb={one}", f"evt={two}"], rate_hz=HZ)
        assert found.sensor_times("evt").tolist() == [0.1]

    def test_images_of_coco_follow_the_rule(self, write):
        entries = [{"image_id": k, "bbox": [1, 2, 3, 4], "score": 1} for k in (1, 2)]
        assert read_detections(write("r.json", json.dumps(entries)), rate_hz=HZ).scan_t.tolist() == [
            0.0,
            0.05,
        ]

    def test_data_frames_follow_the_rule(self):
        frame = pd.DataFrame({"frame": [1, 2], "left": 1.0, "top": 2.0, "width": 3.0, "height": 4.0})
        frame["sensor"] = "rgb"
        assert Detections.from_pandas(frame, rate_hz=HZ).scan_t.tolist() == [0.0, 0.05]
        assert Detections.from_pandas(frame.assign(frame=[0, 1]), rate_hz=HZ).scan_t.tolist() == [0.0, 0.05]


@given(
    frames=st.lists(st.integers(0, 60), min_size=1, max_size=12, unique=True),
    lefts=st.lists(st.integers(0, 1000), min_size=12, max_size=12),
    said=st.sampled_from([None, 0, 1]),
)
def test_one_recording_is_the_same_in_every_format_that_counts_frames(tmp_path_factory, frames, lefts, said):
    """Whatever the first frame with a box is, and however the file says it."""
    folder = tmp_path_factory.mktemp("alike")
    rows = list(zip(frames, lefts, strict=False))
    first = said if said is not None else (0 if 0 in frames else 1)
    (folder / "m.txt").write_text("".join(f"{k},-1,{x},5,30,20,0.5,-1,-1,-1\n" for k, x in rows))
    (folder / "h.csv").write_text(
        "frame,left,top,width,height,conf\n" + "".join(f"{k},{x},5,30,20,0.5\n" for k, x in rows)
    )
    (folder / "n.csv").write_text(
        "image,x1,y1,x2,y2,conf\n" + "".join(f"a_{k:04d}.png,{x},5,{x + 30},25,0.5\n" for k, x in rows)
    )
    entries = [{"image_id": k, "bbox": [x, 5, 30, 20], "score": 0.5} for k, x in rows]
    (folder / "c.json").write_text(json.dumps(entries))
    for name in ("m.txt", "h.csv", "n.csv", "c.json"):
        if min(frames) < first:
            with pytest.raises(DataError, match="count from 1, got 0"):
                read_detections(folder / name, rate_hz=HZ, first_frame=said)
            continue
        found = read_detections(folder / name, rate_hz=HZ, first_frame=said, fill_empty=False)
        order = sorted(rows)
        np.testing.assert_allclose(found.scan_t, [(k - first) / HZ for k, _ in order], atol=1e-12)
        assert found.boxes.tolist() == [[x, 5, 30, 20] for _, x in order]


class TestTables:
    def test_supervision(self, write):
        rows = "".join(f"{corners(k, i)},{i},{s},{i},{k - 1}\n" for k, i, *_, s in ROWS)
        header = "x_min,y_min,x_max,y_max,class_id,confidence,tracker_id,frame_index\n"
        path = write("sv.csv", header + rows)
        assert same_as_mot(path).classes.tolist() == ["1", "2"] * 3
        assert same_as_mot(path, class_names=["bus", "car", "truck"]).classes.tolist() == ["car", "truck"] * 3
        assert read_trajectories(path, rate_hz=HZ).track_id.tolist() == [1, 2] * 3

    def test_supervision_with_names(self, write):
        rows = "".join(f"{corners(k, i)},2,{s},,{k - 1},car\n" for k, i, *_, s in ROWS)
        header = "x_min,y_min,x_max,y_max,class_id,confidence,tracker_id,frame_index,class_name\n"
        assert same_as_mot(write("sv.csv", header + rows)).classes.tolist() == ["car"] * 6

    @pytest.mark.parametrize("number", ["{:.1f}", "np.float64({:.1f})", "np.float32({:.1f})"])
    def test_ultralytics_to_csv(self, write, number):
        lines = []
        for n, (k, i, x, y, w, h, s) in enumerate(ROWS):
            sides = zip(("x1", "y1", "x2", "y2"), (x, y, x + w, y + h), strict=True)
            box = ", ".join(f"'{name}': {number.format(value)}" for name, value in sides)
            lines.append(f'{n},{k - 1},car,2,{s},"{{{box}}}",{i}\n')
        path = write("u.csv", ",frame,name,class,confidence,box,track_id\n" + "".join(lines))
        assert same_as_mot(path).classes.tolist() == ["car"] * 6
        assert read_truth(path, rate_hz=HZ).object_id.tolist() == [1, 2] * 3
        assert read_trajectories(path, rate_hz=HZ).final_classes() is not None

    def test_a_turned_box_is_what_encloses_it(self, write):
        box = "{'x1': 10, 'y1': 0, 'x2': 20, 'y2': 10, 'x3': 10, 'y3': 20, 'x4': 0, 'y4': 10}"
        found = read_detections(write("u.csv", f'frame,box\n0,"{box}"\n'), rate_hz=HZ)
        assert found.boxes.tolist() == [[0, 0, 20, 20]]

    @pytest.mark.parametrize("box", ["[1, 2, 3, 4]", "{'x1': 1}", "{'x1': 1, 'y1': 2, 'x2': 1e999, 'y2': 4}"])
    def test_another_box_in_one_field_is_refused_with_its_line(self, write, box):
        with pytest.raises(DataError, match=r"u\.csv:2: box must be \{'x1'"):
            read_detections(write("u.csv", f'frame,box\n0,"{box}"\n'), rate_hz=HZ)

    def test_a_track_of_a_result_needs_its_box(self, write):
        rows = "0,1,1,2,3,4\n0.05\n0.1,1,5,6,7,8\n0.15,1,,,,\n"
        path = write("r.csv", "t,track_id,left,top,width,height\n" + rows)
        with pytest.raises(DataError, match=r"r\.csv:5: a track needs a box"):
            read_trajectories(path)

    def test_a_row_of_a_result_without_a_track_is_passed_over(self, write):
        rows = "0,1,1,2,3,4\n0.05,,,,,\n0.1,,5,6,7,8\n"
        found = read_trajectories(write("r.csv", "t,track_id,left,top,width,height\n" + rows))
        assert (found.t.tolist(), found.boxes.tolist()) == ([0.0], [[1, 2, 3, 4]])

    def test_yolov5(self, write):
        rows = "".join(f"{n},{corners(k, i)},{s},7,truck,{k - 1}\n" for n, (k, i, *_, s) in enumerate(ROWS))
        path = write("y.csv", ",xmin,ymin,xmax,ymax,confidence,class,name,frame\n" + rows)
        assert same_as_mot(path).classes.tolist() == ["truck"] * 6

    def test_a_comma_behind_every_line(self, write):
        text = MOT.replace("\n", ",\n")
        same_as_mot(write("det.txt", text))
        same_as_mot(write("det.csv", "frame,id,left,top,width,height,conf,x,y,z\n" + text))
        assert len(read_trajectories(write("r.txt", text), rate_hz=HZ)) == 6

    def test_a_missing_score_is_1(self, write):
        assert read_detections(
            write("d.csv", "t,sensor,left,top,width,height\n0,rgb,1,2,3,4\n1,rgb\n")
        ).scores == [1]
        assert read_detections(write("d.txt", "1,-1,1,2,3,4\n"), rate_hz=HZ).scores == [1]
        entries = [{"image_id": 1, "bbox": [1, 2, 3, 4]}]
        assert read_detections(write("d.json", json.dumps(entries)), rate_hz=HZ).scores == [1]

    def test_frames_without_boxes_are_empty_scans_as_in_mot_text(self, write):
        header = "frame,left,top,width,height\n"
        found = read_detections(write("d.csv", header + "1,1,2,3,4\n4,1,2,3,4\n"), rate_hz=HZ)
        np.testing.assert_allclose(found.scan_t, [0.0, 0.05, 0.1, 0.15])
        # A table that says itself which scans found nothing is believed.
        found = read_detections(write("e.csv", header + "1,1,2,3,4\n2,,,,\n4,1,2,3,4\n"), rate_hz=HZ)
        np.testing.assert_allclose(found.scan_t, [0.0, 0.05, 0.15])

    def test_pictures_names_say_frames(self, write):
        rows = "".join(f"cam1/frame_{k:06d}.jpg,{corners(k, i)},{s}\n" for k, i, *_, s in ROWS)
        same_as_mot(write("d.csv", "file_name,x1,y1,x2,y2,score\n" + rows))
        same_as_mot(write("e.csv", "frame,x1,y1,x2,y2,score\n" + rows))

    def test_pictures_of_two_folders_are_two_videos(self, write):
        path = write("d.csv", "image,x1,y1,x2,y2\na/0001.png,1,2,3,4\nb/0001.png,1,2,3,4\n")
        with pytest.raises(DataError, match=r"holds 2 videos \(a/, b/\): .* --only-video"):
            read_detections(path, rate_hz=HZ)
        assert len(read_detections(path, rate_hz=HZ, video="a/")) == 1


class TestTimes:
    @pytest.mark.parametrize(
        ("texts", "seconds"),
        [
            (("1970-01-01T00:00:10.04", "1970-01-01 00:00:10.08"), (10.04, 10.08)),
            (("1970-01-01T00:00:10.04Z", "1970-01-01T02:00:10.08+02:00"), (10.04, 10.08)),
            (("1970-01-01T00:00:10.040000000", "1970-01-01T00:00:10,08"), (10.04, 10.08)),
            (("1970-01-01T00:00:10", "1970-01-02"), (10.0, 86400.0)),
            (("00:00:01.250", "00:01:01"), (1.25, 61.0)),
            (("0:01.5", "01:00:00.5"), (1.5, 3600.5)),
        ],
    )
    def test_dates_and_time_codes_are_seconds(self, write, texts, seconds):
        rows = "".join(f'"{text}",rgb,1,2,3,4,0.5\n' for text in texts)
        found = read_detections(write("d.csv", "t,sensor,left,top,width,height,score\n" + rows))
        assert found.scan_t.tolist() == list(seconds)

    def test_time_codes_with_frames_need_a_rate(self, write):
        path = write("d.csv", "time,sensor,left,top,width,height\n00:00:01:05,rgb,1,2,3,4\n")
        assert read_detections(path, rate_hz=25.0).scan_t.tolist() == [1.2]
        with pytest.raises(DataError, match=r"d\.csv:2: t must be a time, .*; give the rate of its frames"):
            read_detections(path)

    @pytest.mark.parametrize("text", ["2026-13-01", "2026-01-01T25:00", "00:61:00", "yesterday", "1.2.3"])
    def test_what_is_no_time_is_named_by_its_line(self, write, text):
        rows = f"0,rgb,1,2,3,4\n{text},rgb,1,2,3,4\n"
        with pytest.raises(DataError, match=r"d\.csv:3: t must be a (time|number), got"):
            read_detections(write("d.csv", "t,sensor,left,top,width,height\n" + rows))

    def test_a_unit_beside_dates_is_refused(self, write):
        path = write("d.csv", "t,sensor,left,top,width,height\n2026-01-01T00:00:00,rgb,1,2,3,4\n")
        with pytest.raises(DataError, match="holds dates, but --time-unit says ms"):
            read_detections(path, time_unit="ms")

    def test_dates_of_parquet(self, tmp_path):
        table = pd.DataFrame({"t": pd.to_datetime(["1970-01-01T00:00:10.04", "1970-01-01T00:00:10.08"])})
        table = table.assign(sensor="rgb", left=1.0, top=2.0, width=3.0, height=4.0)
        table.to_parquet(tmp_path / "d.parquet")
        assert read_detections(tmp_path / "d.parquet").scan_t.tolist() == [10.04, 10.08]


class TestVideos:
    def test_two_videos_in_a_table_are_refused_unless_one_is_chosen(self, write):
        rows = "a.mp4,0,1,2,3,4\na.mp4,1,1,2,3,4\nb.mp4,0,5,6,7,8\n"
        path = write("d.csv", "video,frame,left,top,width,height\n" + rows)
        message = r"d\.csv: holds 2 videos \(a\.mp4, b\.mp4\): read one of them with --only-video NAME"
        with pytest.raises(DataError, match=message):
            read_detections(path, rate_hz=HZ)
        assert read_detections(path, rate_hz=HZ, video="b.mp4").boxes.tolist() == [[5, 6, 7, 8]]
        with pytest.raises(DataError, match=r"holds no video 'c'; there are a\.mp4, b\.mp4"):
            read_detections(path, rate_hz=HZ, video="c")

    def test_a_wrong_row_of_the_chosen_video_is_named_by_its_own_line(self, write):
        rows = "a,0,1,2,3,4\nb,0,5,6,7,8\nb,1,5,6,-7,8\n"
        path = write("d.csv", "video,frame,left,top,width,height\n" + rows)
        with pytest.raises(DataError, match=r"d\.csv:4: width and height must be positive"):
            read_detections(path, rate_hz=HZ, video="b")

    @pytest.mark.parametrize("read", [read_truth, read_trajectories])
    def test_nor_are_they_laid_over_each_other_in_truth_and_results(self, write, read):
        rows = "a,0,7,1,2,3,4\nb,0,7,5,6,7,8\n"
        path = write("d.csv", "video,frame,track_id,left,top,width,height\n" + rows)
        with pytest.raises(DataError, match="holds 2 videos"):
            read(path, rate_hz=HZ)
        assert read(path, rate_hz=HZ, video="b").boxes.tolist() == [[5, 6, 7, 8]]

    def test_two_videos_in_coco_are_refused_unless_one_is_chosen(self, write):
        path = write("d.json", json.dumps(COCO_VIDEOS))
        with pytest.raises(DataError, match=r"holds 2 videos \(0 \(gantry\), 1 \(bridge\)\)"):
            read_detections(path, rate_hz=HZ)
        for name in (1, "1", "bridge"):
            found = read_detections(path, rate_hz=HZ, video=name)
            assert found.boxes[:, 0].tolist() == [100, 102]
            assert found.scan_t.tolist() == [0.0, 0.05, 0.1]

    def test_data_frames_with_two_videos_are_refused(self):
        frame = pd.DataFrame({"video": ["a", "b"], "t": 0.0, "sensor": "rgb", "left": 1.0, "top": 2.0})
        frame = frame.assign(width=3.0, height=4.0)
        with pytest.raises(DataError, match=r"holds 2 videos \(a, b\)"):
            Detections.from_pandas(frame)
        assert len(Detections.from_pandas(frame[frame.video == "a"])) == 1


class TestYoloLabels:
    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        """The boxes of `MOT` in shares of 1280 x 720, without frame 4, and an empty file of frame 5."""
        out = tmp_path / "labels"
        out.mkdir()
        for k, i, x, y, w, h, s in ROWS:
            shares = f"{(x + w / 2) / 1280:.7f} {(y + h / 2) / 720:.7f} {w / 1280:.7f} {h / 720:.7f}"
            with (out / f"night_{k}.txt").open("a", encoding="utf-8") as file:
                file.write(f"{i} {shares} {s:.2f} {i}\n")
        (out / "night_5.txt").write_text("")
        return out

    def test_a_folder_is_read_with_its_empty_frames(self, folder):
        found = read_detections(folder, rate_hz=HZ, image=(1280, 720))
        np.testing.assert_allclose(found.scan_t, [0.0, 0.05, 0.1, 0.15, 0.2])
        np.testing.assert_allclose(found.boxes, [row[2:6] for row in ROWS], atol=1e-3)
        np.testing.assert_allclose(found.scores, [row[6] for row in ROWS])
        assert found.classes.tolist() == ["1", "2"] * 3
        assert read_truth(folder, rate_hz=HZ, image=(1280, 720)).object_id.tolist() == [1, 2] * 3
        assert read_trajectories(folder, rate_hz=HZ, image=(1280, 720)).track_id.tolist() == [1, 2] * 3

    def test_names_come_from_a_list_beside_the_labels(self, folder):
        (folder / "classes.txt").write_text("person\ncar\ntruck\n")
        found = read_detections(folder, rate_hz=HZ, image=(1280, 720))
        assert found.classes.tolist() == ["car", "truck"] * 3

    def test_the_size_of_the_picture_is_asked_for(self, folder):
        with pytest.raises(DataError, match="shares of the picture; give its size with --image"):
            read_detections(folder, rate_hz=HZ)

    def test_a_wrong_line_is_named(self, folder):
        (folder / "night_2.txt").write_text("1 0.5 0.5 x 0.1 0.5 1\n")
        with pytest.raises(DataError, match=r"night_2\.txt:1: must hold finite numbers, got 'x'"):
            read_detections(folder, rate_hz=HZ, image=(1280, 720))

    def test_labels_of_two_videos_are_not_mixed(self, folder):
        (folder / "day_1.txt").write_text("1 0.5 0.5 0.1 0.1 0.9 1\n")
        with pytest.raises(DataError, match=r"holds 2 videos \(day, night\)"):
            read_detections(folder, rate_hz=HZ, image=(1280, 720))
        assert len(read_detections(folder, rate_hz=HZ, image=(1280, 720), video="day")) == 1

    def test_a_sixth_column_is_a_score_or_a_track(self, tmp_path):
        (tmp_path / "a_1.txt").write_text("1 0.5 0.5 0.1 0.1 0.9\n")
        assert read_detections(tmp_path, rate_hz=HZ, image=(100, 100)).scores.tolist() == [0.9]
        (tmp_path / "a_1.txt").write_text("1 0.5 0.5 0.1 0.1 1\n1 0.2 0.2 0.1 0.1 2\n")
        assert read_truth(tmp_path, rate_hz=HZ, image=(100, 100)).object_id.tolist() == [1, 2]

    def test_a_sixth_column_of_ones_or_of_fractions_is_a_score(self, tmp_path):
        (tmp_path / "a_1.txt").write_text("1 0.5 0.5 0.1 0.1 1\n1 0.2 0.2 0.1 0.1 1\n")
        assert read_detections(tmp_path, rate_hz=HZ, image=(100, 100)).scores.tolist() == [1.0, 1.0]
        with pytest.raises(DataError, match="has no identities"):
            read_truth(tmp_path, rate_hz=HZ, image=(100, 100))
        (tmp_path / "a_1.txt").write_text("1 0.5 0.5 0.1 0.1 90\n1 0.2 0.2 0.1 0.1 12.5\n")
        found = read_detections(tmp_path, rate_hz=HZ, image=(100, 100), score_scale="percent")
        assert found.scores.tolist() == [0.9, 0.125]

    def test_a_score_of_minus_1_is_none_and_says_nothing_of_the_track(self, tmp_path):
        (tmp_path / "a_1.txt").write_text("1 0.5 0.5 0.1 0.1 -1 7\n")
        found = read_trajectories(tmp_path, rate_hz=HZ, image=(100, 100))
        assert (found.existence.tolist(), found.track_id.tolist()) == ([1.0], [7])

    def test_classes_count_from_0(self, tmp_path):
        (tmp_path / "a_1.txt").write_text("0 0.5 0.5 0.1 0.1\n")
        found = read_detections(tmp_path, rate_hz=HZ, image=(100, 100), class_names="person,bicycle")
        assert found.classes.tolist() == ["person"]

    @pytest.mark.parametrize(
        ("line", "words"),
        [
            ("-1 0.5 0.5 0.1 0.1", "the class must be a whole number, got -1"),
            ("0.5 0.5 0.5 0.1 0.1", "the class must be a whole number, got 0.5"),
            ("0 0.5 0.5 -0.1 0.1", "width and height must not be negative"),
            ("0 0.5 0.5 0.1 -0.1", "width and height must not be negative"),
            ("0 0.5 0.5 0.1", "4 fields, but a label of YOLO has 5 to 7"),
            ("0 0.5 0.5 0.1 0.1 0.9 1 1", "8 fields, but a label of YOLO has 5 to 7"),
        ],
    )
    def test_what_is_no_label_is_named_by_its_line(self, tmp_path, line, words):
        (tmp_path / "a_1.txt").write_text(f"\n0 0.5 0.5 0.1 0.1\n{line}\n")
        with pytest.raises(DataError, match=rf"a_1\.txt:3: {words}"):
            read_detections(tmp_path, rate_hz=HZ, image=(100, 100))

    def test_a_box_without_area_is_left_out_as_in_other_formats(self, tmp_path):
        (tmp_path / "a_1.txt").write_text("0 0.5 0.5 0 0.1\n0 0.5 0.5 0.1 0.1\n")
        found = read_detections(tmp_path, rate_hz=HZ, image=(100, 100))
        assert (len(found), found.dropped) == (1, 1)

    def test_one_file_alone_is_told_to_come_as_a_folder(self, folder):
        with pytest.raises(DataError, match=r"looks like labels of YOLO .* give the folder"):
            read_detections(folder / "night_1.txt", rate_hz=1)


class TestXml:
    @pytest.mark.parametrize(
        "text", ['<?xml version="1.0"?>\n<annotations/>\n', "\ufeff<annotation></annotation>"]
    )
    @pytest.mark.parametrize("name", ["a.xml", "a.txt", "a.csv"])
    def test_xml_is_named_with_what_to_export_instead(self, write, text, name):
        for read in (read_detections, read_truth, read_trajectories):
            with pytest.raises(DataError, match=r"is XML .* export it as MOT 1\.1, COCO or YOLO"):
                read(write(name, text), rate_hz=HZ)

    def test_a_folder_of_xml_too(self, tmp_path):
        (tmp_path / "000001.xml").write_text("<annotation></annotation>")
        with pytest.raises(DataError, match="is XML"):
            read_detections(tmp_path)


class TestNothing:
    """A quiet recording is one, and a tracker that found nothing has a result."""

    def test_an_empty_result_has_no_tracks(self, write):
        for name in ("r.txt", "r.csv"):
            assert len(read_trajectories(write(name, ""))) == 0
            assert len(read_trajectories(write(name, "\n"))) == 0

    def test_empty_detections_beside_seqinfo_are_empty_scans(self, write):
        write("seqinfo.ini", "[Sequence]\nframeRate=10\nseqLength=4\n")
        found = read_detections(write("det.txt", ""))
        assert (found.num_scans, len(found)) == (4, 0)
        np.testing.assert_allclose(found.scan_t, [0.0, 0.1, 0.2, 0.3])
        truth = read_truth(write("gt.txt", "\n"))
        assert (len(truth), len(truth.frame_times())) == (0, 4)

    def test_without_seqinfo_it_is_said_what_is_missing(self, write):
        with pytest.raises(DataError, match=r"det\.txt: is empty, and how many frames .* seqinfo\.ini"):
            read_detections(write("det.txt", ""), rate_hz=HZ)
        with pytest.raises(DataError, match=r"gt\.txt: is empty"):
            read_truth(write("gt.txt", ""), rate_hz=HZ)

    @pytest.mark.parametrize("text", ["", "\n \n", "\ufeff"])
    def test_a_table_without_a_header_is_refused_where_scans_are_needed(self, write, text):
        for read in (read_detections, read_truth):
            with pytest.raises(DataError, match=r"d\.csv: is empty"):
                read(write("d.csv", text), rate_hz=HZ)

    def test_no_results_of_listed_images(self, write):
        images = write(
            "i.json", json.dumps({"images": [{"id": 1, "timestamp": 0.5}, {"id": 2, "timestamp": 0.6}]})
        )
        assert read_detections(write("r.json", "[]"), images=images).scan_t.tolist() == [0.5, 0.6]
        assert len(read_trajectories(write("r.json", "[]"))) == 0
