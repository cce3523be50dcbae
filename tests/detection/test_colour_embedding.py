"""Colour and shape of crops: what one vehicle has in common with itself, and not with another."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.detection.colour_embedding import NUMBERS, ColourEmbedder, colour_embedding
from jeat_graph.detection.crops import crops_of


def vehicle(top, bottom, noise=6.0, seed=0, side=(40, 60)):
    """A picture (h, w, 3) with one colour above and another below."""
    rng = np.random.default_rng(seed)
    picture = np.zeros((*side, 3))
    picture[: side[0] // 2], picture[side[0] // 2 :] = top, bottom
    return np.clip(picture + rng.normal(0.0, noise, picture.shape), 0, 255).astype(np.uint8)


RED, BLUE, GREY = (200, 30, 30), (30, 40, 200), (120, 120, 120)


def test_a_description_has_unit_length_and_is_its_own_best_match():
    seen = {
        name: [colour_embedding(vehicle(*colours, seed=k), 1.5) for k in range(2)]
        for name, colours in {"red": (GREY, RED), "blue": (GREY, BLUE), "roof": (RED, GREY)}.items()
    }
    for first, second in seen.values():
        assert first.shape == (NUMBERS,)
        assert np.linalg.norm(first) == pytest.approx(1.0, abs=1e-12)
        assert first @ second > 0.97
        others = [one for name in seen for one in seen[name] if one is not first and one is not second]
        assert max(first @ other for other in others) < first @ second - 0.04


def test_size_changes_little_and_the_ratio_of_sides_counts():
    small, large = (vehicle(GREY, RED, 0.0, side=side) for side in ((32, 48), (128, 192)))
    assert colour_embedding(small, 1.5) @ colour_embedding(large, 1.5) > 0.999
    assert colour_embedding(small, 1.5) @ colour_embedding(small, 0.5) < 0.95


def test_the_cosine_is_the_mean_of_the_bhattacharyya_coefficients():
    one, other = colour_embedding(vehicle(GREY, RED), 1.5), colour_embedding(vehicle(RED, BLUE), 0.9)
    ends = np.cumsum([13, 8, 8, 13, 8, 8, 8])
    parts = [np.split(7.0 * look**2, ends[:-1]) for look in (one, other)]
    assert [part.sum() for part in parts[0]] == pytest.approx([1.0] * 7)
    coefficients = [np.sqrt(p * q).sum() for p, q in zip(*parts, strict=True)]
    assert one @ other == pytest.approx(np.mean(coefficients), rel=1e-12)


def test_boxes_outside_the_picture_have_none():
    picture = vehicle(GREY, RED, side=(100, 100))
    boxes = np.array(
        [[10.0, 10, 30, 20], [-40, 0, 30, 30], [98, 10, 30, 30], [50, 50, 30, 3], [-20, -20, 40, 40]]
    )
    found = ColourEmbedder()(picture, boxes)
    assert np.isnan(found).all(axis=1).tolist() == [False, True, True, True, False]
    crops = dict(crops_of(picture, boxes))
    assert crops[0].shape == (20, 30, 3)
    assert crops[4].shape == (20, 20, 3)
    assert ColourEmbedder()(picture, np.zeros((0, 4))).shape == (0, NUMBERS)
