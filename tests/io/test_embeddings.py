"""Embeddings of detections: kept by files, scans and recordings; refused where they are none."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from jeat_graph import Tracker
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError
from jeat_graph.io.streams.scan_lines import batch_of
from jeat_graph.io.tables.detections_io import read_detections, write_detections

HEADER = "t,sensor,left,top,width,height,score,embedding\n"


def recording() -> Detections:
    rng = np.random.default_rng(0)
    box = [1.0, 2.0, 30.0, 40.0]
    return Detections.from_scans(
        [
            Scan(0.0, "rgb", [box, box], [0.5, 0.6], None, rng.normal(size=(2, 5))),
            Scan(0.0, "evt", [box], [0.5]),
            Scan(0.1, "rgb", np.zeros((0, 4)), []),
            Scan(0.2, "rgb", [box, box], [0.5, 0.4], None, [[np.nan] * 5, rng.normal(size=5)]),
        ]
    )


@pytest.mark.parametrize("name", ["boxes.csv", "boxes.parquet"])
def test_files_keep_them_to_the_last_bit(tmp_path, name):
    written = recording()
    write_detections(written, tmp_path / name)
    read = read_detections(tmp_path / name)
    np.testing.assert_array_equal(read.embeddings, written.embeddings)
    np.testing.assert_array_equal(read.boxes, written.boxes)


def test_they_have_unit_length_whatever_they_had():
    scan = Scan(0.0, "rgb", [[1, 2, 3, 4]] * 3, [0.5] * 3, None, [[3, 4], [3e300, 4e300], [3e-300, 4e-300]])
    np.testing.assert_allclose(scan.embeddings, [[0.6, 0.8]] * 3, rtol=1e-6)


def test_parts_of_a_recording_keep_theirs():
    whole = recording()
    again = Detections.concatenate([whole.select(["evt"]), whole.select(["rgb"])])
    np.testing.assert_array_equal(again.embeddings, whole.embeddings)
    for one, other in zip(again.scans(), whole.scans(), strict=True):
        np.testing.assert_array_equal(one.embeddings, other.embeddings)
    frame = whole.to_pandas()
    np.testing.assert_array_equal(Detections.from_pandas(frame).embeddings, whole.embeddings)
    assert whole.select(["evt"]).embeddings is None


def test_lists_of_all_kinds_are_read_from_parquet(tmp_path):
    columns = {"t": [0.0, 1.0], "sensor": ["rgb"] * 2, "left": [1.0] * 2, "top": [1.0] * 2}
    columns |= {"width": [9.0] * 2, "height": [9.0] * 2, "score": [0.5] * 2}
    for kind in (pa.list_(pa.float32()), pa.large_list(pa.float64()), pa.list_(pa.float32(), 2), pa.string()):
        values = ["3 4", None] if kind == pa.string() else [[3.0, 4.0], None]
        table = pa.table({**columns, "embedding": pa.array(values, kind)})
        parquet.write_table(table, tmp_path / "boxes.parquet")
        read = read_detections(tmp_path / "boxes.parquet")
        np.testing.assert_allclose(read.embeddings, [[0.6, 0.8], [np.nan] * 2], rtol=1e-6)


@pytest.mark.parametrize(
    ("second", "what"),
    [
        ("1 2", "embedding has 2 numbers where the rows before have 3"),
        ("1 2 x", "embedding must hold numbers, got 'x'"),
        ("0 0 0", "embedding must be finite and not all zero"),
        ("1 inf 0", "embedding must be finite and not all zero"),
    ],
)
def test_a_row_that_is_no_embedding_is_named(tmp_path, second, what):
    path = tmp_path / "boxes.csv"
    path.write_text(f"{HEADER}0,rgb,1,2,3,4,0.5,1 2 3\n1,rgb,1,2,3,4,0.5,{second}\n")
    with pytest.raises(DataError) as error:
        read_detections(path)
    assert str(error.value) == f"{path}:3: {what}"


@pytest.mark.parametrize(
    "wrong", [[[1.0, 2.0]], [[0.0], [1.0]], "ab", [[1.0], [1.0, 2.0]], np.ones((2, 5000))]
)
def test_a_scan_refuses_what_is_none(wrong):
    with pytest.raises(DataError, match="embedding"):
        Scan(0.0, "rgb", [[1, 2, 3, 4]] * 2, [0.5] * 2, None, wrong)


def test_recordings_of_two_lengths_do_not_go_together():
    scans = [Scan(float(k), "rgb", [[1, 2, 3, 4]], [0.5], None, np.ones((1, 2 + k))) for k in range(2)]
    with pytest.raises(DataError, match="equally many numbers, not 2 and 3"):
        Detections.from_scans(scans)


def test_a_stream_has_them_as_lists_or_null():
    item = {"t": 0.0, "sensor": "rgb", "boxes": [[1, 2, 3, 4]] * 2, "scores": [0.5, 0.5]}
    batch = batch_of({**item, "embeddings": [None, [3, 4]]}, "stdin", 1)
    np.testing.assert_allclose(batch.scans[0].embeddings, [[np.nan] * 2, [0.6, 0.8]], rtol=1e-6)
    with pytest.raises(DataError, match="embeddings must have shape"):
        batch_of({**item, "embeddings": "many"}, "stdin", 1)


def test_what_is_missing_has_no_length():
    item = {"t": 0.0, "sensor": "rgb", "boxes": [[1, 2, 3, 4]], "scores": [0.5]}
    unknown = batch_of({**item, "embeddings": [None]}, "stdin", 1).scans[0]
    known = Scan(1.0, "rgb", [[1, 2, 3, 4]], [0.5], None, np.ones((1, 3)))
    both = Detections.from_scans([unknown, known])
    np.testing.assert_array_equal(np.isnan(both.embeddings).all(axis=1), [True, False])
    assert Detections.from_scans([unknown]).embeddings is None
    tracker = Tracker("default", image=(100, 100))
    for scan in (unknown, known):
        tracker.step(scan)  # and no complaint of another length


@pytest.mark.parametrize("none", [None, float("nan"), []])
def test_data_frames_say_in_many_ways_that_there_is_none(none):
    frame = recording().to_pandas().drop(columns="embedding")
    count = len(frame)
    frame["embedding"] = [none] * (count - 1) + [np.array([3.0, 4.0])]
    found = Detections.from_pandas(frame).embeddings
    np.testing.assert_allclose(found[-1], [0.6, 0.8], rtol=1e-6)
    assert np.isnan(found[:-1]).all()
    frame["embedding"] = [none] * count
    assert Detections.from_pandas(frame).embeddings is None
    frame["embedding"] = [np.ones(2)] + [np.ones(3)] * (count - 1)
    with pytest.raises(DataError, match="row 1: embedding has 3 numbers where"):
        Detections.from_pandas(frame)
