"""Groups of marked pixels are those of a search from pixel to pixel, in OpenCV's order."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from jeat_graph.detection.linking import linked, marked_pixels


def pictures(rng, most_side):
    """Marks of all sizes and densities, also none."""
    for density in (0.0, 0.003, 0.02, 0.1, 0.3, 0.7):
        height, width = rng.integers(1, most_side, 2)
        marks = rng.integers(1, 9, (height, width)) * (rng.random((height, width)) < density)
        yield marks.astype(rng.choice([np.uint8, np.uint16]))


def search(marks, link_px):
    """Group (P,) of each marked pixel, by walks to all pixels within the gap."""
    y, x = np.nonzero(marks)
    group = np.zeros(len(x), dtype=int)
    for start in range(len(x)):
        if group[start]:
            continue
        group[start] = group.max() + 1
        waiting = [start]
        while waiting:
            p = waiting.pop()
            near = (abs(x - x[p]) <= link_px) & (abs(y - y[p]) <= link_px) & (group == 0)
            group[near] = group[start]
            waiting += np.flatnonzero(near).tolist()
    return group


def by_opencv(marks, link_px):
    """Groups of a dilation and its components."""
    mask = (marks > 0).astype(np.uint8)
    mask = cv2.dilate(mask, np.ones((link_px, link_px), dtype=np.uint8))
    count, labels = cv2.connectedComponents(mask, connectivity=8, ltype=cv2.CV_32S)
    return count - 1, labels[marks > 0]


@pytest.mark.parametrize("link_px", [1, 2, 3, 5, 8, 70, 130])
def test_groups_are_those_of_a_search(link_px):
    rng = np.random.default_rng(link_px)
    for marks in pictures(rng, 60 if link_px < 10 else 400):
        if np.count_nonzero(marks) > 3000:
            continue
        count, marked = linked(marked_pixels(marks), link_px)
        expected = search(marks, link_px)
        assert count == expected.max(initial=0)
        pairs = set(zip(marked.group.tolist(), expected.tolist(), strict=True))
        assert len(pairs) == count  # one name each way


@pytest.mark.parametrize("link_px", [1, 2, 3, 4, 7, 9, 20])
def test_groups_are_numbered_as_by_opencv(link_px):
    rng = np.random.default_rng(link_px)
    for _ in range(30):
        for marks in pictures(rng, 150):
            count, marked = linked(marked_pixels(marks), link_px)
            expected_count, expected = by_opencv(marks, link_px)
            assert count == expected_count
            np.testing.assert_array_equal(marked.group, expected)


def test_marked_pixels_come_row_by_row_with_their_marks():
    for marks in pictures(np.random.default_rng(3), 150):
        pixels = marked_pixels(marks)
        _, marked = linked(pixels, 3)
        y, x = np.nonzero(marks)
        np.testing.assert_array_equal([marked.x, marked.y, marked.weight], [x, y, marks[y, x]])
        assert pixels.total == marks.sum()


def test_groups_of_too_little_weight_are_left_out_and_the_others_keep_their_order():
    rng = np.random.default_rng(4)
    marks = (rng.integers(1, 9, (90, 120)) * (rng.random((90, 120)) < 0.04)).astype(np.uint16)
    _, whole = linked(marked_pixels(marks), 3)
    weight = np.bincount(whole.group, whole.weight)
    heavy = np.flatnonzero(weight >= 12)
    count, marked = linked(marked_pixels(marks), 3, 12)
    assert 0 < count == len(heavy) < weight.size - 1
    kept = np.isin(whole.group, heavy)
    np.testing.assert_array_equal(marked.group, np.searchsorted(heavy, whole.group[kept]) + 1)
    for before, after in ((whole.x, marked.x), (whole.y, marked.y), (whole.weight, marked.weight)):
        np.testing.assert_array_equal(after, before[kept])
