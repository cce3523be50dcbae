"""Cut-outs of pictures, mirrored, scaled, lit and grained at random, with the boxes that are in them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.io.media.decoders import RgbImage
from jeat_graph_sehn.training.clutter import draw_clutter
from jeat_graph_sehn.training.settings import PictureChanges
from jeat_graph_sehn.training.truth_at import TrueBoxes

#: A box of which less is left in the cut-out, or that is smaller, is neither asked for nor wrong.
LEAST_LEFT, LEAST_PX = 0.4, 2.0
#: Shares of red, green and blue in how bright a pixel is (ITU-R BT.601).
_LUMA = np.array([0.299, 0.587, 0.114], dtype=np.float32)
_GREY, _WHITE, _LEVELS = 114.0, 255.0, 256


class CutOut(NamedTuple):
    """A cut-out: x' = scale · x + left, and so for y; then mirrored, if it is.

    Attributes:
        side: its width and height (px).
        scale: of lengths.
        left: shift (px of the cut-out).
        top: shift (px of the cut-out).
        mirrored: whether left and right are exchanged afterwards.
    """

    side: tuple[int, int]
    scale: float
    left: float
    top: float
    mirrored: bool

    def boxes(self, truth: TrueBoxes) -> tuple[FloatArray, BoolArray]:
        """Return corners (M, 4) within the cut-out, and whether each is ignored (M,)."""
        shift = np.array([self.left, self.top, self.left, self.top])
        whole = truth.corners * self.scale + shift
        if self.mirrored:
            whole[:, [0, 2]] = self.side[0] - whole[:, [2, 0]]
        inside = np.clip(whole, 0.0, [*self.side, *self.side])
        size, left = whole[:, 2:] - whole[:, :2], inside[:, 2:] - inside[:, :2]
        share = left.prod(axis=1) / np.maximum(size.prod(axis=1), 1e-9)
        ignored = truth.ignored | (share < LEAST_LEFT) | (left < LEAST_PX).any(axis=1)
        there = (left > 0.0).all(axis=1)
        return inside[there], ignored[there]


def draw_window(
    rng: np.random.Generator,
    size_px: tuple[int, int],
    side: tuple[int, int],
    truth: TrueBoxes,
    changes: tuple[float, float, float],
    served: float = 1.0,
) -> CutOut:
    """Draw a cut-out.

    Args:
        rng: random numbers.
        size_px: width and height of the picture.
        side: of the cut-out.
        truth: what is in the picture.
        changes: `zoom`, `mirror_share` and `on_box_share` of the settings.
        served: scale of lengths at which the network looks at whole pictures in use.
    """
    zoom, mirror_share, on_box_share = changes
    scale = served * float(np.exp(rng.uniform(-1.0, 1.0) * np.log(zoom)))
    mirrored = bool(rng.random() < mirror_share)
    on_box, place, which = rng.random() < on_box_share, rng.random(2), rng.random()
    wanted = np.flatnonzero(~truth.ignored)
    start = np.zeros(2)
    for axis in range(2):
        spare = size_px[axis] * scale - side[axis]
        start[axis] = place[axis] * spare
        if on_box and len(wanted) and spare > 0.0:
            box = truth.corners[wanted[int(which * len(wanted))]]
            middle = scale * (box[axis] + box[axis + 2]) / 2.0
            start[axis] = np.clip(middle - place[axis] * side[axis], 0.0, spare)
    return CutOut(side, scale, -float(start[0]), -float(start[1]), mirrored)


class LightChange(NamedTuple):
    """How a picture's light and grain are changed.

    Attributes:
        levels: (256,) what each grey level becomes, 0 to 1.
        grey: whether colours are lost.
        sigma: of the noise, where white is 1.
    """

    levels: npt.NDArray[np.float32]
    grey: bool
    sigma: float


def draw_light(rng: np.random.Generator, changes: PictureChanges) -> LightChange:
    """Draw how a picture, or all of a sequence, are lit and grained."""
    gain = float(np.exp(rng.uniform(-1.0, 1.0) * np.log(changes.exposure)))
    power = float(np.exp(rng.uniform(-1.0, 1.0) * np.log(changes.gamma)))
    # There are 256 grey levels: a table of them is a tenth of the work of doing it for each pixel.
    levels = np.clip(np.arange(_LEVELS) / _WHITE * gain, 0.0, 1.0) ** power
    grey = bool(rng.random() < changes.grey_share)
    return LightChange(levels.astype(np.float32), grey, rng.uniform(0.0, changes.noise) / _WHITE)


def cut_out(
    frame: RgbImage,
    window: CutOut,
    rng: np.random.Generator,
    light: LightChange,
    beside: TrueBoxes | None = None,
) -> npt.NDArray[np.float32]:
    """Return the cut-out (3, H, W) of a picture (H, W, 3), lit and grained as drawn, red first, 0 to 1.

    Args:
        frame: the picture.
        window: what is cut out.
        rng: random numbers.
        light: how it is lit and grained.
        beside: what is in the picture; given, shapes that are no vehicles are drawn beside it.
    """
    import cv2

    # OpenCV counts from the middle of the first pixel, boxes from its edge.
    half = 0.5 * (window.scale - 1.0)
    matrix = np.array([[window.scale, 0.0, window.left + half], [0.0, window.scale, window.top + half]])
    warped = cv2.warpAffine(frame, matrix, window.side, flags=cv2.INTER_LINEAR, borderValue=(_GREY,) * 3)
    shown: RgbImage = np.asarray(warped, dtype=np.uint8)
    if beside is not None:
        vehicles, _ = window._replace(mirrored=False).boxes(beside)
        shown = draw_clutter(shown, vehicles, rng)
    values = light.levels[shown]
    if window.mirrored:
        values = values[:, ::-1]
    if light.grey:
        values = np.repeat((values @ _LUMA)[..., None], 3, axis=-1)
    values = values + np.float32(light.sigma) * rng.standard_normal(values.shape, dtype=np.float32)
    return np.ascontiguousarray(np.clip(values, 0.0, 1.0).transpose(2, 0, 1), dtype=np.float32)
