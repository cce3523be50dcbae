"""A calibration pattern that two cameras saw: its corners in both pictures, and the homography they tell.

The pattern lies in or near the road, or far away, at several places. At each place both cameras see it, as
pictures; of events, as pictures of how many there were at each pixel: those of a pattern that blinks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.rig.homography import covariance_of_fit, fit_homography

Picture = npt.NDArray[np.uint8]

CHECKERBOARD, CIRCLES, STAGGERED, CHARUCO = "checkerboard", "circles", "staggered-circles", "charuco"
KINDS = (CHECKERBOARD, CIRCLES, STAGGERED, CHARUCO)
_DICTIONARY = "4X4_50"
_MARKER_SHARE = 0.75  # of a square's side; corners are found again, so that it need not be exact
_LEAST_SIDE, _LEAST_CORNERS = 2, 6

# Corners are found to about this (px); a map that leaves more than this share of the picture's width is none.
_CORNER_PX, _MOST_LEFT = 0.1, 0.01
# The map must be known to this share of the picture's width over all of it.
_MOST_UNSURE = 0.004
# What is left beyond this (px) is reported as places that lie in no one plane.
_ONE_PLANE_PX = 1.5
# Corners of one place have the same error: all together they count as so many points.
_POINTS_OF_A_PLACE = 4
# Within one place corners stay where they are, to this share of the pattern's own extent.
_STILL = 0.02
# OpenCV counts from the middle of the first pixel, boxes from its edge.
_HALF_PX = 0.5
# Small or noisy patterns are looked for in pictures of twice the size, smoothed by so much (px), up to this
# width (px).
_BLURS_PX, _WIDEST_ENLARGED_PX = (0.8, 1.2), 1400
# A corner is sharpened within this share of the distance to the next one.
_OWN_PART = 0.35
# Counts of events are cut at this quantile before they are a picture, for some pixels never rest.
_BRIGHTEST, _BLUR_PX = 0.995, 0.8


class Pattern(NamedTuple):
    """What was held before the cameras.

    Attributes:
        kind: one of `KINDS`.
        columns: inner corners or circles in a row; of `charuco`, squares.
        rows: of them.
        dictionary: of the markers of `charuco`, as OpenCV names it (`4X4_50`).
    """

    kind: str
    columns: int
    rows: int
    dictionary: str = _DICTIONARY

    @staticmethod
    def parse(text: str) -> Pattern:
        """Read `checkerboard:9x6`, `circles:9x6`, `staggered-circles:4x11` or `charuco:8x6[:4X4_50]`.

        Raises:
            DataError: it is none of these.
        """
        kind, _, rest = text.partition(":")
        size, _, dictionary = rest.partition(":")
        columns, _, rows = size.partition("x")
        good = kind in KINDS and columns.isdigit() and rows.isdigit() and (not dictionary or kind == CHARUCO)
        if not good or min(int(columns), int(rows)) < _LEAST_SIDE or int(columns) * int(rows) > 10_000:
            raise DataError(
                "a pattern must read like checkerboard:9x6 (inner corners), circles:9x6, "
                f"staggered-circles:4x11 or charuco:8x6:4X4_50 (squares, markers), not {text!r}"
            )
        if kind in (CHECKERBOARD, CIRCLES) and columns == rows:
            raise DataError(f"{text}: a pattern with as many columns as rows looks the same from four sides")
        found = Pattern(kind, int(columns), int(rows), dictionary or _DICTIONARY)
        if kind == CHARUCO:
            found.board()
        return found

    def points(self, number: IntArray) -> FloatArray:
        """Return where corners (K,) lie on the pattern (K, 2): sides of a square, or distances of circles."""
        columns = self.columns - 1 if self.kind == CHARUCO else self.columns
        row, column = number // columns, number % columns
        across = 2 * column + row % 2 if self.kind == STAGGERED else column
        return np.stack([across, row], axis=1).astype(np.float64)

    def board(self) -> Any:
        """Return the board of markers, for OpenCV.

        Raises:
            DataError: no such dictionary, or one with too few markers.
        """
        import cv2

        number = getattr(cv2.aruco, f"DICT_{self.dictionary}", None)
        if number is None:
            raise DataError(f"no dictionary of markers {self.dictionary!r}: OpenCV knows 4X4_50, 5X5_100, …")
        markers = cv2.aruco.getPredefinedDictionary(number)
        if len(markers.bytesList) < self.columns * self.rows // 2:
            raise DataError(f"{self.dictionary} has too few markers for {self.columns} x {self.rows} squares")
        return cv2.aruco.CharucoBoard((self.columns, self.rows), 1.0, _MARKER_SHARE, markers)


class Corners(NamedTuple):
    """Corners of a pattern in one picture: their numbers (K,) on it, and where they are (K, 2) in px."""

    number: IntArray
    xy: FloatArray


class PatternPlace(NamedTuple):
    """Corners (K, 2) that both cameras saw of the pattern at one place (px), and their numbers (K,) on it."""

    number: IntArray
    first: FloatArray
    second: FloatArray


def find_corners(picture: Picture, pattern: Pattern) -> Corners | None:
    """Find a pattern in a picture (H, W) or (H, W, 3), dark on bright or inverted; None if it is not there.

    Corners are numbered along rows; of all but `charuco` the first may be that of either end of the pattern.
    """
    import cv2

    grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    for scale, one in _scaled(np.ascontiguousarray(grey, dtype=np.uint8)):
        found = _charuco(one, pattern) if pattern.kind == CHARUCO else _grid(one, pattern)
        if found is not None:
            return Corners(found.number, (found.xy + _HALF_PX) / scale)
    return None


def _scaled(grey: Picture) -> Iterator[tuple[int, Picture]]:
    """The picture (H, W) with its scale: as it is, larger and smooth for small patterns, and inverted."""
    import cv2

    yield 1, grey
    if grey.shape[1] <= _WIDEST_ENLARGED_PX:
        for blur in _BLURS_PX:
            smooth = cv2.GaussianBlur(grey, (0, 0), blur)
            yield 2, np.asarray(cv2.resize(smooth, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC), np.uint8)
    yield 1, 255 - grey


def _grid(grey: Picture, pattern: Pattern) -> Corners | None:
    """Corners of a grid, as OpenCV counts pixels."""
    import cv2

    size = (pattern.columns, pattern.rows)
    if pattern.kind == CHECKERBOARD:
        flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
        done, xy = cv2.findChessboardCorners(grey, size, flags=flags)
    else:
        flags = cv2.CALIB_CB_SYMMETRIC_GRID if pattern.kind == CIRCLES else cv2.CALIB_CB_ASYMMETRIC_GRID
        done, xy = cv2.findCirclesGrid(grey, size, flags=flags)
    if not done or xy is None or len(xy) != size[0] * size[1]:
        return None
    places = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    if pattern.kind == CHECKERBOARD:
        places = _sharpened(grey, places, size)
    return Corners(np.arange(len(places)), places)


def _sharpened(grey: Picture, xy: FloatArray, size: tuple[int, int]) -> FloatArray:
    """Find corners (K, 2) again to a fraction of a pixel, each within its own part of the pattern."""
    import cv2

    grid = xy.reshape(size[1], size[0], 2)
    gaps = [np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1)]
    half = max(2, round(_OWN_PART * float(min(gaps))))
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-3)
    found = cv2.cornerSubPix(grey, xy.astype(np.float32).reshape(-1, 1, 2), (half, half), (-1, -1), stop)
    return np.asarray(found, dtype=np.float64).reshape(-1, 2)


def _charuco(grey: Picture, pattern: Pattern) -> Corners | None:
    """Corners between markers that are seen, as OpenCV counts pixels."""
    import cv2

    xy, number, _, _ = cv2.aruco.CharucoDetector(pattern.board()).detectBoard(grey)
    if number is None or len(number) < _LEAST_CORNERS:
        return None
    return Corners(np.asarray(number).ravel().astype(np.int64), np.asarray(xy, float).reshape(-1, 2))


def picture_of_counts(counts: IntArray) -> Picture:
    """Make a picture (H, W) of how many events there were at each pixel (H, W)."""
    import cv2

    most = float(np.quantile(counts, _BRIGHTEST))
    bright = np.clip(counts / max(most, 1.0), 0.0, 1.0) * 255.0
    return np.asarray(cv2.GaussianBlur(bright.astype(np.uint8), (0, 0), _BLUR_PX), dtype=np.uint8)


def corners_of_place(pictures: Iterable[Picture], pattern: Pattern, where: str) -> Corners:
    """Find a pattern that stands still in several pictures of one camera: the median of each corner.

    Raises:
        DataError: it is in none of them, or moves.
    """
    found: list[Corners] = []
    for picture in pictures:
        one = find_corners(picture, pattern)
        if one is not None:
            found.append(one if not found else _turned_like(found[0], one))
    if not found:
        raise DataError(f"no {pattern.kind} of {pattern.columns} x {pattern.rows} is seen", where)
    numbers = np.unique(np.concatenate([one.number for one in found]))
    middle = np.empty((len(numbers), 2))
    spread = 0.0
    for k, number in enumerate(numbers):
        seen = np.concatenate([one.xy[one.number == number] for one in found])
        middle[k] = np.median(seen, axis=0)
        spread = max(spread, float(np.median(np.linalg.norm(seen - middle[k], axis=1))))
    extent = float(np.ptp(middle, axis=0).max())
    if spread > _STILL * extent:
        raise DataError(
            f"the pattern moves ({spread:.1f} px): give a file for each place where it stands", where
        )
    return Corners(numbers, middle)


def same_place(first: Corners, second: Corners, where: str) -> PatternPlace:
    """Pair the corners that two cameras saw of one pattern; they must not be rolled by 90° or more.

    Raises:
        DataError: too few corners are seen by both.
    """
    both, a, b = np.intersect1d(first.number, second.number, return_indices=True)
    if len(both) < _LEAST_CORNERS:
        raise DataError(
            f"{len(both)} corners are seen by both cameras, and {_LEAST_CORNERS} are needed", where
        )
    one = Corners(both, first.xy[a])
    return PatternPlace(both, one.xy, _turned_like(one, Corners(both, second.xy[b])).xy)


def _turned_like(model: Corners, other: Corners) -> Corners:
    """Number a grid from its other end where that lies more like a model of it."""
    if len(model.number) != len(other.number) or not np.array_equal(model.number, other.number):
        return other
    ahead, there = (xy[-1] - xy[0] for xy in (model.xy, other.xy))
    return other if float(ahead @ there) >= 0.0 else Corners(other.number, other.xy[::-1])


def map_of_places(
    places: Sequence[PatternPlace], width: float, own: tuple[float, float]
) -> tuple[PictureMap, list[str]]:
    """Fit the homography from the second camera's corners to the first's.

    Args:
        places: of the pattern.
        width: of the common picture (px).
        own: width and height of the second camera's picture (px).

    Returns:
        The map with covariance, and lines to be reported.

    Raises:
        DataError: the corners tell no map, do not fit one, or tell it near the pattern only.
    """
    first, second = (np.concatenate([getattr(one, name) for one in places]) for name in ("first", "second"))
    way = fit_homography(second, first)
    apart = np.linalg.norm(way.points(second) - first, axis=1)
    left = float(np.sqrt(np.mean(apart**2)))
    if left > _MOST_LEFT * width:
        raise DataError(
            f"no homography fits: {left:.1f} px are left between corners at {len(places)} places; put the "
            "pattern on the road or far away, and let it stand still"
        )
    exact = covariance_of_fit(way, second, first, _CORNER_PX)
    share = len(first) / (_POINTS_OF_A_PLACE * len(places))
    way = PictureMap(exact.matrix, exact.covariance * max(share, 1.0))
    unsure = way.std_px(own)
    if unsure > _MOST_UNSURE * width:
        raise DataError(
            f"the corners tell the map to ± {unsure:.0f} px only over the whole picture: show the pattern at "
            "more places, also near the picture's corners"
        )
    at = "one place" if len(places) == 1 else f"{len(places)} places"
    lines = [
        f"{len(first)} corners of the pattern at {at}, {left:.2g} px left between them; boxes go "
        f"to the common picture to ± {unsure:.2g} px over the whole picture, where they are in the pattern's "
        "plane"
    ]
    if left > _ONE_PLANE_PX:
        lines.append(
            "the places do not lie in one plane: register by traffic, with this rig as --rig, does better"
        )
    return way, lines
