"""What a step's boxes are recorded as: with the noise with which the filter weighed them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from jeat_graph.filters import box_sides, singer
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.tracking.engine import StepBoxes
from jeat_graph.tracking.model_measured import records_of

C = ModelConstants()
Q = singer.ProcessNoise(0.0, 0.0, 0.0, 0.0)


def _records(boxes: np.ndarray, scale: np.ndarray, born: bool = False) -> np.ndarray:
    count = len(boxes)
    told = StepBoxes(2.0, np.zeros(count, dtype=np.int64), boxes)
    fit = (np.full(count, np.nan if born else 1.0), scale, np.ones(count))
    return records_of(told, np.arange(count), fit, Q, C)


@given(
    hnp.arrays(np.float64, (4, 2), elements=st.floats(1.0, 2000.0)),
    hnp.arrays(np.float64, 4, elements=st.floats(0.04, 20.0)),
)
def test_noise_is_that_with_which_the_filter_measures(size: np.ndarray, scale: np.ndarray) -> None:
    """The centre is the mean of two sides, ln size their difference; what lasts is that of `singer`."""
    rows = _records(np.concatenate([np.full((4, 2), 50.0), size], axis=1), scale)
    for row, one, s in zip(rows, size, scale.tolist(), strict=True):
        log_variance = math.log(s * C.side_std**2)
        side = box_sides.side_variance(one[None], log_variance, C)[0]
        lasting, lasting_size = (v[0] for v in singer.lasting_error(one[None], log_variance, C))
        np.testing.assert_allclose(row["r"], side / 2.0)
        np.testing.assert_allclose(row["coloured_std"] ** 2, lasting)
        np.testing.assert_allclose(row["size_var"], 2.0 * side / one**2 + lasting_size)
        np.testing.assert_allclose(row["z"], 50.0 + one / 2.0)
        np.testing.assert_allclose(row["log_size"], np.log(one))


@pytest.mark.parametrize("born", [False, True])
def test_a_step_without_boxes_has_no_records(born: bool) -> None:
    assert not len(_records(np.zeros((0, 4)), np.zeros(0), born))


def test_what_one_box_does_not_tell_is_recorded_where_it_began_a_track() -> None:
    row = _records(np.array([[10.0, 20.0, 40.0, 10.0]]), np.ones(1), born=True)[0]
    assert row["birth"]
    np.testing.assert_allclose(row["velocity_var"], C.velocity_std**2 * 400.0)
    np.testing.assert_allclose(row["acceleration_var"], C.acceleration_std**2 * 400.0)
