"""Text has a rim of its own shape, stays within the picture, and thins out where there is no room."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.drawing.movie.lettering import Place, letters, paint, room_for
from jeat_graph.drawing.movie.marks import Canvas
from jeat_graph.drawing.palette import RIM

SIZE = (200, 100)
WHITE = (255, 255, 255)


def paper() -> np.ndarray:
    return np.full((SIZE[1], SIZE[0], 3), 128, dtype=np.uint8)


@pytest.mark.parametrize("stroke", [1, 2, 3])
def test_the_rim_reaches_one_pixel_beyond_the_fill_on_every_side(stroke):
    painted = letters("118", 0.6, stroke)
    rows, columns = np.nonzero(painted.fill > 0)
    height, width = painted.fill.shape
    assert (columns.min(), columns.max()) == (1, width - 2)
    assert (rows.min(), rows.max()) == (1, height - 2)
    assert (painted.rim >= painted.fill).all()


@pytest.mark.parametrize("corner", [(-50.0, -50.0), (500.0, 500.0), (190.0, 5.0), (0.0, 99.0)])
def test_letters_stay_whole_within_the_picture(corner):
    painted = letters("solid: causal", 0.42, 1)
    place = room_for(painted, corner, SIZE)
    assert place.left >= 0
    assert place.right <= SIZE[0]
    assert place.top >= 0
    assert place.bottom <= SIZE[1]
    image = paper()
    paint(image, painted, place, WHITE)
    inside = image[place.top : place.bottom, place.left : place.right]
    ink = painted.fill > 0.99
    assert (inside[ink] >= 252).all()
    outline = (painted.rim > 0.99) & (painted.fill == 0)
    assert np.abs(inside[outline].astype(int) - np.array(RIM)).max() <= 2


def test_letters_wider_than_the_picture_are_cut_without_an_error():
    image = paper()
    painted = letters("a long line of text, far wider than this picture is", 1.0, 1)
    paint(image, painted, room_for(painted, (0.0, 50.0), SIZE), WHITE)
    assert image.max() == 255


def names(thin: bool) -> np.ndarray:
    """Two boxes at almost the same place, a small and a large one."""
    image = np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)
    boxes = np.array([[50.0, 50.0, 4.0, 3.0], [51.0, 50.0, 40.0, 30.0]])
    colours = [(255, 0, 0), (0, 255, 0)]
    Canvas(image, (1.0, 1.0)).names(boxes, ["17", "18"], colours, thin=thin)
    return image


def test_the_larger_box_keeps_its_name_where_two_collide():
    assert names(thin=True)[..., 0].max() == 0
    assert names(thin=True)[..., 1].max() > 200
    assert names(thin=False)[..., 0].max() > 200


def test_rectangles_that_only_touch_do_not_meet():
    assert not Place(0, 0, 10, 10).meets(Place(10, 0, 20, 10))
    assert Place(0, 0, 10, 10).meets(Place(9, 9, 20, 20))


def test_a_text_stands_on_a_ground_of_its_own_on_any_picture():
    noise = np.random.default_rng(0).integers(0, 256, (120, 400, 3), dtype=np.uint8)
    canvas = Canvas(noise.copy(), (1.0, 1.0))
    canvas.text("t = 1.000 s", (20.0, 60.0), (255, 255, 255), 1.0)
    changed = (canvas.image != noise).any(axis=2)
    rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
    ground = canvas.image[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    letters = ground.min(axis=2) > 200
    assert 0.02 < letters.mean() < 0.5
    # Where nothing is written the picture is left, at three tenths of its light.
    np.testing.assert_allclose(
        ground[0].astype(float), 0.3 * noise[rows[0], columns[0] : columns[-1] + 1], atol=12
    )
    assert not changed[: rows[0]].any()
