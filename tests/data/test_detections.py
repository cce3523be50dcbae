"""Detections: rows in any order become scans in time order, and nothing bad gets in."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.boxes import check_boxes
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError

BOX = [10.0, 20.0, 30.0, 40.0]


def from_rows(rows, **more):
    """Rows (t, sensor, left, score); a score of None marks an empty scan."""
    return Detections.from_rows(
        t=[row[0] for row in rows],
        sensor=[row[1] for row in rows],
        boxes=[[row[2], 0.0, 5.0, 5.0] for row in rows],
        scores=[np.nan if row[3] is None else row[3] for row in rows],
        empty=[row[3] is None for row in rows],
        **more,
    )


@st.composite
def recordings(draw):
    """Rows with few distinct times and sensors, so that scans have many rows, some of them empty."""
    row = st.tuples(
        st.sampled_from([-1.0, 0.0, 0.05, 0.1, 7.0]),
        st.sampled_from(["rgb", "evt", "lidar"]),
        st.floats(-1e4, 1e4),
        st.one_of(st.none(), st.floats(0.0, 1.0)),
    )
    return draw(st.lists(row, max_size=20))


def as_sets(rows):
    """The scans that the rows mean: {(t, sensor): [(left, score), …] in the order of the rows}."""
    out = {}
    for t, sensor, left, score in rows:
        scan = out.setdefault((t, sensor), [])
        if score is not None:
            scan.append((left, score))
    return out


def scans_of(detections):
    return {
        (scan.t, scan.sensor): list(zip(scan.boxes[:, 0].tolist(), scan.scores.tolist(), strict=True))
        for scan in detections.scans()
    }


@given(rows=recordings())
def test_rows_in_any_order_become_the_scans_they_mean(rows):
    detections = from_rows(rows)
    expected = as_sets(rows)
    assert scans_of(detections) == expected
    assert detections.num_scans == len(expected)
    assert len(detections) == sum(len(scan) for scan in expected.values())
    assert (np.diff(detections.scan_t) >= 0).all()
    assert detections.sensors == tuple(sorted({row[1] for row in rows}))


@given(rows=recordings())
def test_to_rows_and_back_changes_nothing(rows):
    detections = from_rows(rows)
    t, sensor, boxes, scores, empty, _ = detections.to_rows()
    again = Detections.from_rows(t, sensor, boxes, scores, empty)
    assert again.sensors == detections.sensors
    for name in ("scan_t", "scan_sensor", "scan_start", "boxes", "scores"):
        assert np.array_equal(getattr(again, name), getattr(detections, name))


@given(rows=recordings())
def test_a_batch_is_all_the_scans_of_one_time(rows):
    detections = from_rows(rows)
    batches = list(detections.batches())
    assert [batch[0].t for batch in batches] == sorted({row[0] for row in rows})
    for batch in batches:
        assert len({scan.t for scan in batch}) == 1
        assert [scan.sensor for scan in batch] == sorted(
            {sensor for t, sensor, *_ in rows if t == batch[0].t}
        )


@given(rows=recordings())
def test_the_sensors_taken_apart_and_put_together_are_the_whole(rows):
    detections = from_rows(rows)
    parts = [detections.select(names) for names in ([], *detections.sensors)]
    for part, name in zip(parts, ("", *detections.sensors), strict=True):
        assert scans_of(part) == {key: scan for key, scan in as_sets(rows).items() if key[1] == name}
    assert scans_of(Detections.concatenate(parts)) == scans_of(detections)


@given(rows=recordings())
def test_scans_in_any_order_become_a_recording(rows):
    scans = list(from_rows(rows).scans())
    assert scans_of(Detections.from_scans(scans[::-1])) == as_sets(rows)


def test_scans_of_one_sensor_at_one_time_become_one():
    two = [Scan(0.0, "rgb", [BOX], [0.5]), Scan(0.0, "rgb", [BOX], [0.7])]
    merged = Detections.from_scans(two)
    assert merged.num_scans == 1
    assert merged.scores.tolist() == [0.5, 0.7]


def test_an_empty_scan_is_kept_and_yields_no_box():
    detections = from_rows([(0.0, "rgb", 0.0, None), (0.1, "rgb", 1.0, 0.5)])
    assert [len(scan) for scan in detections.scans()] == [0, 1]
    assert detections.scan(0).boxes.shape == (0, 4)


def test_an_empty_mark_beside_boxes_of_the_same_scan_changes_nothing():
    assert scans_of(from_rows([(0.0, "rgb", 0.0, None), (0.0, "rgb", 1.0, 0.5)])) == {
        (0.0, "rgb"): [(1.0, 0.5)]
    }


def test_a_recording_without_rows():
    nothing = Detections.from_rows([], [], np.zeros((0, 4)), [])
    assert (nothing.num_scans, len(nothing), list(nothing.batches())) == (0, 0, [])
    assert Detections.from_scans([]).num_scans == 0
    assert Detections.concatenate([nothing, nothing]).num_scans == 0


def test_classes_follow_their_rows():
    rows = [(0.1, "rgb", 1.0, 0.5), (0.0, "rgb", 2.0, 0.6), (0.2, "rgb", 0.0, None)]
    detections = from_rows(rows, classes=["car", "truck", ""])
    assert detections.classes.tolist() == ["truck", "car"]
    plain = from_rows([(0.0, "evt", 3.0, 0.5)])
    assert Detections.concatenate([detections, plain]).classes.tolist() == ["", "truck", "car"]
    assert detections.to_rows()[5].tolist() == ["truck", "car", ""]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", range(4))
def test_a_coordinate_that_is_not_finite_is_refused(bad, column):
    boxes = np.array([BOX, BOX])
    boxes[1, column] = bad
    with pytest.raises(DataError, match=r"box 1: .*finite"):
        check_boxes(boxes, [0.5, 0.5])


@pytest.mark.parametrize("size", [0.0, -1.0])
@pytest.mark.parametrize("column", [2, 3])
def test_a_size_that_is_not_positive_is_refused(size, column):
    box = list(BOX)
    box[column] = size
    with pytest.raises(DataError, match="positive"):
        check_boxes([box], [0.5])


@pytest.mark.parametrize("score", [-0.01, 1.01, np.nan, np.inf])
def test_a_score_outside_0_to_1_is_refused(score):
    with pytest.raises(DataError, match="score"):
        check_boxes([BOX], [score])


@pytest.mark.parametrize(
    ("boxes", "scores"),
    [
        ([BOX], [0.5, 0.5]),
        ([BOX[:3]], [0.5]),
        (BOX, [0.5]),
        ([], [0.5]),
        ([BOX, BOX[:3]], [0.5, 0.5]),
        ([["a"] * 4], [0.5]),
    ],
)
def test_arrays_of_the_wrong_shape_are_refused(boxes, scores):
    with pytest.raises(DataError, match="shape"):
        check_boxes(boxes, scores)


@pytest.mark.parametrize("t", [np.nan, np.inf, -np.inf])
def test_a_time_that_is_not_finite_is_refused(t):
    with pytest.raises(DataError, match="finite"):
        Scan(t, "rgb", [BOX], [0.5])
    with pytest.raises(DataError, match="row 1: t must be finite"):
        Detections.from_rows([0.0, t], ["rgb", "rgb"], [BOX, BOX], [0.5, 0.5])


def test_a_bad_row_is_named_by_its_place_in_the_input():
    rows = [(0.3, "rgb", 0.0, None), (0.2, "rgb", 0.0, 0.5), (0.1, "rgb", np.nan, 0.5)]
    with pytest.raises(DataError, match="row 2"):
        from_rows(rows)


def test_columns_of_different_length_are_refused():
    with pytest.raises(DataError, match="one entry a row"):
        Detections.from_rows([0.0, 1.0], ["rgb"], [BOX], [0.5])


def test_what_an_empty_row_holds_is_not_looked_at():
    detections = Detections.from_rows([0.0], ["rgb"], [[np.nan] * 4], [np.nan], empty=[True])
    assert (detections.num_scans, len(detections)) == (1, 0)


def test_a_data_frame_and_detections_are_two_ways_to_say_one_thing():
    named = Detections.from_scans(
        [
            Scan(0.0, "rgb", [BOX, [1, 2, 3, 4]], [0.5, 0.75], ["car", None]),
            Scan(0.05, "evt", [], []),
            Scan(0.1, "rgb", [BOX], [0.25], ["van"]),
        ]
    )
    for detections in (named, Detections.from_scans([Scan(0.0, "rgb", [BOX], [0.5])])):
        back = Detections.from_pandas(detections.to_pandas())
        for ours, theirs in zip(detections.to_rows(), back.to_rows(), strict=True):
            assert np.array_equal(ours, theirs, equal_nan=ours.dtype.kind == "f")
        assert (back.classes is None) == (detections.classes is None)


def test_a_data_frame_may_have_corners_and_nothing_more_than_boxes():
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame({"t": [0.0], "left": [10.0], "top": [20.0], "right": [50.0], "bottom": [80.0]})
    found = Detections.from_pandas(frame, sensor="gantry")
    assert found.sensors == ("gantry",)
    assert found.boxes.tolist() == [[10.0, 20.0, 40.0, 60.0]]
    assert found.scores.tolist() == [1.0]
    with pytest.raises(DataError, match="need the column t"):
        Detections.from_pandas(frame.drop(columns="t"))


def test_sensors_are_selected_by_one_name_or_by_several():
    both = Detections.from_scans([Scan(0.0, name, [BOX], [0.5]) for name in ("rgb", "evt", "b")])
    assert both.select("rgb").sensors == ("rgb",)
    assert both.select(["rgb", "evt"]).sensors == ("evt", "rgb")
    assert both.select([]).num_scans == 0
    with pytest.raises(DataError, match="no sensor 'lidar' in the recording; there are: b, evt, rgb"):
        both.select(["rgb", "lidar"])


@pytest.mark.parametrize(
    ("times", "options"),
    [
        ({"time": [0.5]}, {}),
        ({"timestamp_ms": [500]}, {}),
        ({"t": [500]}, {"time_unit": "ms"}),
        ({"Frame": [11]}, {"rate_hz": 20.0}),
    ],
)
def test_a_data_frame_has_the_names_that_files_have(times, options):
    pd = pytest.importorskip("pandas")
    corners = {"x1": [10.0], "y1": [20.0], "x2": [40.0], "y2": [60.0], "conf": [0.5], "camera": ["evt"]}
    centre = {"cx": [25.0], "cy": [40.0], "w": [30.0], "h": [40.0], "prob": [0.5], "sensor": ["evt"]}
    for boxes in (corners, centre):
        found = Detections.from_pandas(pd.DataFrame({**times, **boxes}), **options)
        assert (found.scan_t.tolist(), found.boxes.tolist()) == ([0.5], [BOX])
        assert (found.scores.tolist(), found.sensors) == ([0.5], ("evt",))


@pytest.mark.parametrize(
    ("times", "options", "what"),
    [
        ({"t_ms": [500]}, {"time_unit": "us"}, "'t_ms' is in ms, but time_unit says us"),
        ({"frame": [10]}, {}, "rate_hz"),
        ({"t": ["yesterday"]}, {}, "row 0: t must be a number, got 'yesterday'"),
        ({"t": ["2024-05-41 10:00"]}, {}, "row 0: t must be a time, got '2024-05-41 10:00'"),
    ],
)
def test_times_that_a_data_frame_leaves_open_are_refused(times, options, what):
    pd = pytest.importorskip("pandas")
    boxes = {"left": [1.0], "top": [2.0], "width": [3.0], "height": [4.0]}
    with pytest.raises(DataError, match=what):
        Detections.from_pandas(pd.DataFrame({**times, **boxes}), **options)


def test_boxes_without_area_in_a_data_frame_are_left_out_and_counted():
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame({"t": [0.0, 1.0], "left": 1.0, "top": 2.0, "width": [3.0, 0.0], "height": 4.0})
    found = Detections.from_pandas(frame)
    assert (len(found), found.num_scans, found.dropped) == (1, 2, 1)


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_dates_and_spans_of_a_data_frame_are_seconds(unit):
    pd = pytest.importorskip("pandas")
    times = 1.7e9 + np.array([0.0, 1.0, 3.0] if unit == "s" else [0.0, 0.25, 1.5])
    boxes = {name: [10.0] * 3 for name in ("left", "top", "width", "height")}
    dates = pd.to_datetime(np.round(times * 1e6).astype(np.int64), unit="us")
    for column in (dates.astype(f"datetime64[{unit}]"), dates.tz_localize("UTC").tz_convert("Asia/Tokyo")):
        found = Detections.from_pandas(pd.DataFrame({"t": column, **boxes}))
        np.testing.assert_allclose(found.scan_t, times, rtol=0, atol=1e-6)
    spans = (dates - dates[0]).astype(f"timedelta64[{unit}]")
    found = Detections.from_pandas(pd.DataFrame({"t": spans, **boxes}))
    np.testing.assert_allclose(found.scan_t, times - times[0], rtol=0, atol=1e-6)
    with pytest.raises(DataError, match="row 1: t is missing"):
        Detections.from_pandas(pd.DataFrame({"t": dates.where(dates != dates[1]), **boxes}))


def test_supervision_and_detections_are_two_ways_to_say_one_thing():
    sv = pytest.importorskip("supervision")
    source = sv.Detections(
        xyxy=np.array([[10.0, 20.0, 50.0, 80.0]]),
        confidence=np.array([0.5]),
        class_id=np.array([2]),
        data={"class_name": np.array(["car"])},
    )
    found = Detections.from_supervision(source, t=0.5)
    assert found.scan_t.tolist() == [0.5]
    assert found.classes.tolist() == ["car"]
    back = found.to_supervision()
    assert np.array_equal(back.xyxy, source.xyxy)
    assert back.data["class_name"].tolist() == ["car"]
    nothing = Detections.from_supervision(sv.Detections.empty(), t=0.5)
    assert (nothing.num_scans, len(nothing)) == (1, 0)


@pytest.mark.parametrize(
    "kind", ["read-only", "unaligned", "reversed", "single precision", "other byte order"]
)
def test_arrays_of_any_kind_become_the_one_kind_that_the_kernels_are_compiled_for(kind):
    """Tables and messages often give arrays that cannot be written; each other kind compiles for a minute."""
    boxes, scores = np.array([[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0]]), np.array([0.5, 0.25])

    def other(values):
        if kind == "read-only":
            return np.frombuffer(values.tobytes()).reshape(values.shape)
        if kind == "unaligned":
            return np.frombuffer(bytearray(b"\0" + values.tobytes()), offset=1).reshape(values.shape)
        if kind == "reversed":
            return values[::-1]
        return values.astype("<f4" if kind == "single precision" else ">f8")

    expected = (boxes[::-1], scores[::-1]) if kind == "reversed" else (boxes, scores)
    for found, wanted in zip(check_boxes(other(boxes), other(scores)), expected, strict=True):
        np.testing.assert_array_equal(found, wanted)
        assert (found.dtype, found.dtype.isnative) == (np.float64, True)
        assert found.flags.c_contiguous
        assert found.flags.behaved
