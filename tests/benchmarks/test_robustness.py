"""Odd detectors."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.robustness import variations, varied


@pytest.fixture(scope="module")
def plain():
    return varied("as it is", 0, 1.0)


@pytest.mark.parametrize("name", [v.name for v in variations()])
def test_each_variation_changes_the_recording(name, plain):
    odd = varied(name, 0, 1.0)
    same = np.array_equal(plain.detections.boxes, odd.detections.boxes) and np.array_equal(
        plain.detections.scores, odd.detections.scores
    )
    same = same and np.array_equal(plain.detections.scan_t, odd.detections.scan_t)
    assert same == (name == "as it is")
