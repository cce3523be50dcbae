"""What annotation tools, trackers and sinks write beside the formats of data sets."""

from __future__ import annotations

import json
import zipfile

import pytest

from jeat_graph import read_detections, read_truth
from jeat_graph.data.errors import DataError
from jeat_graph.io.formats.registry import formats, recognise
from jeat_graph.io.tables.trajectories_io import read_trajectories

HZ = 25.0


def sink_row(frame, number, left, **more):
    sides = {"x_min": left, "y_min": 20.0, "x_max": left + 30.0, "y_max": 60.0}
    return {**sides, "class_id": 2, "confidence": 0.9, "tracker_id": number, "frame": frame, **more}


class TestJsonSink:
    def write(self, path, rows):
        path.write_text(json.dumps(rows, indent=4))
        return path

    def test_a_result_of_supervision(self, tmp_path):
        rows = [sink_row(k, k % 2, 10.0 * k, class_name="car") for k in range(4)]
        path = self.write(tmp_path / "out.json", rows)
        assert recognise(path).name == "json-rows"
        found = read_trajectories(path, rate_hz=HZ)
        assert found.t.tolist() == [k / HZ for k in range(4)]
        assert found.boxes.tolist() == [[10.0 * k, 20, 30, 40] for k in range(4)]
        assert found.track_id.tolist() == [0, 1, 0, 1]
        assert found.classes.tolist() == ["car"] * 4

    def test_supervision_writes_it_so(self, tmp_path):
        sv = pytest.importorskip("supervision")
        import numpy as np

        with sv.JSONSink(str(tmp_path / "out.json")) as sink:
            for k in (0, 2):
                boxes = np.array([[10.0 + k, 20, 40 + k, 60]])
                detections = sv.Detections(boxes, confidence=np.array([0.5]), class_id=np.array([1]))
                sink.append(detections, custom_data={"frame_index": k, "video_fps": 10.0})
        found = read_detections(tmp_path / "out.json")
        assert found.scan_t.tolist() == [0.0, 0.1, 0.2]  # nothing was found in frame 1
        assert found.boxes.tolist() == [[10, 20, 30, 40], [12, 20, 30, 40]]
        assert found.scores.tolist() == [0.5, 0.5]
        assert found.classes.tolist() == ["1", "1"]

    def test_what_is_wrong_is_named(self, tmp_path):
        bare = {key: value for key, value in sink_row(0, 1, 1.0).items() if key != "frame"}
        with pytest.raises(DataError, match=r"column t; .*JSONSink writes it with custom_data"):
            read_detections(self.write(tmp_path / "a.json", [bare]), rate_hz=HZ)
        rows = [sink_row(0, 1, 1.0), {**sink_row(1, 1, 1.0), "x_min": "left"}]
        with pytest.raises(DataError, match=r"b\.json: row 2: left must be a number, got 'left'"):
            read_detections(self.write(tmp_path / "b.json", rows), rate_hz=HZ)
        with pytest.raises(DataError, match="has no identities"):
            read_truth(self.write(tmp_path / "c.json", [sink_row(0, "", 1.0)]), rate_hz=HZ)


DARK = "0,2,7,10,20,40,60,car,8,100,20,150,60,bus\n1,0\n2,1,7,12,20,42,60,car\n"


class TestDarkLabel:
    def test_lines_by_frame(self, tmp_path):
        (tmp_path / "a.txt").write_text(DARK)
        truth = read_truth(tmp_path / "a.txt", rate_hz=10)
        assert truth.frame_times().tolist() == [0.0, 0.1, 0.2]
        assert truth.object_id.tolist() == [7, 8, 7]
        assert truth.boxes.tolist() == [[10, 20, 30, 40], [100, 20, 50, 40], [12, 20, 30, 40]]
        assert truth.classes.tolist() == ["car", "bus", "car"]

    def test_boxes_without_identities(self, tmp_path):
        (tmp_path / "a.txt").write_text("0,1,10,20,40,60,car\n")
        assert read_detections(tmp_path / "a.txt", rate_hz=10).boxes.tolist() == [[10, 20, 30, 40]]
        with pytest.raises(DataError, match="has no identities"):
            read_truth(tmp_path / "a.txt", rate_hz=10)

    @pytest.mark.parametrize(
        ("line", "words"),
        [
            ("3,2,7,10,20,40,60,car", "a line of DarkLabel is frame, n"),
            ("3,1,7,10,20,x,60,car", "must hold finite numbers, got 'x'"),
            ("3,1,7,100,20,40,60,car", "boxes by width and height are not read"),
        ],
    )
    def test_a_bad_line_is_named(self, tmp_path, line, words):
        (tmp_path / "a.txt").write_text(f"{DARK}{line}\n")
        with pytest.raises(DataError, match=rf"a\.txt:4: .*{words}"):
            read_detections(tmp_path / "a.txt", fmt="darklabel", rate_hz=10)


class TestElevenColumns:
    @pytest.mark.parametrize(
        ("more", "expected"),
        [("3,-1,-1,-1", ["3"]), ("-1,-1,-1,5", ["5"]), ("2,0.5,1.5,2.5", ["2"]), ("1.25,2.5,0,-1", None)],
    )
    def test_a_class_beside_world_coordinates(self, tmp_path, more, expected):
        (tmp_path / "a.txt").write_text(f"1,4,10,20,30,40,0.9,{more}\n")
        found = read_trajectories(tmp_path / "a.txt", rate_hz=HZ)
        assert found.boxes.tolist() == [[10, 20, 30, 40]]
        assert (None if found.classes is None else found.classes.tolist()) == expected


def test_a_sequence_of_visdrone_has_its_categories_and_ignores_what_it_does(tmp_path):
    path = tmp_path / "uav0000013_00000_v.txt"
    path.write_text(
        "1,0,10,20,30,40,1,4,0,0\n1,1,100,20,30,40,1,11,0,1\n1,2,200,20,90,90,0,0,0,0\n1,3,300,9,9,9,1,6,1,2\n"
    )
    assert recognise(path).name == "visdrone"
    truth = read_truth(path, rate_hz=HZ)
    assert truth.classes.tolist() == ["car", "others", "ignored regions", "truck"]
    assert truth.ignore.tolist() == [False, True, True, False]
    path.rename(tmp_path / "gt.txt")
    assert recognise(tmp_path / "gt.txt").name == "motchallenge"
    assert read_truth(tmp_path / "gt.txt", rate_hz=HZ).classes.tolist() == ["4", "11", "0", "6"]


class TestCocoFrames:
    def coco(self, path, more, **rest):
        images = [{"id": k + 1, **more(k)} for k in range(4)]
        boxes = [
            {"image_id": k + 1, "category_id": 1, "track_id": 1, "bbox": [20 * k, 3, 80, 50]}
            for k in range(4)
        ]
        path.write_text(json.dumps({"images": images, "annotations": boxes, **rest}))
        return path

    @pytest.mark.parametrize(
        "more",
        [
            lambda k: {"frame_index": 5 * k, "file_name": f"v/{k:05d}.jpg"},
            lambda k: {"file_name": f"v/img_{5 * k:06d}.jpg"},
        ],
        ids=["frame_index", "names"],
    )
    def test_every_fifth_picture(self, tmp_path, more):
        found = read_truth(self.coco(tmp_path / "a.json", more), rate_hz=25)
        assert found.t.tolist() == [0.0, 0.2, 0.4, 0.6]

    def test_the_rate_of_its_video(self, tmp_path):
        path = self.coco(
            tmp_path / "a.json",
            lambda k: {"video_id": 3, "frame_index": k},
            videos=[{"id": 3, "name": "v", "fps": 10}],
        )
        assert read_detections(path).scan_t.tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3])

    def test_names_that_do_not_number_frames_say_nothing(self, tmp_path):
        names = ["a1.jpg", "b7.jpg", "c3.jpg", "d4.jpg"]
        found = read_truth(self.coco(tmp_path / "a.json", lambda k: {"file_name": names[k]}), rate_hz=1)
        assert found.t.tolist() == [0.0, 1.0, 2.0, 3.0]


def test_a_zip_that_unpacks_to_far_more_is_refused_before_it_is_unpacked(tmp_path):
    path = tmp_path / "bomb.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("gt/gt.txt", b"1,1,10,10,20,20,1,1,1\n" * 4_000_000)
    with pytest.raises(DataError, match=r"bomb\.zip: gt/gt\.txt: unpacks to more than \d+ bytes"):
        read_detections(path, rate_hz=HZ)


def test_every_format_has_what_its_page_needs():
    assert len({one.name for one in formats()}) == len(formats())
    for one in formats():
        assert one.title
        assert one.reads
        assert "|" not in one.reads
        assert (one.suffix != "") == (one.is_table or one.write is not None), one.name
