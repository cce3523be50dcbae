"""Things that are no vehicles, drawn at random into the pictures that a network learns from.

A simulated highway has a road, its signs and its surroundings, and no houses, windows, fences or gardens: a
network that saw nothing else takes bright and grainy patches of them for vehicles. It learns better from
shapes that overlap each other at random, in all sizes, plain, shaded or grained. They need to look like
nothing in particular.

Source: Baradad et al., "Learning to See by Looking at Noise" (2021), whose dead leaves they are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray
from jeat_graph.io.media.decoders import RgbImage

#: Smallest and largest shape (px), as often in each octave between.
_LEAST_PX, _MOST_PX = 4.0, 160.0
#: As many shapes at most, and corners of one.
_MOST_SHAPES, _LEAST_CORNERS, _MOST_CORNERS = 40, 3, 8
#: Vehicles keep so much around them (px): what touches them would tell where they are, or hide them.
_MARGIN_PX = 3.0
#: Shares of the kinds: a shape with corners, a round one, a front with windows, a post or a wire, specks.
_KINDS = (0.35, 0.15, 0.2, 0.15, 0.15)
#: A window, and what is left between two, as shares of a front.
_MOST_WINDOWS, _WINDOW_SHARE = 6, (0.3, 0.8)
_WHITE = 255.0
#: Specks, as far roofs and leaves in the light are: how wide and high each is, and how far apart (px).
_SPECK_PX, _BETWEEN_PX = (1.0, 8.0), (5.0, 20.0)
#: Cells of a shape's grain (px), and how strong it is at most (grey levels).
_GRAIN_PX, _GRAIN = (1.0, 8.0), 70.0
#: How far edges are smeared (px).
_BLUR_PX = (0.3, 1.2)
#: Grey parts: so many shapes have hardly a colour, and others this much (grey levels).
_COLOURLESS, _COLOUR = 0.6, 45.0


def draw_clutter(frame: RgbImage, vehicles: FloatArray, rng: np.random.Generator) -> RgbImage:
    """Draw shapes into a picture, beside the vehicles.

    Args:
        frame: (H, W, 3), red, green, blue.
        vehicles: (M, 4) left, top, right, bottom of all that shall stay as it is (px).
        rng: random numbers.

    Returns:
        A new picture of that size.
    """
    height, width = frame.shape[:2]
    shown = np.array(frame, copy=True)
    count = int(rng.integers(1, _MOST_SHAPES + 1))
    sizes = np.exp(rng.uniform(np.log(_LEAST_PX), np.log(_MOST_PX), count))
    # The large ones first: what is small lies upon them, as windows do on walls.
    for size in np.sort(sizes)[::-1].tolist():
        half = np.maximum(0.5 * size * np.exp(rng.uniform(-0.7, 0.7) * np.array([1.0, -1.0])), 1.0)
        middle = rng.random(2) * (width, height)
        corners = np.concatenate([middle - half, middle + half])
        # The same random numbers are drawn for a shape that is left out: the next ones do not depend on it.
        drawn = _shape(half, rng)
        if not _touches(corners, vehicles):
            _lay(shown, drawn, np.floor(corners[:2]).astype(int))
    return shown


class _Shape(NamedTuple):
    """A patch with colours (h, w, 3), and how much of each pixel it covers (h, w, 1), 0 to 1."""

    colours: npt.NDArray[np.float32]
    cover: npt.NDArray[np.float32]


def _touches(corners: FloatArray, vehicles: FloatArray) -> bool:
    apart = (corners[:2] >= vehicles[:, 2:] + _MARGIN_PX) | (corners[2:] <= vehicles[:, :2] - _MARGIN_PX)
    return not bool(apart.any(axis=1).all())


def _lay(shown: RgbImage, shape: _Shape, place: npt.NDArray[np.int_]) -> None:
    """Lay a shape into a picture; what goes beyond it is left out."""
    height, width = shape.cover.shape[:2]
    left, top = (max(int(-at), 0) for at in place)
    right, bottom = min(width, shown.shape[1] - int(place[0])), min(height, shown.shape[0] - int(place[1]))
    if right <= left or bottom <= top:
        return
    inner = (slice(top, bottom), slice(left, right))
    part = shown[place[1] + top : place[1] + bottom, place[0] + left : place[0] + right]
    cover = shape.cover[inner]
    part[:] = np.clip(part * (1.0 - cover) + shape.colours[inner] * cover, 0.0, _WHITE).astype(np.uint8)


def _shape(half: FloatArray, rng: np.random.Generator) -> _Shape:
    import cv2

    width, height = (int(np.ceil(2.0 * one)) for one in half)
    kind = int(np.searchsorted(np.cumsum(_KINDS), rng.random(), side="right"))
    outline = (_polygon, _ellipse, _front, _post, _specks)[min(kind, len(_KINDS) - 1)]
    cover = np.zeros((height, width), dtype=np.uint8)
    colours = _colours(width, height, rng)
    outline(cover, colours, rng)
    # A picture is not sharp; what is drawn into it would be recognised by its edges.
    blur = float(rng.uniform(*_BLUR_PX))
    soft = cv2.GaussianBlur(cover, (0, 0), blur, borderType=cv2.BORDER_CONSTANT)
    smeared = cv2.GaussianBlur(colours, (0, 0), blur, borderType=cv2.BORDER_REPLICATE)
    return _Shape(
        np.asarray(smeared, dtype=np.float32), (soft.astype(np.float32) / np.float32(_WHITE))[..., None]
    )


def _colours(width: int, height: int, rng: np.random.Generator) -> npt.NDArray[np.float32]:
    """Draw a colour, shaded from one side to another, and grained."""
    import cv2

    colour = _colour(rng)
    across, along = (np.linspace(-0.5, 0.5, n, dtype=np.float32) for n in (width, height))
    slope = rng.normal(0.0, 40.0, 2).astype(np.float32)
    shade = slope[0] * across[None, :] + slope[1] * along[:, None]
    cell = rng.uniform(*_GRAIN_PX)
    coarse = rng.standard_normal(
        (max(int(height / cell), 1), max(int(width / cell), 1)), dtype=np.float32
    ) * np.float32(rng.uniform(0.0, _GRAIN) * rng.random())
    grain = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(colour + (shade + grain)[..., None], dtype=np.float32)


def _colour(rng: np.random.Generator) -> npt.NDArray[np.float32]:
    tint = rng.normal(0.0, _COLOUR, 3) * (rng.random() >= _COLOURLESS)
    return np.clip(rng.uniform(0.0, _WHITE) + tint, 0.0, _WHITE).astype(np.float32)


def _polygon(cover: npt.NDArray[np.uint8], _: npt.NDArray[np.float32], rng: np.random.Generator) -> None:
    import cv2

    count = int(rng.integers(_LEAST_CORNERS, _MOST_CORNERS + 1))
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
    reach = rng.uniform(0.5, 1.0, count)
    half = np.array(cover.shape[::-1]) / 2.0
    points = half + half * np.stack([np.cos(angles), np.sin(angles)], axis=1) * reach[:, None]
    cv2.fillPoly(cover, [np.rint(points).astype(np.int32)], _WHITE, cv2.LINE_AA)


def _ellipse(cover: npt.NDArray[np.uint8], _: npt.NDArray[np.float32], rng: np.random.Generator) -> None:
    import cv2

    height, width = cover.shape
    axes = (max(width // 2 - 1, 1), max(height // 2 - 1, 1))
    turned = float(rng.uniform(-30.0, 30.0))
    cv2.ellipse(cover, (width // 2, height // 2), axes, turned, 0.0, 360.0, _WHITE, -1, cv2.LINE_AA)


def _front(cover: npt.NDArray[np.uint8], colours: npt.NDArray[np.float32], rng: np.random.Generator) -> None:
    """Draw a wall with rows of windows, lit or dark."""
    cover[:] = _WHITE
    height, width = cover.shape
    across, down = (int(one) for one in rng.integers(1, _MOST_WINDOWS + 1, 2))
    share = rng.uniform(*_WINDOW_SHARE, 2)
    glass = _colour(rng)
    x = (np.arange(width) + 0.5) / width * across % 1.0 < share[0]
    y = (np.arange(height) + 0.5) / height * down % 1.0 < share[1]
    colours[y[:, None] & x[None, :]] = glass


def _post(cover: npt.NDArray[np.uint8], _: npt.NDArray[np.float32], rng: np.random.Generator) -> None:
    import cv2

    height, width = cover.shape
    ends = np.rint(rng.random((2, 2)) * (width, height)).astype(int).tolist()
    thick = int(rng.integers(1, 4))
    cv2.line(cover, ends[0], ends[1], _WHITE, thick, cv2.LINE_AA)


def _specks(cover: npt.NDArray[np.uint8], colours: npt.NDArray[np.float32], rng: np.random.Generator) -> None:
    """Draw small patches, each with a shade of its own, with what was there before between them."""
    import cv2

    height, width = cover.shape
    count = 1 + int(width * height / rng.uniform(*_BETWEEN_PX) ** 2)
    middle = rng.random((count, 2)) * (width, height)
    half = 0.5 * np.exp(rng.uniform(np.log(_SPECK_PX[0]), np.log(_SPECK_PX[1]), (count, 2)))
    shade = np.clip(rng.uniform(0.0, _WHITE, (count, 1)) + 0.3 * (_colour(rng) - 0.5 * _WHITE), 0.0, _WHITE)
    ends = np.rint(np.concatenate([middle - half, middle + half - 1.0], axis=1)).astype(int).tolist()
    for (left, top, right, bottom), colour in zip(ends, shade.tolist(), strict=True):
        corners = ((left, top), (max(right, left), max(bottom, top)))
        cv2.rectangle(cover, *corners, _WHITE, -1)
        cv2.rectangle(colours, *corners, colour, -1)
