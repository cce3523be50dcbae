"""Arrays go to Arrow and back as by Arrow's own conversions, but without pandas."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.arrow_arrays import from_numpy, to_numpy

KINDS = st.sampled_from(["<f8", "<f4", "<i8", "<i4", "<u1", "?"])
SOME = KINDS.flatmap(lambda kind: arrays.arrays(kind, st.integers(0, 40)))
TEXTS = st.lists(st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=5), max_size=20)


@given(values=SOME)
def test_numbers_are_what_arrow_makes_of_them(values):
    assert from_numpy(values).equals(pa.array(values, from_pandas=True))


@given(values=SOME, seed=st.integers(0, 2**32 - 1))
@example(values=np.array([np.nan, 1.0]), seed=0)
def test_masked_entries_are_missing(values, seed):
    mask = np.random.default_rng(seed).random(len(values)) < 0.3
    missing = mask | (values != values)
    assert from_numpy(np.ma.array(values, mask=mask)).equals(pa.array(values, mask=missing))


@given(texts=TEXTS)
def test_text_is_what_arrow_makes_of_it(texts):
    assert from_numpy(np.array(texts, dtype=np.str_)).to_pylist() == texts


def test_text_that_utf_8_cannot_hold_is_refused():
    with pytest.raises(DataError, match="UTF-8"):
        from_numpy(np.array(["a", "\ud800"]))


@given(values=SOME, cuts=st.lists(st.integers(0, 40), max_size=4), begin=st.integers(0, 10))
def test_columns_come_back_from_any_pieces_of_memory(values, cuts, begin):
    pieces = np.split(values, sorted(min(cut, len(values)) for cut in cuts))
    column = pa.chunked_array([pa.array(piece) for piece in pieces], pa.from_numpy_dtype(values.dtype))
    np.testing.assert_array_equal(to_numpy(column), values)
    whole = pa.array(values)[begin:]
    back = to_numpy(whole)
    assert back.dtype == values.dtype
    np.testing.assert_array_equal(back, values[begin:])


@pytest.mark.parametrize("begin", [0, 1, 9])
def test_what_is_missing_becomes_what_is_asked_for(begin):
    column = pa.array([None, 1.5, None, 2.0] * 5)[begin:]
    np.testing.assert_array_equal(to_numpy(column, missing=np.nan), column.to_numpy(zero_copy_only=False))
    with pytest.raises(AssertionError, match="missing"):
        to_numpy(column)


def test_a_table_is_read_and_written_without_pandas(tmp_path):
    (tmp_path / "boxes.csv").write_text("t,sensor,left,top,width,height,score\n0,rgb,1,2,30,40,0.5\n\n")
    program = f"""
import sys
from jeat_graph.io.tables.detections_io import read_detections, write_detections
boxes = read_detections({str(tmp_path / "boxes.csv")!r})
write_detections(boxes, {str(tmp_path / "again.csv")!r})
assert len(boxes) == 1, boxes
sys.exit("pandas was loaded" if "pandas" in sys.modules else 0)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
