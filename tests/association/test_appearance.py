"""Embeddings less what all vehicles have in common."""

from __future__ import annotations

import numpy as np

from jeat_graph.association.appearance import centred


def test_the_mean_is_taken_off_and_what_is_left_has_unit_length():
    rng = np.random.default_rng(0)
    given = rng.normal(2.0, 1.5, (7, 16))
    found = centred(np.insert(given, 3, np.nan, axis=0))
    assert np.isnan(found[3]).all()
    for row, rest in zip(np.delete(found, 3, axis=0), given - given.mean(axis=0), strict=True):
        assert abs(row @ row - 1.0) < 1e-12
        assert row @ rest > 0.0
        np.testing.assert_allclose(row * np.sqrt(rest @ rest), rest, atol=1e-12)


def test_what_is_the_mean_itself_tells_nothing():
    found = centred(np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 0.0]]))
    np.testing.assert_array_equal(found, [[1.0, 0.0], [-1.0, 0.0], [np.nan, np.nan]])
    assert np.isnan(centred(np.full((2, 3), np.nan))).all()
