"""CSV and Parquet tables: every kind of bad input is one DataError at the right line."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet

from jeat_graph.data.errors import DataError
from jeat_graph.io.tables.csv_text import line_at
from jeat_graph.io.tables.file_tables import read_table

PLAIN = "a,b,name\n1,2,x\n3,4,y\n"


def read(path):
    """Read and convert everything, as a reader of a format does."""
    table = read_table(path, ("a", "b", "name"), ("extra",), short=("a", "b"))
    return table.number("a"), table.number("b"), table.text("name", blank_ok=True)


def failure(path) -> DataError:
    with pytest.raises(DataError) as caught:
        read(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    return caught.value


@pytest.mark.parametrize(
    "content",
    [
        PLAIN,
        PLAIN.replace("\n", "\r\n"),
        PLAIN.replace("\n", "\r"),
        "\ufeff" + PLAIN,
        PLAIN + "\n\n\n",
        PLAIN.rstrip("\n"),
        "\n\n" + PLAIN,
        PLAIN.replace("3,4", "\n  \n3,4"),
        PLAIN.replace("3,4,y", ",,\n3,4,y"),
        '"a","b","name"\n"1","2","x"\n"3","4","y"\n',
        "a , b,name\n 1,2 , x\n3,4,y\n",
        "name,b,a\nx,2,1\ny,4,3\n",
        "a,b,name,other\n1,2,x,?\n3,4,y,?\n",
        "a;b;name\r\n1,0;2;x\r\n3;4,00;y\r\n",
        "a\tb\tname\n1\t2\tx\n3\t4\ty\n",
    ],
    ids=[
        *("plain", "crlf", "cr", "bom", "blank lines at the end", "no newline at the end"),
        *("blank lines at the start", "white space between", "commas only", "quoted", "spaces"),
        *("other order", "other column", "semicolons", "tabs"),
    ],
)
def test_a_table_is_read_whatever_the_line_ends_quotes_and_blanks(write, content):
    a, b, name = read(write("t.csv", content))
    assert a.tolist() == [1, 3]
    assert b.tolist() == [2, 4]
    assert name.tolist() == ["x", "y"]


@pytest.mark.parametrize(
    ("content", "line", "words"),
    [
        ("", None, "empty"),
        ("\n \n", None, "empty"),
        ("1,2,x\n3,4,y\n", 1, "first line must name the columns: a,b,name"),
        ("\n\n1,2,x\n", 3, "first line must name the columns"),
        ("a,name\n1,x\n", 1, "column 'b' is missing"),
        ("a,B,name\n", 1, "column 'b' is missing; is 'B' meant?"),
        ("a,b,nam\n", 1, "column 'name' is missing; is 'nam' meant?"),
        ("a,b,name,extr\n", 1, "unknown column 'extr'; did you mean 'extra'?"),
        ("a,b,name,a\n1,2,x,3\n", 1, "column 'a' is there twice"),
        ("a;b;name\n1;2,5;x\n1;2,5,1;x\n", 3, "b must be a number, got '2,5,1'"),
        (b"\x1f\x8b\x08\x00", None, "compressed with gzip; give it a name that ends in .gz"),
        (b"PK\x03\x04....", None, "Excel workbook"),
        ("a,b,name\n1,2,x\n3,4,y,5\n", 3, "4 fields, but the header names 3"),
        ("a,b,name\n1,2,x\n3\n", 3, "1 field, but the header names 3"),
        ("a,b,name\r\n1,2,x\r\n\r\n\r\n3,4,y,5\r\n", 5, "4 fields"),
        ("a,b,name\n1,2,x\nno,4,y\n", 3, "a must be a number, got 'no'"),
        ("a,b,name\n1,2,x\n,4,y\n", 3, "a is missing"),
        ("a,b,name\n1,2,x\n3,nan,y\n", 3, "b must be a finite number, got nan"),
        ("a,b,name\n1,2,x\n3,-inf,y\n", 3, "b must be a finite number, got -inf"),
        ("a,b,name\n1,2,x\n3,1e999,y\n", 3, "b must be a finite number, got inf"),
        ("a,b,name\n\n1,2,x\n  \n,,\n3,0x10,y\n", 6, "b must be a number, got '0x10'"),
        ("\ufeffa,b,name\r\n1,2,x\r\n\r\n3,1_0,y\r\n", 4, "b must be a number, got '1_0'"),
        ("a,b,name\r1,2,x\r3,!,y\r", 3, "b must be a number, got '!'"),
        ('a,b,name\n1,2,"two\nlines"\n3,!,y\n', 4, "b must be a number, got '!'"),
        ('a,b,name\n1,2,"a ""quote"", a comma"\n3,!,y\n', 3, "b must be a number, got '!'"),
        ("a,b,name\n1,2,x\n3,!\n", 3, "b must be a number, got '!'"),
        (b"a,b,name\n1,2,x\n3,4,\xff\n", 3, "UTF-8"),
        (b"a,b,\xe4\n1,2,x\n", 1, "UTF-8"),
        ("a,b,name\n1,2,x\n".encode("utf-16"), None, "UTF-16"),
        (b"a,b,name\n1,2,x\n3,\x004,y\n", 3, "NUL"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(write, content, line, words):
    error = failure(write("t.csv", content))
    assert error.line == line
    assert words in str(error)


def test_no_table_has_more_than_10_000_columns(write):
    names = [f"c{k}" for k in range(10_000)]
    table = read_table(write("t.csv", ",".join(names) + "\n" + ",".join(["1"] * 10_000)), ("c9999",))
    assert table.whole("c9999").tolist() == [1]
    with pytest.raises(DataError, match="has 10001 columns; at most 10000 are read"):
        read_table(write("t.csv", ",".join([*names, "more"])), ("c9999",))


def test_a_missing_file_is_said_to_be_missing(tmp_path):
    assert "no such file" in str(failure(tmp_path / "none.csv"))


def test_a_folder_is_not_a_file(tmp_path):
    assert "is a folder" in str(failure(tmp_path))


def test_a_line_may_stop_after_the_leading_columns_if_the_reader_says_so(write):
    table = read_table(write("t.csv", "a,b,name\n1,2\n3,4,y\n5,6\n"), ("a", "b", "name"), short=("a", "b"))
    assert table.number("b").tolist() == [2, 4, 6]
    assert table.blank("name").tolist() == [True, False, True]


def test_whole_numbers_beyond_the_reach_of_floats_keep_their_digits(write):
    table = read_table(write("t.csv", f"a\n{2**53 + 1}\n-7\n"), ("a",))
    assert table.whole("a").tolist() == [2**53 + 1, -7]


def test_a_whole_number_may_be_written_as_a_float(write):
    assert read_table(write("t.csv", "a\n3.0\n4\n"), ("a",)).whole("a").tolist() == [3, 4]


def test_a_fraction_is_no_whole_number(write):
    with pytest.raises(DataError, match=r"t\.csv:3: a must be a whole number, got 2\.5"):
        read_table(write("t.csv", "a\n1\n2.5\n"), ("a",)).whole("a")


class TestParquet:
    def save(self, tmp_path, **columns):
        path = tmp_path / "t.parquet"
        parquet.write_table(pa.table(columns), path)
        return path

    def test_columns_of_any_numeric_type_are_read(self, tmp_path):
        path = self.save(
            tmp_path,
            a=pa.array([1, 3], pa.int16()),
            b=pa.array([2.0, 4.0], pa.float32()),
            name=pa.array(["x", "y"]).dictionary_encode(),
        )
        a, b, name = read(path)
        assert (a.tolist(), b.tolist(), name.tolist()) == ([1, 3], [2, 4], ["x", "y"])

    def test_nan_is_a_missing_value(self, tmp_path):
        path = self.save(tmp_path, a=[1.0, float("nan")], b=[1, 2], name=["x", "y"])
        assert "row 2: a is missing" in str(failure(path))

    def test_infinity_is_named_by_its_row(self, tmp_path):
        path = self.save(tmp_path, a=[1.0, 2.0, float("inf")], b=[1, 2, 3], name=["x", "y", "z"])
        assert "row 3: a must be a finite number, got inf" in str(failure(path))

    def test_text_where_numbers_should_be_is_named_by_its_row(self, tmp_path):
        path = self.save(tmp_path, a=["1", "no"], b=[1, 2], name=["x", "y"])
        assert "row 2: a must be a number, got 'no'" in str(failure(path))

    def test_points_in_time_are_no_numbers(self, tmp_path):
        path = self.save(tmp_path, a=pa.array([1, 2], pa.timestamp("us")), b=[1, 2], name=["x", "y"])
        assert "column a must hold numbers" in str(failure(path))

    def test_a_missing_column_is_named(self, tmp_path):
        assert "column 'b' is missing" in str(failure(self.save(tmp_path, a=[1.0], name=["x"])))

    @pytest.mark.parametrize("content", [b"", b"PAR1", b"PAR1 and no more PAR1", b"a,b,name\n"])
    def test_a_damaged_file_is_refused(self, write, content):
        failure(write("t.parquet", content))


@given(st.lists(st.sampled_from(["", "a", "1,2", '"', "x y"])), st.sampled_from(["\n", "\r\n", "\r"]))
def test_line_numbers_count_every_kind_of_line_end(lines, end):
    data = (end.join(lines) + end + "!").encode()
    assert line_at(data, len(data) - 1) == max(len(lines), 1) + 1


def test_a_million_rows_are_read_and_the_last_line_is_named(tmp_path):
    n = 1_000_000
    row = "0.1,2.25,rgb\n"
    path = tmp_path / "million.csv"
    path.write_text("a,b,name\n" + row * n, encoding="utf-8")
    table = read_table(path, ("a", "b", "name"))
    assert np.array_equal(table.number("b"), np.full(n, 2.25))
    assert (table.text("name") == "rgb").all()
    assert table.error(n - 1, "here").line == n + 1
