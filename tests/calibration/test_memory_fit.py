"""Share and memory of lasting errors are found again in errors drawn with them."""

import numpy as np
import pytest

from jeat_graph.calibration.memory import fit_memory


def drawn(rng, objects, times, share, memory, outliers=0.0):
    """Errors (C, 2), keys (C, 2) and times (C,) of objects seen at `times`."""
    root = np.linalg.cholesky(
        share * np.exp(-np.abs(times[:, None] - times) / memory) + 1e-9 * np.eye(len(times))
    )
    error, key, t = [], [], []
    for k in range(objects):
        lasting = root @ rng.normal(size=(len(times), 2))
        one = lasting + np.sqrt(1.0 - share) * rng.normal(size=(len(times), 2))
        one[rng.random(len(times)) < outliers] *= 5.0
        error.append(one)
        key.append(np.column_stack([np.full(len(times), k % 2), np.full(len(times), k)]))
        t.append(times)
    order = rng.permutation(objects * len(times))
    return tuple(np.concatenate(column)[order] for column in (error, key, t))


@pytest.mark.parametrize(
    ("rate", "share", "memory"), [(100.0, 0.5, 0.15), (20.0, 0.3, 0.25), (10.0, 0.7, 0.8)]
)
def test_share_and_memory_are_found_again(rate, share, memory):
    times = np.arange(int(5 * rate)) / rate
    found = fit_memory(*drawn(np.random.default_rng(0), 150, times, share, memory))
    assert found == (pytest.approx(share, abs=0.04), pytest.approx(memory, rel=0.2))


def test_outliers_count_as_white():
    times = np.arange(200) / 40.0
    share, memory = fit_memory(*drawn(np.random.default_rng(1), 60, times, 0.5, 0.3, outliers=0.02))
    assert 0.35 < share < 0.5
    assert memory == pytest.approx(0.3, rel=0.25)


def test_white_errors_have_no_memory():
    share, _ = fit_memory(*drawn(np.random.default_rng(2), 40, np.arange(200) / 20.0, 0.0, 1.0))
    assert share == 0.0


def test_too_few_pairs_say_nothing():
    share, _ = fit_memory(*drawn(np.random.default_rng(3), 5, np.arange(4) / 20.0, 0.9, 1.0))
    assert share == 0.0


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("count", [0, 400])
def test_a_perfect_detector_has_no_memory(count):
    nothing = np.zeros((count, 2))
    assert fit_memory(nothing, nothing.astype(np.int64), 0.05 * np.arange(count))[0] == 0.0
