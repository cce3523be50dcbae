"""Tables as files: text is quoted where it must be."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.io.tables.table_writer import TableWriter, write_columns


def test_text_is_quoted_only_where_it_must_be(tmp_path):
    write_columns({"a": np.array(["x", "y"]), "b": np.array([1, 2])}, tmp_path / "plain.csv")
    assert (tmp_path / "plain.csv").read_text(encoding="utf-8") == "a,b\nx,1\ny,2\n"
    write_columns({"a": np.array(["x", 'say "y", z'])}, tmp_path / "quoted.csv")
    assert (tmp_path / "quoted.csv").read_text(encoding="utf-8") == 'a\n"x"\n"say ""y"", z"\n'


def test_missing_values_are_blank(tmp_path):
    whole = np.ma.masked_array([1, 2], mask=[False, True])
    write_columns({"a": whole, "b": np.array([np.nan, 0.5]), "c": np.array(["", "z"])}, tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_text(encoding="utf-8") == "a,b,c\n1,,\n,0.5,z\n"


def test_text_that_cannot_be_encoded_leaves_no_file(tmp_path):
    with pytest.raises(DataError, match="UTF-8"):
        write_columns({"a": np.array(["\ud800"])}, tmp_path / "t.csv")
    assert list(tmp_path.iterdir()) == []


def test_a_writer_that_was_not_entered_says_so(tmp_path):
    with pytest.raises(RuntimeError, match="with"):
        TableWriter(tmp_path / "t.csv").append({"a": np.array([1])})


@pytest.mark.parametrize("name", ["a.csv", "a.parquet"])
def test_an_append_without_rows_between_others_changes_nothing(tmp_path, name):
    with TableWriter(tmp_path / name) as writer:
        for values in ([1, 2], [], [3]):
            writer.append({"a": np.array(values, dtype=np.int64)})
    write_columns({"a": np.array([1, 2, 3])}, tmp_path / ("whole" + name))
    assert (tmp_path / name).read_bytes() == (tmp_path / ("whole" + name)).read_bytes()
