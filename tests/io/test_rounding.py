"""Rounding for tables, against decimal arithmetic."""

from __future__ import annotations

from decimal import ROUND_HALF_EVEN, Context, Decimal

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.io.tables.rounding import round_decimals, round_significant


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


def test_powers_of_ten_and_their_neighbours_have_the_digits_of_their_own_power():
    powers = np.array([float(f"1e{n}") for n in range(-15, 309)])
    for values in (powers, np.nextafter(powers, 0.0)):
        found = round_significant(values, 6)
        np.testing.assert_allclose(found, values, rtol=1e-15)


def test_what_is_very_small_is_nothing_and_what_is_very_large_stays_finite():
    assert round_significant(np.array([5e-324, 1e-310, -1e-40]), 6).tolist() == [0.0, 0.0, 0.0]
    most = np.finfo(float).max
    assert round_significant(np.array([most, -1.234567891e300]), 6).tolist() == [1.79769e308, -1.23457e300]
    # Nothing above this is a float, so it stays.
    assert round_significant(np.array([most]), 3).tolist() == [most]
