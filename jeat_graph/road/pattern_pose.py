"""A second camera over the road, from a pattern of known size that it and a calibrated first one saw.

The first camera's file says where it is over the road. The pattern at several places, tilted in several
ways, tells the second one's focal length and how it stands beside the first; so it is over the road, too, and
boxes go from picture to picture with parallax.

References:
    Zhang, *A flexible new technique for camera calibration*, PAMI 22, 2000.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.rig.pattern import Pattern, PatternPlace
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.camera_map import map_between

#: Fewer places tell no focal length that can be checked by leaving one out.
LEAST_PLACES = 4
# Corners further from where the cameras say (rms, px) are of a pattern that moved, or of another size.
_MOST_LEFT_PX = 2.0
# The map must be known to this share of the common picture's width.
_MOST_UNSURE = 0.004
_UNDETERMINED = "the places do not tell the second camera"
_GRID = 6
_TALL_PX = 40.0  # of the boxes by which maps are compared


def camera_by_pattern(
    places: Sequence[PatternPlace], pattern: Pattern, side_m: float, first: RoadCamera, size: tuple[int, int]
) -> tuple[RoadCamera, float]:
    """Find the second camera.

    Args:
        places: corners that both cameras saw.
        pattern: what was seen.
        side_m: side of its squares, or distance of its circles (m).
        first: the calibrated camera.
        size: width and height of the second's picture (px).

    Returns:
        The second camera in the road's axes, and what is left between corners (rms, px).

    Raises:
        DataError: the places do not tell it.
    """
    import cv2

    board = [
        np.column_stack([pattern.points(one.number) * side_m, np.zeros(len(one.number))]).astype(np.float32)
        for one in places
    ]
    # OpenCV counts from the middle of the first pixel, these cameras from its edge: the principal point alone
    # tells the difference, so that the corners are left as they are.
    ours, theirs = ([getattr(one, name).astype(np.float32) for one in places] for name in ("first", "second"))
    K1 = np.array([[first.fx, 0.0, first.cx], [0.0, first.fy, first.cy], [0.0, 0.0, 1.0]])
    bent = np.array([first.k1, first.k2, 0.0, 0.0, 0.0])
    lens = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3
    guess = np.array([[size[0], 0.0, 0.5 * size[0]], [0.0, size[0], 0.5 * size[1]], [0.0, 0.0, 1.0]])
    try:
        _, K2, bent2, _, _ = cv2.calibrateCamera(
            board, theirs, size, guess, None, flags=lens | cv2.CALIB_USE_INTRINSIC_GUESS
        )
        left, _, _, _, _, R, T, _, _ = cv2.stereoCalibrate(
            board, ours, theirs, K1, bent, K2, bent2, size, flags=cv2.CALIB_FIX_INTRINSIC
        )
    except cv2.error:
        raise DataError(f"{_UNDETERMINED}: tilt the pattern at each in another way") from None
    k = np.asarray(bent2).ravel()
    try:
        second = RoadCamera(
            *(size[0], size[1], float(K2[0, 0]), float(K2[1, 1]), float(K2[0, 2]), float(K2[1, 2])),
            *(float(k[0]), 0.0),
            rotation=R @ first.rotation,
            position=first.position - first.rotation.T @ R.T @ np.asarray(T).ravel(),
        )
    except DataError as error:
        raise DataError(f"{_UNDETERMINED}: {error.message}") from None
    return second, float(left)


def map_by_pattern(
    places: Sequence[PatternPlace], pattern: Pattern, side_m: float, first: RoadCamera, size: tuple[int, int]
) -> tuple[PictureMap, list[str]]:
    """Find the map with parallax from the second camera's picture to the first's, and how sure it is.

    Its uncertainty is how much it changes when each place is left out (the jackknife), and what no matrix can
    do. Arguments are those of `camera_by_pattern`.

    Returns:
        The map with covariance, and lines to be reported.

    Raises:
        DataError: the places do not tell the second camera, or not well enough.
    """
    if len(places) < LEAST_PLACES:
        raise DataError(
            f"the pattern was seen at {len(places)} places, and {LEAST_PLACES} are needed beside --camera"
        )
    second, left = camera_by_pattern(places, pattern, side_m, first, size)
    if left > _MOST_LEFT_PX:
        raise DataError(
            f"{left:.1f} px are left between corners and cameras: did the pattern move, is --pattern-side "
            "right, and the camera's file?"
        )
    way, shape_px = map_between(second, first)
    without = []
    for k in range(len(places)):
        other, _ = camera_by_pattern([*places[:k], *places[k + 1 :]], pattern, side_m, first, size)
        without.append(_moved(map_between(other, first)[0], size))
    count = len(places)
    apart = np.stack(without) - np.mean(without, axis=0)
    good = np.isfinite(apart).all(axis=(0, 2))
    if not good.any():
        raise DataError(f"{_UNDETERMINED}: show the pattern at more of them")
    unsure = float(np.sqrt((count - 1) / count * (apart[:, good] ** 2).sum(axis=0).mean()))
    if unsure > _MOST_UNSURE * first.width:
        raise DataError(
            f"the places tell the map to ± {unsure:.0f} px only: show the pattern at more places, near and "
            "far, each tilted in another way"
        )
    covariance = np.zeros((11, 11))
    covariance[2, 2] = covariance[6, 6] = shape_px**2 + unsure**2
    baseline = float(np.linalg.norm(second.position - first.position))
    lines = [
        f"a focal length of {second.fx:.1f} px, {baseline:.3f} m beside the other camera, by the pattern at "
        f"{count} places ({left:.2g} px left between corners); boxes go to the common picture to "
        f"± {unsure:.2g} px, with parallax"
    ]
    return PictureMap(way.matrix, covariance), lines


def _moved(way: PictureMap, size: tuple[int, int]) -> FloatArray:
    """Where points (N, 2) spread over the second's picture go."""
    x, y = np.meshgrid((np.arange(_GRID) + 0.5) / _GRID * size[0], (np.arange(_GRID) + 0.5) / _GRID * size[1])
    return way.points(np.stack([x.ravel(), y.ravel()], axis=1), _TALL_PX)
