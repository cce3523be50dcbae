"""Detections of MOTChallenge, KITTI, Prophesee/DSEC and COCO."""

from __future__ import annotations

import json
from typing import ClassVar

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.io.formats.registry import recognise
from jeat_graph.io.tables.detections_io import read_detections

MOT = "1,-1,10,20,30,40,0.9,-1,-1,-1\n4,-1,11,21,31,41,0.8,-1,-1,-1\n"
KITTI = (
    "0 -1 Car -1 -1 -10 10 20 40 60 -1 -1 -1 -1000 -1000 -1000 -10 0.9\n"
    "2 -1 Van -1 -1 -10 11 21 42 62 -1 -1 -1 -1000 -1000 -1000 -10 0.8\n"
)
PROPHESEE = [("t", "<i8"), ("x", "<f4"), ("y", "<f4"), ("w", "<f4"), ("h", "<f4"), ("class_id", "<u4")]


def summary(detections):
    return [
        (round(s.t, 9), s.sensor, s.boxes.tolist(), s.scores.round(6).tolist()) for s in detections.scans()
    ]


def save_npy(path, dtype, rows):
    np.save(path, np.array(rows, dtype=dtype))
    return path


class TestMotChallenge:
    def test_frames_become_seconds_and_frames_without_boxes_become_empty_scans(self, write):
        assert summary(read_detections(write("det.txt", MOT), rate_hz=10)) == [
            (0.0, "rgb", [[10, 20, 30, 40]], [0.9]),
            (0.1, "rgb", [], []),
            (0.2, "rgb", [], []),
            (0.3, "rgb", [[11, 21, 31, 41]], [0.8]),
        ]

    def test_frames_without_boxes_can_be_left_out(self, write):
        found = read_detections(write("det.txt", MOT), rate_hz=10, fill_empty=False, sensor="evt")
        assert found.scan_t.tolist() == [0.0, 0.3]
        assert found.sensors == ("evt",)

    def test_a_detector_that_ran_on_every_third_frame_missed_none(self, write):
        text = "".join(f"{frame},-1,10,20,30,40,0.9\n" for frame in (*range(1, 31, 3), 37))
        found = read_detections(write("det.txt", text), rate_hz=1)
        assert found.scan_t.tolist() == list(range(0, 37, 3))

    def test_white_space_separates_as_well(self, write):
        found = read_detections(write("det.txt", MOT.replace(",", " ")), rate_hz=10)
        assert found.boxes.tolist() == [[10, 20, 30, 40], [11, 21, 31, 41]]

    @pytest.mark.parametrize("count", [6, 7, 8, 9, 10])
    @pytest.mark.parametrize("end", ["\n", "\r\n"])
    def test_a_comma_behind_every_line_is_no_field(self, write, count, end):
        fields = ["1,-1,10,20,30,40,0.9,3,0.5", "2,-1,11,21,31,41,0.8,4,0.25"]
        if count == 10:
            fields = [row.rsplit(",", 2)[0] + ",-1,-1,-1" for row in fields]
        rows = [",".join(row.split(",")[:count]) for row in fields]
        plain = read_detections(write("a.txt", end.join(rows)), rate_hz=10)
        found = read_detections(write("b.txt", f",{end}".join([*rows, ""])), rate_hz=10)
        assert summary(found) == summary(plain)
        assert found.scores.tolist() == ([1.0, 1.0] if count == 6 else [0.9, 0.8])
        classes = ["3", "4"] if count in (8, 9) else None
        assert (None if found.classes is None else found.classes.tolist()) == classes

    def test_a_field_that_is_blank_in_some_lines_is_missing_in_them(self, write):
        with pytest.raises(DataError, match=r"a\.txt:1: conf is missing"):
            read_detections(write("a.txt", "1,-1,10,20,30,40,\n2,-1,10,20,30,40,0.9\n"), rate_hz=10)

    def test_rate_and_length_come_from_seqinfo(self, write):
        write("seq/seqinfo.ini", "[Sequence]\nname=x\nframeRate=25\nseqLength=6\n")
        found = read_detections(write("seq/det/det.txt", MOT))
        assert found.scan_t.tolist() == [k / 25 for k in range(6)]

    def test_without_a_rate_the_message_asks_for_it(self, write):
        with pytest.raises(DataError, match="give the frame rate"):
            read_detections(write("det.txt", MOT))

    @pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
    def test_a_rate_that_is_none_is_refused(self, write, rate):
        with pytest.raises(DataError, match="frame rate must be positive"):
            read_detections(write("det.txt", MOT), rate_hz=rate)

    @pytest.mark.parametrize(
        ("row", "words"),
        [
            ("-1,-1,10,20,30,40,0.9,-1,-1,-1", "frames count from 1, got -1"),
            ("1.5,-1,10,20,30,40,0.9,-1,-1,-1", "frame must be a whole number"),
            (
                "2,-1,10,20,30,40,12.5,-1,-1,-1",
                "score must be in [0, 1], got 12.5; for 0 to 100 give",
            ),
            ("2,-1,10,20,30,x,0.9,-1,-1,-1", "height must be a number, got 'x'"),
            ("2,-1,10,20,30,-1,0.9,-1,-1,-1", "width and height must be positive"),
            ("2,-1,10,20,30,40,0.9", "7 fields, but the first line has 10"),
        ],
    )
    def test_a_bad_line_is_named(self, write, row, words):
        path = write("det.txt", MOT + "\n" + row + "\n")
        with pytest.raises(DataError) as caught:
            read_detections(path, rate_hz=10)
        assert str(caught.value).startswith(f"{path}:4: ")
        assert words in str(caught.value)

    def test_raw_scores_can_be_squashed(self, write):
        found = read_detections(write("det.txt", "1,-1,1,2,3,4,-2\n"), rate_hz=1, score_scale="logistic")
        assert found.scores == pytest.approx([1 / (1 + np.exp(2.0))])

    def test_a_frame_number_out_of_all_bounds_does_not_fill_the_memory(self, write):
        path = write("det.txt", "1,-1,1,2,3,4,0.5\n999999999999,-1,1,2,3,4,0.5\n1000,-1,1,2,3,4,0.5\n")
        with pytest.raises(DataError, match="fill_empty=False"):
            read_detections(path, rate_hz=25)
        assert read_detections(path, rate_hz=25, fill_empty=False).num_scans == 3

    def test_real_detections_are_read(self, shared_data):
        found = read_detections(shared_data / "tud" / "TUD-Campus" / "det.txt", rate_hz=25)
        assert (len(found), found.num_scans) == (321, 71)
        assert found.boxes[0].tolist() == [281.931, 187.466, 79.93, 209.537]


class TestKitti:
    def test_frames_count_from_0_at_10_hz(self, write):
        assert summary(read_detections(write("0001.txt", KITTI))) == [
            (0.0, "rgb", [[10, 20, 30, 40]], [0.9]),
            (0.1, "rgb", [], []),
            (0.2, "rgb", [[11, 21, 31, 41]], [0.8]),
        ]

    def test_the_type_is_the_class(self, write):
        assert read_detections(write("0001.txt", KITTI)).classes.tolist() == ["Car", "Van"]

    def test_labels_without_a_score_are_sure(self, write):
        text = "".join(line.rsplit(" ", 1)[0] + "\n" for line in KITTI.splitlines())
        found = read_detections(write("0001.txt", text + text.splitlines()[0].replace("Car", "DontCare")))
        assert found.scores.tolist() == [1.0, 1.0]
        assert found.classes.tolist() == ["Car", "Van"]

    def test_a_box_with_its_edges_swapped_is_named_by_its_line(self, write):
        path = write("0001.txt", KITTI + KITTI.splitlines()[0].replace("40 60", "5 60"))
        with pytest.raises(DataError, match=r"0001\.txt:3: width and height must be positive"):
            read_detections(path)


class TestPropheseeAndDsec:
    def test_microseconds_and_fields_by_name(self, tmp_path):
        dtype = [*PROPHESEE, ("track_id", "<u4"), ("class_confidence", "<f4")]
        path = save_npy(
            tmp_path / "b.npy", dtype, [(1_500_001, 1, 2, 3, 4, 2, 7, 0.5), (2, 5, 6, 7, 8, 0, 7, 1)]
        )
        found = read_detections(path, sensor="evt")
        assert found.scan_t.tolist() == [0.000002, 1.500001]
        assert found.boxes.tolist() == [[5, 6, 7, 8], [1, 2, 3, 4]]
        assert found.scores.tolist() == [1.0, 0.5]
        assert found.classes.tolist() == ["0", "2"]

    def test_the_older_field_names_are_known(self, tmp_path):
        dtype = [("ts", ">u8"), *PROPHESEE[1:], ("confidence", "<f8")]
        path = save_npy(tmp_path / "b.npy", dtype, [(10, 1, 2, 3, 4, 2, 0.25)])
        assert summary(read_detections(path, sensor="evt")) == [(0.00001, "evt", [[1, 2, 3, 4]], [0.25])]

    def test_gaps_become_empty_scans_where_the_rate_is_given(self, tmp_path):
        dtype = [*PROPHESEE, ("class_confidence", "<f4")]
        rows = [(t, 1, 2, 3, 4, 0, 1) for t in (0, 50_100, 199_900)]
        path = save_npy(tmp_path / "b.npy", dtype, rows)
        assert read_detections(path).scan_t.tolist() == [0.0, 0.0501, 0.1999]
        filled = read_detections(path, rate_hz=20).scan_t
        assert filled == pytest.approx([0.0, 0.0501, 0.10003333333, 0.14996666667, 0.1999])

    @pytest.mark.parametrize(
        ("array", "words"),
        [
            (np.zeros(3), "1-D structured array"),
            (np.zeros(3, dtype=PROPHESEE[1:]), "field 't' is missing"),
        ],
    )
    def test_an_array_of_another_kind_is_refused(self, tmp_path, array, words):
        np.save(tmp_path / "b.npy", array)
        with pytest.raises(DataError) as caught:
            read_detections(tmp_path / "b.npy")
        assert words in str(caught.value)

    def test_a_bad_row_is_named(self, tmp_path):
        dtype = [*PROPHESEE, ("class_confidence", "<f4")]
        path = save_npy(tmp_path / "b.npy", dtype, [(0, 1, 2, 3, 4, 0, 1), (1, 1, np.nan, 3, 4, 0, 1)])
        with pytest.raises(DataError, match="row 2: y must be a finite number"):
            read_detections(path)

    def test_pickled_objects_are_never_loaded(self, tmp_path):
        np.save(tmp_path / "b.npy", np.array([{"t": 1}], dtype=object), allow_pickle=True)
        with pytest.raises(DataError, match="cannot be read"):
            read_detections(tmp_path / "b.npy")


class TestCoco:
    RESULTS: ClassVar = [
        {"image_id": 12, "category_id": 3, "bbox": [1, 2, 3, 4], "score": 0.5},
        {"image_id": 10, "category_id": 4, "bbox": [5.5, 6, 7, 8], "score": 1},
    ]
    IMAGES: ClassVar = {
        "images": [{"id": 10, "timestamp": 0.5}, {"id": 11, "timestamp": 0.61}, {"id": 12, "timestamp": 0.7}],
        "categories": [{"id": 3, "name": "car"}],
    }

    def test_image_ids_become_times_by_the_rate(self, write):
        found = read_detections(write("r.json", json.dumps(self.RESULTS)), rate_hz=10)
        assert summary(found) == [
            (0.9, "rgb", [[5.5, 6, 7, 8]], [1.0]),
            (1.0, "rgb", [], []),
            (1.1, "rgb", [[1, 2, 3, 4]], [0.5]),
        ]

    def test_the_list_of_images_gives_times_names_and_empty_scans(self, write):
        images = write("images.json", json.dumps(self.IMAGES))
        found = read_detections(write("r.json", json.dumps(self.RESULTS)), images=images)
        assert [(s.t, len(s)) for s in found.scans()] == [(0.5, 1), (0.61, 0), (0.7, 1)]
        assert found.classes.tolist() == ["4", "car"]

    def test_a_data_set_with_scores_is_read_in_one_file(self, write):
        images = [{"id": k, "frame_id": k - 10} for k in (10, 11, 12)]
        path = write("r.json", json.dumps({"images": images, "annotations": self.RESULTS}))
        assert read_detections(path, rate_hz=2).scan_t.tolist() == [0.0, 0.5, 1.0]

    @pytest.mark.parametrize(
        ("content", "words"),
        [
            ("", "is empty"),
            ("[1, 2\n, oops]", ":2: is not JSON"),
            ("[" * 100_000, "is not JSON"),
            ("[" + "9" * 5000 + "]", "is not JSON"),
            ("{}", "must be a list of results"),
            ('{"t": 0, "sensor": "rgb"}', "holds a scan; COCO results are one list"),
            ('{"t": 0}\n{"t": 1}\n', ":2: is JSON Lines; COCO results are one list"),
            ('[{"t": 0, "left": 1}]', "entry 1: has t and no image_id; COCO results are one list"),
            ("[7]", "entry 1: must be an object"),
            (
                '[{"image_id": "a", "bbox": [1,2,3,4], "score": 1}]',
                "entry 1: image_id must be a whole number",
            ),
            ('[{"image_id": 1, "bbox": [1,2,3], "score": 1}]', "entry 1: bbox must be four finite numbers"),
            (
                '[{"image_id": 1, "bbox": [1,2,3,NaN], "score": 1}]',
                "entry 1: bbox must be four finite numbers",
            ),
            (
                '[{"image_id": 1, "bbox": [1,2,3,4], "score": null}]',
                "entry 1: score must be a finite number",
            ),
            (
                '[{"image_id": 1, "bbox": [1,2,3,4]}, {"image_id": 1, "bbox": [1,2,3,4], "score": 1}]',
                "entry 1: score is missing",
            ),
            ('[{"image_id": 1, "bbox": [1,2,3,4], "score": 3}]', "entry 1: score must be in [0, 1]"),
            (
                '[{"image_id": 1, "bbox": [1,2,-1,4], "score": 1}]',
                "entry 1: width and height must be positive",
            ),
        ],
    )
    def test_what_is_wrong_is_said(self, write, content, words):
        with pytest.raises(DataError) as caught:
            read_detections(write("r.json", content), rate_hz=10)
        assert words in str(caught.value)

    def test_without_a_rate_or_images_the_message_asks_for_one(self, write):
        with pytest.raises(DataError, match="give the frame rate"):
            read_detections(write("r.json", json.dumps(self.RESULTS)))

    def test_an_image_that_is_not_listed_is_named(self, write):
        images = write("images.json", json.dumps({"images": self.IMAGES["images"][:2]}))
        with pytest.raises(DataError, match="entry 1: image 12 is not in the list"):
            read_detections(write("r.json", json.dumps(self.RESULTS)), images=images)


class TestRecognition:
    @pytest.mark.parametrize(
        ("name", "content", "expected"),
        [
            ("a.csv", "t,sensor\n", "csv"),
            ("a.csv", MOT, "csv"),
            ("a.txt", "t,sensor,left,top,width,height,score\n", "csv"),
            ("a.txt", MOT, "motchallenge"),
            ("a.txt", "\n\n" + MOT, "motchallenge"),
            ("a.txt", KITTI, "kitti"),
            ("a.txt", " ".join(KITTI.split()[:17]) + "\n", "kitti"),
            ("a.txt", " ".join(KITTI.split()[:16]) + "\n", "csv"),
            ("a", '[{"image_id": 1}]', "coco"),
            ("a.json", "[]", "coco"),
            ("a.dat", b"PAR1....", "parquet"),
            ("a.dat", b"\x93NUMPY...", "prophesee"),
        ],
    )
    def test_the_format_is_told_by_content_and_name(self, write, name, content, expected):
        assert recognise(write(name, content)).name == expected

    def test_the_caller_knows_better(self, write):
        assert recognise(write("a.csv", MOT), "motchallenge").name == "motchallenge"

    @pytest.mark.parametrize(
        "line", ["2 0.5 0.4 0.1 0.05", "2 0.5 0.4 0.1 0.05 0.91", "0 0.523438 1 0.013 0.99 0.8 17"]
    )
    def test_labels_of_yolo_are_named(self, write, line):
        with pytest.raises(DataError, match="1: looks like labels of YOLO"):
            read_detections(write("a.txt", f"{line}\n{line}\n"), rate_hz=1)
        assert recognise(write("b.txt", "1 -1 1 1 1 1 1\n")).name == "motchallenge"

    def test_a_format_that_makes_no_sense_is_refused(self, write):
        with pytest.raises(DataError, match="unknown format 'voc'; known: csv"):
            recognise(write("a.csv", MOT), "voc")
        with pytest.raises(DataError, match="is coco; here only csv can be read"):
            recognise(write("a.json", "[]"), allowed=("csv",))
