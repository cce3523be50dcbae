"""Scans from lines: what is left out of them, and what is refused."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.data.notes import listening
from jeat_graph.data.tables.reading import Reading
from jeat_graph.io.streams.scan_lines import batch_of, read_batches
from jeat_graph.io.streams.stream_reading import StreamReading
from jeat_graph.io.tables.detections_io import read_detections

FLAT = {
    "t": 0.5,
    "sensor": "rgb",
    "boxes": [[1, 2, 30, 40], [1, 2, 0, 40], [5, 6, 7, 0]],
    "scores": [0.9, 0.8, 0.7],
    "classes": ["car", "bus", "van"],
    "embeddings": [[0, 1], [1, 0], None],
}


def batches(text, **options):
    return list(read_batches([line.encode() for line in text.splitlines(keepends=True)], "x", **options))


def test_boxes_without_area_are_left_out_with_all_that_is_said_of_them():
    batch = batch_of(FLAT, "x", 1)
    (scan,) = batch.scans
    assert scan.boxes.tolist() == [[1.0, 2.0, 30.0, 40.0]]
    assert (scan.scores.tolist(), scan.classes.tolist()) == ([0.9], ["car"])
    assert scan.embeddings.tolist() == [[0.0, 1.0]]
    assert batch.flat == 2


def test_scans_that_are_joined_keep_count_of_boxes_without_area():
    text = "".join(json.dumps(FLAT | {"sensor": name}) + "\n" for name in ("rgb", "evt"))
    (batch,) = batches(text, joint=True)
    assert ([scan.sensor for scan in batch.scans], batch.flat) == (["evt", "rgb"], 4)


NEAR = [(0.0, "rgb"), (0.0012, "evt"), (0.01, "evt"), (0.0091, "rgb"), (0.02, "evt"), (0.02, "rgb")]


@pytest.mark.parametrize("form", ["json", "csv"])
def test_scans_of_two_sensors_within_a_tolerance_are_joined_at_the_later_time(form):
    lines = [json.dumps({"t": t, "sensor": name, "boxes": []}) for t, name in NEAR]
    if form == "csv":
        lines = ["t,sensor,left,top,width,height,score", *(f"{t},{name},,,,," for t, name in NEAR)]
    text = "".join(line + "\n" for line in lines)
    found = batches(text, joint=True, within_s=0.002, ordered=False)
    both = [(t, ["evt", "rgb"]) for t in (0.0012, 0.01, 0.02)]
    assert [(one.t, [scan.sensor for scan in one.scans]) for one in found] == both
    assert all(scan.t == one.t for one in found for scan in one.scans)
    apart = batches(text, joint=True, ordered=False)
    assert len(apart) == 5


def test_a_row_of_csv_without_area_is_a_look_that_found_nothing():
    header = "t,sensor,left,top,width,height,score\n"
    first, second = batches(header + "0,rgb,1,2,0,4,.5\n1,rgb,1,2,3,4,.5\n1,rgb,1,2,3,0,.5\n")
    assert (len(first.scans[0]), first.flat) == (0, 1)
    assert (len(second.scans[0]), second.flat) == (1, 1)


@pytest.mark.parametrize("box", [[1, 2, -3, 0], [1, 2, None, 0], [1, 2, 1e999, 0], [1, 2, 0]])
def test_boxes_that_are_worse_are_errors(box):
    with pytest.raises(DataError, match="x:7"):
        batch_of({"t": 0.5, "sensor": "rgb", "boxes": [box], "scores": [0.9]}, "x", 7)


@pytest.mark.parametrize(
    "text",
    [
        "Time\tcamera\tx1\ty1\tx2\ty2\tconf\n0.5\trgb\t1.5\t2\t4.5\t6\t.5\n",
        "t;sensor;cx;cy;w;h;score;label\n0,5;rgb;3;4;3;4;0,5;car\n",
        "t,sensor,left,top,right,bottom,score\n0.5,rgb,1.5,2,4.5,6,.5\n",
    ],
)
def test_csv_is_read_by_the_names_that_files_have(text):
    ((scan,), _, _) = batches(text)[0]
    assert (scan.t, scan.sensor, scan.boxes.tolist()) == (0.5, "rgb", [[1.5, 2.0, 3.0, 4.0]])
    assert scan.scores.tolist() == [0.5]


def one(text, **options):
    """The one scan of a text, read with options as files are."""
    goes_on = options.pop("goes_on", False)
    how = StreamReading(Reading(**options), goes_on=goes_on)
    ((scan,), _, _) = batches(text, how=how)[0]
    return scan


BOXES = [[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0]]


@pytest.mark.parametrize(
    ("said", "unit", "seconds"),
    [
        ({"t": 1.04}, "s", 1.04),
        ({"t": 40}, "ms", 0.04),
        ({"t": "1970-01-01T00:01:00.04"}, "s", 60.04),
        ({"t": "1970-01-01T02:01:00,040000001+02:00"}, "s", 60.040000001),
        ({"t": "00:01:02.5"}, "s", 62.5),
        ({"t": "00:01:02:12"}, "s", 62.5),
        ({"t_us": 40_000}, "s", 0.04),
        ({"t_ms": 40}, "ms", 0.04),
        ({"frame": 12}, "s", 11 / 24),
        ({"frame": 0}, "s", 0.0),
        ({"image": "cam1/frame_000013.jpg"}, "s", 0.5),
    ],
)
def test_times_of_json_are_those_of_tables(said, unit, seconds):
    text = json.dumps(said | {"sensor": "rgb", "boxes": BOXES})
    assert one(text, time_unit=unit, rate_hz=24.0).t == seconds
    (name, value), quoted = next(iter(said.items())), '"'
    rows = f"{name},sensor,left,top,width,height\n{quoted}{value}{quoted},rgb,1,2,3,4\n"
    assert one(rows, time_unit=unit, rate_hz=24.0).t == seconds


@pytest.mark.parametrize(
    ("said", "options", "what"),
    [
        ({"t": "yesterday"}, {}, "t must be a number, a date such as .*, got 'yesterday'"),
        ({"t": "1.04"}, {}, "t must be a number, not one as text"),
        ({"t": float("nan")}, {}, "t must be finite, got nan"),
        ({"t": True}, {}, "t must be a number, a date"),
        ({"t": None}, {}, "t must be a number, a date"),
        ({"t": 10**400}, {}, "too large"),
        ({"t": "2026-05-01"}, {"time_unit": "ms"}, "holds dates, but --time-unit says ms"),
        ({"t_us": 1}, {"time_unit": "ms"}, "t_us is in us, but --time-unit says ms"),
        ({"t": "00:01:02:12"}, {}, "t must be"),
        ({"t": 1, "frame": 1}, {}, "has both t and frame"),
        ({"frame": 3}, {}, "give their rate with --rate"),
        ({"frame": 0.5}, {"rate_hz": 20.0}, "whole number or a picture's name"),
        ({"frame": 10**30}, {"rate_hz": 20.0}, "whole number or a picture's name"),
        ({"frame": 0}, {"rate_hz": 20.0, "first_frame": 1}, "frames count from 1, got 0"),
        ({"frame": 7}, {"rate_hz": 20.0, "goes_on": True}, "give --first-frame 0 or 1"),
        ({}, {}, "t is missing"),
    ],
)
def test_a_time_that_is_none_is_refused_with_its_line(said, options, what):
    with pytest.raises(DataError, match=f"x:1: .*{what}"):
        one(json.dumps(said | {"sensor": "rgb", "boxes": BOXES}), **options)


def test_frames_of_a_stream_that_goes_on_count_from_where_the_user_says():
    text = json.dumps({"frame": 7, "boxes": BOXES})
    scan = one(text, rate_hz=20.0, goes_on=True, first_frame=1)
    assert (scan.t, scan.sensor) == (0.3, "rgb")  # as a table that counts frames, it may name no sensor


def test_without_scores_each_box_has_the_score_1_as_in_files():
    assert one(json.dumps({"t": 0, "sensor": "rgb", "boxes": BOXES})).scores.tolist() == [1.0, 1.0]
    assert one(json.dumps({"t": 0, "sensor": "rgb", "boxes": [], "scores": None})).scores.tolist() == []
    rows = "t,sensor,left,top,width,height\n0,rgb,1,2,3,4\n0,rgb,5,6,7,8\n1,rgb\n"
    first, second = batches(rows)
    assert first.scans[0].scores.tolist() == [1.0, 1.0]
    assert len(second.scans[0]) == 0
    with pytest.raises(DataError, match="x:2: score is missing"):
        batches("t,sensor,left,top,width,height,score\n0,rgb,1,2,3,4,\n")
    with pytest.raises(DataError, match=r"x:1: .*scores"):
        one(json.dumps({"t": 0, "sensor": "rgb", "boxes": BOXES, "scores": [None, 0.5]}))


@pytest.mark.parametrize(
    ("said", "names"),
    [
        ({"classes": ["car", None]}, ["car", ""]),
        ({"classes": [2, 7]}, ["car", "truck"]),
        ({"classes": [2.0, None]}, ["car", ""]),
        ({"class_id": [7, 3]}, ["truck", "3"]),
        ({"class_id": [7, 3], "classes": ["van", "bus"]}, ["van", "bus"]),
        ({"class_id": [7, 2], "tracker_id": [4, 5], "track_id": None}, ["truck", "car"]),
    ],
)
def test_classes_are_names_or_numbers_and_identities_are_passed_over(said, names):
    text = json.dumps({"t": 0, "sensor": "rgb", "boxes": BOXES} | said)
    assert one(text, class_names={2: "car", 7: "truck"}).classes.tolist() == names


def test_rows_of_csv_have_the_classes_of_tables():
    head = "t,sensor,left,top,width,height,tracker_id,"
    for columns, row, name in (
        ("class_id", "7", "truck"),
        ("class,class_id", "van,7", "van"),
        ("class,name", "7,lorry", "lorry"),
        ("label", "", ""),
    ):
        text = f"{head}{columns}\n0,rgb,1,2,3,4,9,{row}\n"
        assert one(text, class_names={7: "truck"}).classes.tolist() == [name], columns


@pytest.mark.parametrize("classes", [["a"], [True, False], [0.5, 1], "car", [[1], [2]]])
def test_what_is_no_class_is_refused(classes):
    with pytest.raises(DataError, match=r"x:1: class"):
        one(json.dumps({"t": 0, "sensor": "rgb", "boxes": BOXES, "classes": classes}))


def test_classes_that_are_asked_for_are_taken_and_those_that_are_not_known():
    scan = {"t": 0, "sensor": "rgb", "boxes": [*BOXES, *BOXES], "classes": ["car", "bus", None, "van"]}
    scan["embeddings"] = [[1, 0], None, [0, 1], None]
    how = StreamReading(classes=["car"])
    (batch,) = batches(json.dumps(scan), how=how)
    assert batch.scans[0].classes.tolist() == ["car", ""]
    assert batch.scans[0].embeddings.tolist() == [[1.0, 0.0], [0.0, 1.0]]


def test_scores_of_another_scale_are_read_as_files_are():
    scan = {"t": 0, "sensor": "rgb", "boxes": BOXES, "scores": [90, 50]}
    assert one(json.dumps(scan), score_scale="percent").scores.tolist() == [0.9, 0.5]
    assert one(json.dumps(scan), score_scale="logistic").scores.tolist() == [1.0, 1.0]
    with pytest.raises(DataError, match="got 90; for 0 to 100 give --score-scale percent"):
        one(json.dumps(scan))
    with pytest.raises(DataError, match=r"x:2: score must be .* got 90; for 0 to 100 give --score-scale"):
        one("t,sensor,left,top,width,height,score\n0,rgb,1,2,3,4,90\n")


def test_a_box_in_one_field_and_an_embedding_are_read_as_in_tables():
    rows = "t,sensor,box,embedding\n0,rgb,\"{'x1': 1, 'y1': 2, 'x2': 4, 'y2': 6}\",0 2\n1,rgb,,\n"
    first, second = batches(rows)
    assert first.scans[0].boxes.tolist() == [[1.0, 2.0, 3.0, 4.0]]
    assert first.scans[0].embeddings.tolist() == [[0.0, 1.0]]
    assert len(second.scans[0]) == 0
    with pytest.raises(DataError, match="x:2: box must be"):
        batches('t,sensor,box\n0,rgb,"[1, 2, 3, 4]"\n')


def test_several_videos_are_refused_and_one_may_be_chosen():
    lines = [{"t": k, "sensor": "rgb", "boxes": BOXES, "video": video} for k, video in enumerate("aba")]
    rows = "".join(f"{k},rgb,1,2,3,4,{video}\n" for k, video in enumerate("aba"))
    pictures = "".join(f"{video}_{k}.jpg,1,2,3,4\n" for k, video in enumerate("aba"))
    for text in (
        "".join(json.dumps(line) + "\n" for line in lines),
        "t,sensor,left,top,width,height,video\n" + rows,
        "image,left,top,width,height\n" + pictures,
    ):
        with pytest.raises(DataError, match=r"x:[23]: holds several videos \(a, b\): .*--only-video NAME"):
            batches(text, how=StreamReading(Reading(rate_hz=1.0)))
        chosen = batches(text, how=StreamReading(Reading(video="a", rate_hz=1.0)))
        assert [batch.t for batch in chosen] == [0.0, 2.0]


@given(
    st.lists(
        st.fixed_dictionaries(
            {
                "frame": st.integers(0, 30),
                "left": st.integers(0, 500),
                "width": st.integers(1, 90),
                "class_id": st.integers(0, 3),
            }
        ),
        min_size=1,
        max_size=20,
    ),
    st.sampled_from(["frame", "image", "t", "t_ms", "date"]),
)
def test_a_stream_of_rows_holds_the_scans_of_the_table(tmp_path_factory, rows, column):
    """The reader of files is the oracle: the same options, the same rows in order of time, the same scans."""
    write = {
        "frame": str,
        "image": lambda k: f"v_{k:04d}.png",
        "t": lambda k: str(k / 20),
        "t_ms": lambda k: str(50 * k),
        "date": lambda k: f"1970-01-01T00:00:{k / 20:05.2f}",
    }[column]
    rows = sorted(rows, key=lambda row: row["frame"])
    name = "t" if column == "date" else column
    text = f"{name},sensor,left,top,width,height,class_id\n" + "".join(
        f"{write(row['frame'])},cam,{row['left']},5,{row['width']},9,{row['class_id']}\n" for row in rows
    )
    path = tmp_path_factory.mktemp("rows") / "table.csv"
    path.write_text(text)
    names = {0: "car", 1: "bus"}
    table = read_detections(path, rate_hz=20.0, class_names=names)
    found = batches(text, how=StreamReading(Reading(rate_hz=20.0, class_names=names)))
    assert [batch.t for batch in found] == table.scan_t.tolist()
    for batch, scan in zip(found, table.scans(), strict=True):
        assert batch.scans[0].boxes.tolist() == scan.boxes.tolist()
        assert batch.scans[0].scores.tolist() == scan.scores.tolist()
        assert batch.scans[0].classes.tolist() == scan.classes.tolist()


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("sensor,left,top,width,height\n0,1,2,3,4\n", "x:1: .*column t is missing"),
        ("t,sensor,left,top,width\n0,rgb,1,2,3\n", "x:1: .*column height is missing"),
        ("t,left,top,width,height\n0,1,2,3,4\n", "x:1: .*column sensor is missing"),
        ("t,sensor,left,top,width,height\n0,,1,2,3,4\n", "x:2: sensor is missing"),
        ("t,sensor,left,top,width,height\n,rgb,1,2,3,4\n", "x:2: t is missing"),
        ("t,t,sensor,left,top,width,height\n0,0,rgb,1,2,3,4\n", "x:1: column 't' is there twice"),
        (
            "t,sensor,left,top,width,height,embedding\n0,rgb,1,2,3,4,1 2\n0,rgb,1,2,3,4,1 2 3\n",
            "x:2: embeddings of one scan must have equally many numbers, not 2 and 3",
        ),
        ("t,sensor,left,top,width,height,score\n0,rgb,1,2,3,4,90%\n", "x:2: .*'90%'; leave the sign away"),
    ],
)
def test_what_a_row_or_a_header_lacks_is_named(text, what):
    with pytest.raises(DataError, match=what):
        batches(text)


def test_rows_of_which_every_field_is_blank_are_passed_over_as_in_files():
    rows = "t,sensor,left,top,width,height\n0,rgb,1,2,3,4\n,,,,,\n0,rgb,5,6,7,8\n ,, ,\n"
    ((scan,), _, _) = batches(rows)[0]
    assert len(scan) == 2


@given(st.lists(st.lists(st.integers(0, 60).map(str), max_size=4), max_size=40))
def test_that_a_class_never_came_is_said_if_and_only_if_it_did_not(scans):
    how = StreamReading(classes=["7"])
    lines = [
        {"t": t, "sensor": "rgb", "boxes": [[1, 2, 3, 4]] * len(names), "classes": names}
        for t, names in enumerate(scans)
    ]
    list(read_batches([json.dumps(line).encode() for line in lines], "x", how=how))
    came = {name for names in scans for name in names}
    assert (how.never_came() is not None) == (bool(came) and "7" not in came)


def test_a_scan_whose_rows_do_not_fit_is_passed_over_where_errors_are():
    rows = "t,sensor,left,top,width,height,embedding\n" + "".join(
        f"{t},rgb,1,2,3,4,{look}\n" for t, look in ((0, "1 2"), (0, "1"), (1, "3"), (2, "1 2"), (2, "1"))
    )
    said = []
    found = batches(rows, bad=lambda error: said.append(error.line))
    assert [batch.t for batch in found] == [1.0]
    assert said == [2, 5]


def test_what_a_table_says_of_its_detectors_is_not_passed_over_in_silence():
    said = []
    with listening(said.append):
        batches("t,sensor,left,top,width,height,sensor.even_score\n0,rgb,1,2,3,4,.3\n")
    assert [line.split(":")[0] for line in said] == ["sensor.even_score"]
