"""Whatever a file holds, a reader returns data or raises DataError with one line."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.io.tables.trajectories_io import COLUMNS, read_trajectories
from jeat_graph.io.tables.truth_io import read_truth

NAMES = ["f.csv", "f.txt", "f.parquet", "f.npy", "f.json", "f"]
HEADERS = [
    "t,sensor,left,top,width,height,score",
    "t,object_id,left,top,width,height,ignore,class",
    ",".join(COLUMNS),
    "video,image,track_id,box,score,class_id,name",
    "frame_index,x_min,y_min,x_max,y_max,class_id,confidence,tracker_id",
]
FIELDS = st.sampled_from(
    [
        "0",
        "1",
        "0.5",
        "-1",
        "rgb",
        "",
        "nan",
        "inf",
        "1e400",
        '"',
        '""',
        '"a"b',
        "x" * 50,
        "9" * 30,
        " ",
        "é",
        "|",
        "a|b|a",
    ]
)
ENDS = st.sampled_from(["\n", "\r\n", "\r", "\n\n", ""])
LINES = st.builds(
    lambda fields, comma, end: comma.join(fields) + end,
    st.lists(FIELDS, max_size=20),
    st.sampled_from([",", " ", ";"]),
    ENDS,
)
TABLES = st.builds(
    lambda header, lines: header + "\n" + "".join(lines),
    st.sampled_from(HEADERS),
    st.lists(LINES, max_size=6),
)
BARE = st.lists(LINES, max_size=6).map("".join)
BYTES = (
    st.binary(max_size=200)
    | st.binary(max_size=60).map(lambda b: b"PAR1" + b + b"PAR1")
    | st.binary(max_size=60).map(lambda b: b"\x93NUMPY\x01\x00" + b)
)
JSON = st.recursive(
    st.sampled_from(["null", "true", "1", "-1e999", "NaN", '"a"', "[]", "{}"]),
    lambda inner: (
        st.lists(inner, max_size=4).map(lambda v: "[" + ",".join(v) + "]")
        | st.lists(
            st.tuples(
                st.sampled_from(["image_id", "bbox", "score", "images", "annotations", "id", "categories"]),
                inner,
            ),
            max_size=5,
        ).map(lambda v: "{" + ",".join(f'"{k}":{x}' for k, x in v) + "}")
    ),
    max_leaves=12,
)
CONTENT = (TABLES | BARE | JSON | st.text(max_size=200)).map(
    lambda s: s.encode("utf-8", "surrogatepass")
) | BYTES


@pytest.mark.parametrize("reader", [read_detections, read_truth, read_trajectories])
@given(name=st.sampled_from(NAMES), content=CONTENT)
@example(name="f.csv", content=b't,sensor,left,top,width,height,score\n0,"rgb')
@example(name="f.csv", content=b"t,sensor,left,top,width,height,score\n" + b"x" * 1_000_000)
@example(name="f.json", content=b"[" * 100_000)
@example(name="f.txt", content=b"1 " * 17 + b"\n")
@example(name="f.txt", content=b"9223372036854775807,1,1,1,1,1,0.5\n-9223372036854775808,1,1,1,1,1,0.5\n")
def test_garbage_never_raises_anything_but_a_data_error(reader, name, content):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(content)
        message = str(path)
        try:
            reader(path, rate_hz=10.0)
        except DataError as error:
            message = str(error)
        assert message.startswith(str(path))
