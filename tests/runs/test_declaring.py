"""What a configuration leaves open is found in the recording: the picture's size."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections
from jeat_graph.runs.declaring import fit_input


def recording(boxes: np.ndarray) -> Detections:
    n = len(boxes)
    return Detections.from_rows(0.05 * np.arange(n), np.full(n, "cam"), boxes, np.full(n, 0.9))


def picture(boxes: np.ndarray) -> tuple[float, float]:
    image = fit_input(load_config("default"), recording(boxes))[0].image
    return image.width, image.height


def drive(n: int) -> np.ndarray:
    """A vehicle that drives from the left edge to the lower right corner of 1,920 x 1,080 px."""
    share = np.linspace(0.0, 1.0, n)[:, None]
    return np.hstack([share * [1820.0, 1000.0], np.tile([100.0, 80.0], (n, 1))])


@pytest.mark.parametrize("n", [1, 2, 5, 40, 5000])
def test_the_picture_reaches_as_far_as_the_boxes(n):
    assert picture(drive(n)) == ((1920.0, 1080.0) if n > 1 else (100.0, 80.0))


@pytest.mark.parametrize("wild", [(1e5, 10.0, 40.0, 20.0), (10.0, 9e4, 40.0, 20.0), (0.0, 0.0, 3e7, 3e7)])
def test_a_wild_box_does_not_say_how_far(wild):
    assert picture(np.vstack([drive(100), [wild]])) == (1920.0, 1080.0)
    assert picture(np.vstack([[wild], drive(5000), [wild]])) == (1920.0, 1080.0)


def test_boxes_left_of_the_picture_and_above_do_no_harm():
    assert picture(np.array([[-300.0, -200.0, 20.0, 20.0]] * 4)) == (1.0, 1.0)
