"""Rounding of the road's tables: compiled, against what all other tables are rounded by."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.io.table_writer import round_decimals, round_significant
from jeat_graph.road.rounding import round_states


def _rounded(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    mean, var = values.copy(), values.copy()
    round_states(mean, var, 3, 6)
    return mean, var


@given(st.lists(st.floats(-1e9, 1e9).filter(lambda x: x == 0 or abs(x) > 1e-30), min_size=1, max_size=30))
def test_it_rounds_as_other_tables_are_rounded(values: list[float]) -> None:
    given_values = np.array(values)
    mean, var = _rounded(given_values)
    np.testing.assert_array_equal(mean, round_decimals(given_values, 3))
    np.testing.assert_allclose(var, round_significant(given_values, 6), rtol=1e-15)


def test_powers_of_ten_and_what_is_not_a_number() -> None:
    values = np.array([1e-5, 1.0, 10.0, 1e6, 0.99999951, 9.9999949, 123456.5, -2.5, 0.0, np.nan, np.inf])
    mean, var = _rounded(values)
    np.testing.assert_array_equal(var, round_significant(values, 6))
    np.testing.assert_array_equal(mean, round_decimals(values, 3))
    assert not np.signbit(_rounded(np.array([-1e-9]))[0][0])
