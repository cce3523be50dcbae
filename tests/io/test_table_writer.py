"""Rounding for tables, against decimal arithmetic."""

from __future__ import annotations

from decimal import ROUND_HALF_EVEN, Context, Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.io.table_writer import TableWriter, round_decimals, round_significant, write_columns


@given(st.floats(1e-14, 1e14) | st.floats(-1e14, -1e-14))
def test_significant_digits_are_those_of_decimal_arithmetic(value):
    exact = Context(prec=6, rounding=ROUND_HALF_EVEN).create_decimal(Decimal(value))
    found = float(round_significant(np.array([value]), 6)[0])
    # A value half-way between two roundings may go either way: the scaling itself rounds.
    spacing = Decimal(10) ** (exact.adjusted() - 5)
    assert len(Decimal(repr(found)).normalize().as_tuple().digits) <= 6
    assert abs(Decimal(repr(found)) - Decimal(value)) <= spacing / 2 * Decimal("1.000000001")


def test_what_has_no_digits_stays_as_it_is():
    values = np.array([0.0, -0.0, np.nan, np.inf, -np.inf])
    found = round_significant(values, 6)
    assert np.array_equal(found, values, equal_nan=True)
    assert not np.signbit(found[:2]).any()


def test_rounding_leaves_no_minus_zero():
    assert not np.signbit(round_decimals(np.array([-0.0001, -0.0]), 3)).any()


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
