"""Motion of a camera from its pictures: how the corners that lie outside the boxes go.

Corners of a key picture (Shi and Tomasi, *Good features to track*, CVPR 1994) are followed into each picture
by pyramids of Lucas and Kanade, there and back; those that come back to where they were, outside all boxes,
are fitted by one similarity, first by RANSAC, then by reweighted least squares with Student's t. Its pose
against the key picture does not drift while that lasts: a camera stands still while the pose is none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.config.fields import Section, flag, number
from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.scan import Scan
from jeat_graph.io.media.decoders import RgbImage

Grey = npt.NDArray[np.uint8]

# Corners: how many, how good against the best one, how far apart (px of the working picture).
_CORNERS, _QUALITY, _APART_PX = 120, 0.01, 10.0
# Half a window of Lucas and Kanade (px), and levels of its pyramid above the picture.
_WINDOW_PX, _LEVELS = 10, 3
# A corner that is followed there and back ends where it began, within this (px).
_RETURN_PX = 0.5
# Inliers of RANSAC (px): of a picture that moves as one, or of one with depth, which is tried next.
_INLIER_PX = (1.0, 3.0)
# So many corners at least must agree, so large a share of those found, spread over so much of either side.
_LEAST, _LEAST_SHARE, _LEAST_SPREAD = 15, 0.5, 0.08
# What is looked at is what roots of grey levels, whose noise is the same in light and shade, have more than
# their neighbourhood of this deviation (working px), times so many levels.
_SMOOTH_PX, _DETAIL_GAIN, _MIDDLE = 6.0, 24.0, 128.0
# Boxes are taken larger by this share on each side: detectors cut, and shadows go along.
_MARGIN = 0.1
# Degrees of freedom of t, reweightings, and the least error of a corner (px). Corners near each other err
# the same, so many count for one, and all of them by so much (px): what interpolation between pixels costs.
_DEGREES, _PASSES, _LEAST_ERROR_PX, _CORRELATED, _COMMON_PX = 4.0, 4, 0.05, 4.0, 0.03
# A camera moves if the corners of its picture do by more than this (px), and by so many standard deviations;
# after that for so long (s) every motion is reported.
_STILL_PX, _STILL_DEVIATIONS, _MOVES_S = 0.1, 4.0, 5.0
# A key picture is left when so few of its corners are found, when the picture has gone this share of its
# width or grown so much, or after so long (s) where the picture is not where it was.
_KEY_FOUND, _KEY_MOVED, _KEY_GROWN, _KEY_S = 0.5, 0.15, 0.1, 10.0


@dataclass(frozen=True)
class CameraSettings(Section):
    """Whether, and how, the motion of the camera is found in its pictures."""

    follow: bool = flag(True, "whether networks tell how the camera moves")
    width_px: int = number(480, "px", "pictures are looked at in this width", 64, 4096)


class Pose(NamedTuple):
    """A picture against its key picture: z goes to `turn` z + `shift`, with z = x + i y (working px).

    Attributes:
        turn: growth and rotation.
        shift: px.
        centre: of the corners in the key picture (px), about which errors are uncorrelated.
        variance: (2,) of the shift of the centre, by axis (px²), and of the turn.
    """

    turn: complex
    shift: complex
    centre: complex
    variance: tuple[float, float]

    def of(self, z: Any) -> Any:
        """Return where points of the key picture lie."""
        return self.turn * z + self.shift


_KEY = Pose(1.0 + 0.0j, 0.0j, 0.0j, (0.0, 0.0))


class _Key(NamedTuple):
    grey: Grey
    corners: npt.NDArray[np.float32]
    t: float


class CameraFlow:
    """Tells how a camera moved from picture to picture.

    Args:
        settings: width in which pictures are looked at.
    """

    def __init__(self, settings: CameraSettings | None = None) -> None:
        self._settings = settings or CameraSettings()
        self._key: _Key | None = None
        self._pose = _KEY
        self._step = 1.0 + 0.0j, 0.0j  # the last motion, with which the camera may go on
        self._t = 0.0
        self._moves_until = -np.inf

    def __call__(self, frame: RgbImage, scan: Scan) -> Scan:
        """Return the scan of a picture with the camera's motion since the picture before.

        A camera of which it is not sure that it moves has no motion, nor has a picture that shows too little.

        Args:
            frame: (H, W, 3) red, green, blue; 8 bit.
            scan: what was found in it.
        """
        if not self._settings.follow:
            return scan
        grey, scale = self._working(frame)
        seen = _outside(grey.shape, scan.boxes * scale)
        key, t, before = self._key, scan.t, self._t
        self._t = t
        if key is None or key.grey.shape != grey.shape or t <= before:
            self._begin(grey, seen, t)
            return scan
        pose, found = self._find(key, grey, seen)
        if pose is None:
            self._begin(grey, seen, t)
            return scan
        motion = self._motion(pose, grey.shape, t, t - before)
        if self._leaves(pose, grey.shape, t - key.t, found):
            self._begin(grey, seen, t)
        return scan if motion is None else replace(scan, camera_motion=_in_picture(motion, scale))

    def _working(self, frame: RgbImage) -> tuple[Grey, float]:
        import cv2

        scale = min(self._settings.width_px / frame.shape[1], 1.0)
        grey = cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY)
        if scale < 1.0:
            size = round(frame.shape[1] * scale), max(round(frame.shape[0] * scale), 1)
            grey = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
        return _detail(np.asarray(grey, dtype=np.uint8)), scale

    def _begin(self, grey: Grey, seen: BoolArray, t: float) -> None:
        """Take a picture for the key picture of those that follow."""
        import cv2

        mask = seen.astype(np.uint8)
        corners = cv2.goodFeaturesToTrack(grey, _CORNERS, _QUALITY, _APART_PX, mask=mask)
        none = np.zeros((0, 1, 2), dtype=np.float32)
        self._key = _Key(grey, none if corners is None else np.asarray(corners, dtype=np.float32), t)
        self._pose = _KEY

    def _find(self, key: _Key, grey: Grey, seen: BoolArray) -> tuple[Pose | None, int]:
        """Return the pose of a picture, None where it does not tell, and the number of corners found."""
        import cv2

        if len(key.corners) < _LEAST:
            return None, 0
        turn, shift = self._step
        guess = _points(turn * self._pose.of(_complex(key.corners)) + shift)
        options: dict[str, Any] = {
            "winSize": (2 * _WINDOW_PX + 1, 2 * _WINDOW_PX + 1),
            "maxLevel": _LEVELS,
            "flags": cv2.OPTFLOW_USE_INITIAL_FLOW,
        }
        there, ok, _ = cv2.calcOpticalFlowPyrLK(key.grey, grey, key.corners, guess.copy(), **options)
        start = (key.corners + there - guess).astype(np.float32)
        back, again, _ = cv2.calcOpticalFlowPyrLK(grey, key.grey, there, start, **options)
        good = (ok.ravel() == 1) & (again.ravel() == 1)
        good &= np.linalg.norm((back - key.corners).reshape(-1, 2), axis=1) < _RETURN_PX
        after = np.asarray(there, dtype=np.float32).reshape(-1, 2)
        good &= _is_seen(after, seen)
        count = int(good.sum())
        if count < _LEAST:
            return None, count
        return _fit(key.corners[good].reshape(-1, 2), after[good], grey.shape[1]), count

    def _motion(self, pose: Pose, shape: tuple[int, ...], t: float, span_s: float) -> FloatArray | None:
        """Return the motion (11,) from the picture before to one of this pose (working px)."""
        if _is_moved(pose, shape):
            self._moves_until = t + _MOVES_S
        if t > self._moves_until:
            self._pose, self._step = _KEY, (1.0 + 0.0j, 0.0j)
            return None
        before = self._pose
        turn = pose.turn / before.turn
        shift = pose.shift - turn * before.shift
        self._pose, self._step = pose, (turn, shift)
        centre = before.of(pose.centre)
        moved = turn * centre + shift - centre
        by_shift = (
            pose.variance[0] + before.variance[0] + before.variance[1] * abs(pose.centre - before.centre) ** 2
        )
        by_turn = pose.variance[1] + before.variance[1]
        return np.array(
            [
                *(span_s, centre.real, centre.imag, moved.real, moved.imag, turn.real - 1.0, turn.imag),
                *(by_shift, by_shift, by_turn, by_turn),
            ]
        )

    def _leaves(self, pose: Pose, shape: tuple[int, ...], age_s: float, found: int) -> bool:
        """Whether another picture is to be the key picture from now on."""
        assert self._key is not None
        few = found < _KEY_FOUND * len(self._key.corners)
        far = float(np.abs(_going(pose, shape)).max()) > _KEY_MOVED * shape[1]
        old = age_s > _KEY_S and self._pose is not _KEY
        return few or far or old or abs(pose.turn - 1.0) > _KEY_GROWN


def _fit(before: npt.NDArray[np.float32], after: npt.NDArray[np.float32], width: int) -> Pose | None:
    """Fit a similarity to corners (N, 2); None where too few agree, or all are in one place."""
    import cv2

    for most_px in _INLIER_PX:
        _, inlier = cv2.estimateAffinePartial2D(
            before, after, method=cv2.RANSAC, ransacReprojThreshold=most_px, maxIters=500, confidence=0.995
        )
        agree = np.zeros(len(before), dtype=bool) if inlier is None else inlier.ravel() == 1
        enough = agree.sum() >= max(_LEAST, _LEAST_SHARE * len(before))
        if enough and before[agree].std(axis=0).max() >= _LEAST_SPREAD * width:
            return similarity(_complex(before[agree]), _complex(after[agree]))
    return None


def similarity(before: npt.NDArray[np.complex128], after: npt.NDArray[np.complex128]) -> Pose:
    """Fit after = turn before + shift by reweighted least squares, with errors of Student's t.

    Args:
        before: (N,) points x + i y (px).
        after: (N,) where they went.
    """
    pose, weight = _weighted_similarity(before, after, np.ones(len(before)))
    for _ in range(_PASSES - 1):
        pose, weight = _weighted_similarity(before, after, weight)
    return pose


def _weighted_similarity(
    before: npt.NDArray[np.complex128], after: npt.NDArray[np.complex128], weight: FloatArray
) -> tuple[Pose, FloatArray]:
    """Fit with weights (N,); returns the weights too that the errors give the points."""
    total = weight.sum()
    centre, to = (weight @ before) / total, (weight @ after) / total
    spread = float(weight @ np.abs(before - centre) ** 2)
    turn = complex((weight @ ((after - to) * np.conj(before - centre))) / spread)
    error2 = np.abs(after - to - turn * (before - centre)) ** 2
    # Of one axis; two axes of N points less four unknowns.
    var = float(max((weight @ error2) / max(2.0 * len(before) - 4.0, 1.0), _LEAST_ERROR_PX**2))
    by_shift = _CORRELATED * var / float(total) + _COMMON_PX**2
    pose = Pose(turn, complex(to - turn * centre), complex(centre), (by_shift, _CORRELATED * var / spread))
    return pose, np.asarray((_DEGREES + 2.0) / (_DEGREES + error2 / var), dtype=np.float64)


def _going(pose: Pose, shape: tuple[int, ...]) -> npt.NDArray[np.complex128]:
    """Return how far the corners (4,) of the key picture have gone (px)."""
    height, width = shape
    corner = np.array([0.0, width, 1j * height, width + 1j * height])
    return np.asarray(pose.of(corner) - corner)


def _is_moved(pose: Pose, shape: tuple[int, ...]) -> bool:
    """Whether a picture is surely not where its key picture is."""
    height, width = shape
    corner = np.array([0.0, width, 1j * height, width + 1j * height])
    std = np.sqrt(pose.variance[0] + pose.variance[1] * np.abs(corner - pose.centre) ** 2)
    return bool((np.abs(_going(pose, shape)) > np.maximum(_STILL_PX, _STILL_DEVIATIONS * std)).any())


def _detail(grey: Grey) -> Grey:
    """Return what a picture has more or less than its neighbourhood: what lies there, not the light on it.

    The cones of headlights that sweep a dark road are smooth, and the road in them does not move with them.
    """
    import cv2

    root = np.sqrt(grey.astype(np.float32))
    more = root - cv2.GaussianBlur(root, (0, 0), _SMOOTH_PX)
    return np.asarray(np.clip(_MIDDLE + _DETAIL_GAIN * more, 0.0, 255.0), dtype=np.uint8)


def _outside(shape: tuple[int, ...], boxes: FloatArray) -> BoolArray:
    """Return where (H, W) there is no box (M, 4): left, top, width, height (px)."""
    seen = np.ones(shape, dtype=bool)
    for left, top, width, height in boxes.tolist():
        x, y = _MARGIN * width, _MARGIN * height
        rows = slice(max(int(top - y), 0), max(int(np.ceil(top + height + y)), 0))
        seen[rows, max(int(left - x), 0) : max(int(np.ceil(left + width + x)), 0)] = False
    return seen


def _is_seen(points: npt.NDArray[np.float32], seen: BoolArray) -> BoolArray:
    """Return which points (N, 2) lie in the picture, outside the boxes."""
    x, y = np.round(points).astype(np.int64).T
    inside = (x >= 0) & (y >= 0) & (x < seen.shape[1]) & (y < seen.shape[0])
    inside[inside] = seen[y[inside], x[inside]]
    return np.asarray(inside, dtype=np.bool_)


def _in_picture(motion: FloatArray, scale: float) -> FloatArray:
    """Return a motion (11,) of the working picture in px of the picture."""
    out = motion.copy()
    out[1:5] /= scale
    out[7:9] /= scale**2
    return out


def _complex(points: npt.NDArray[np.float32]) -> npt.NDArray[np.complex128]:
    flat = points.reshape(-1, 2).astype(np.float64)
    return flat[:, 0] + 1j * flat[:, 1]


def _points(z: npt.NDArray[np.complex128]) -> npt.NDArray[np.float32]:
    return np.stack([z.real, z.imag], axis=1).astype(np.float32).reshape(-1, 1, 2)
