"""Finds what moves in the pictures of a camera that stands still; needs no training.

The background is the median of pictures of the first seconds, pixel by pixel, and then follows slowly, one
grey level at a time. A pixel that differs from it by several times its own noise is foreground; foreground
pixels that lie near one another are one detection. A change of the whole picture's brightness is taken off
first.

The running median is the Σ-Δ filter of Manzanera and Richefeu, "A new motion detection algorithm based on Σ-Δ
background estimation" (2007); the pictures are compared by OpenCV.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from jeat_graph.core import detection as core
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.detection.components import Components, measured, without_inner
from jeat_graph.detection.linking import linked, marked_pixels
from jeat_graph.detection.memory import CloudMemory
from jeat_graph.detection.settings import PictureSettings
from jeat_graph.io.media.decoders import RgbImage

# Standard deviation of a normal error, from its median absolute deviation.
_SIGMA_PER_MAD = 1.4826
_BLUR_PX = 3
_GREY = 255
# Two pictures differ by less, a change of brightness included.
_BEYOND = 3 * _GREY
# A picture may be so many times as noisy as those that the background was made of (and one grey level).
_MOST_NOISE = 3.0


class PictureDetector:
    """Turns pictures, one after the other, into scans.

    Args:
        sensor: name of the sensor in the scans.
        settings: how.
    """

    def __init__(self, sensor: str = "rgb", settings: PictureSettings | None = None) -> None:
        self.sensor = sensor
        self.settings = settings or PictureSettings()
        self._waiting: list[tuple[float, npt.NDArray[np.uint8]]] = []
        self._background: npt.NDArray[np.uint8] | None = None
        self._limit: npt.NDArray[np.int16] = np.zeros((0, 0), dtype=np.int16)
        self._most_noise = math.inf
        self._adapted_s = -math.inf
        self._last_s = -math.inf
        self._memory: CloudMemory | None = None
        self._link_px = self._near_px = 2

    @property
    def ready(self) -> bool:
        """Whether the background is known."""
        return self._background is not None

    def prime(self, frames: Sequence[RgbImage]) -> None:
        """Take the background from pictures, as many as there are, spread over some seconds.

        Raises:
            DataError: fewer than three, or of different sizes.
        """
        self._learn([_grey(frame) for frame in frames])

    def _learn(self, greys: list[npt.NDArray[np.uint8]]) -> None:
        """Take the background from grey pictures (H, W)."""
        if len(greys) < 3 or any(grey.shape != greys[0].shape for grey in greys):
            raise DataError("the background needs at least three pictures of one size")
        stack = np.stack(greys)
        middle, mad = core.middle_and_spread(stack)
        self._background = np.rint(middle).astype(np.uint8)
        noise = _SIGMA_PER_MAD * mad
        # Differences are whole numbers: larger than a limit is larger than the whole number below it.
        self._limit = np.minimum(self.settings.sigmas * noise, _BEYOND).astype(np.int16)
        self._most_noise = _MOST_NOISE * float(np.median(noise)) + 1.0
        height, width = self._background.shape
        diagonal = math.hypot(width, height)
        self._link_px = max(2, round(self.settings.link_share * diagonal))
        self._near_px = max(2, round(self.settings.near_share * diagonal))

    def __call__(self, frame: RgbImage, t: float) -> Scan | None:
        """Return what moves in a picture.

        Args:
            frame: (H, W, 3) red, green, blue, or (H, W) grey; 8 bit.
            t: when it was taken (s), later than the one before.

        Returns:
            The scan; None while the background is not known: nobody has looked then.

        Raises:
            DataError: a picture of another size than those before, or a time that does not ascend.
        """
        if not t > self._last_s:
            raise DataError(f"a picture at {t:g} s follows one at {self._last_s:g} s")
        grey = _grey(frame)
        shape = self._waiting[0][1].shape if self._waiting else grey.shape
        if grey.shape != (shape if self._background is None else self._background.shape):
            raise DataError(
                f"a picture of {grey.shape[1]} x {grey.shape[0]} px is not of the size of the first"
            )
        step_s = t - self._last_s
        self._last_s = t
        if self._background is None and not self._warm_up(grey, t):
            return None
        marks = self._foreground(grey, t)
        if marks is None:
            return None
        if self._memory is None and math.isfinite(step_s):
            steps = max(1, round(self.settings.apart_s / step_s)), round(self.settings.pieces_s / step_s)
            self._memory = CloudMemory(self._near_px, *steps)
        found = self._groups(marks)
        scores = 1.0 - np.exp(-found.pixels / self.settings.certain_pixels)
        return Scan(t, self.sensor, found.boxes, scores)

    def _warm_up(self, grey: npt.NDArray[np.uint8], t: float) -> bool:
        """Collect pictures until the background can be made of them."""
        apart_s = self.settings.warm_up_s / self.settings.samples
        if not self._waiting or t - self._waiting[-1][0] >= apart_s:
            self._waiting.append((t, grey))
        if len(self._waiting) < 3 or t - self._waiting[0][0] < self.settings.warm_up_s:
            return False
        self._learn([one for _, one in self._waiting])
        self._waiting = []
        return True

    def _foreground(self, grey: npt.NDArray[np.uint8], t: float) -> npt.NDArray[np.uint8] | None:
        """Mark the pixels (H, W) that are foreground; None where the whole picture has changed."""
        assert self._background is not None
        settings = self.settings
        brighter, deviation = core.usual_difference(grey, self._background)
        common = min(_SIGMA_PER_MAD * deviation, self._most_noise)  # another scene is no noise
        # As precise as the limits, which are rounded down, too.
        level = float(np.float32(max(settings.least_contrast, settings.sigmas * common)))
        limit = int(min(level, float(_BEYOND)))
        marks, number = core.mark_different(grey, self._background, brighter, limit, self._limit)
        if t - self._adapted_s >= settings.adapt_s:
            self._adapted_s = t
            self._background += (grey > self._background).astype(np.uint8)
            self._background -= (grey < self._background).astype(np.uint8)
        if number / marks.size > settings.most_share:
            self._background, self._memory = None, None
            return None
        return marks

    def _groups(self, marks: npt.NDArray[np.uint8]) -> Components:
        settings = self.settings
        count, marked = linked(marked_pixels(marks), self._link_px)
        if self._memory is not None:
            count, marked = self._memory.relabel(count, marked)
        found = measured(count, marked, settings.trim_share)
        large = (found.boxes[:, 2:] >= settings.least_side_px).all(axis=1)
        found = found.take(large & (found.pixels >= settings.least_pixels))
        found = found.take(without_inner(found, settings.inside_share))
        if self._memory is not None:
            self._memory.remember(found.boxes)
        return found


def _grey(frame: RgbImage) -> npt.NDArray[np.uint8]:
    """Return a picture's brightness (H, W), slightly blurred against noise."""
    import cv2

    grey = frame if frame.ndim == 2 else cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY)
    return np.asarray(cv2.blur(grey, (_BLUR_PX, _BLUR_PX)), dtype=np.uint8)
