"""Shows a network a picture that is larger than its input in overlapping tiles, and merges their boxes.

Made smaller, small vehicles vanish, and a pixel of the input has more events than in training. In the area
that two tiles share, both see a vehicle; at the edge of one it is cut. So a box that a tile cuts is left to a
tile that sees all of it, and of a vehicle that no tile sees whole the parts are joined: where two tiles see
the same, they have to say the same.
"""

from __future__ import annotations

from itertools import combinations, product
from math import ceil
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.association.overlap import pairwise_iou
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.detection.models.feeding import letterbox_scale, scaled_px
from jeat_graph.detection.models.layouts.record import DecodedBoxes

#: Two neighbours share at least this much of a tile's side: a vehicle as wide is whole in one of them.
_SHARED = 0.125
#: A box that comes so near to an edge behind which the picture goes on is cut by it (px of the input): as far
#: apart as the finest cells of networks of the usual strides, which is how wrong a side can be.
_CUT_PX = 8.0
#: Scale at which the networks that come along learnt recordings of 640 x 384 px: enlarged to 960 x 576. In a
#: world of 1280 x 720 px four tiles at 1.39 found more than at 1 (AP50 86 and 77), in the same time.
_KNOWN_SCALE = 1.5
#: As many tiles as the camera's own size needs.
UNLIMITED = 0


def tiled_scale(size_px: tuple[int, int], side: tuple[int, int], most: int, *, own: bool) -> float:
    """Return the largest scale of lengths at which at most so many tiles show a camera.

    Networks that `train` made are shown it enlarged where the tiles have room, up to what they know.

    Args:
        size_px: width and height of the camera's picture, which is larger than the input.
        side: those of the network's input.
        most: tiles; 0 for as many as the camera's own size needs.
        own: whether `train` made the network.
    """
    largest = _KNOWN_SCALE if own else 1.0
    counts = _counts(size_px, side, largest)
    if most == UNLIMITED:
        most = int(np.prod(_counts(size_px, side, 1.0)))
    scales = [letterbox_scale(size_px, side)]
    for columns, rows in product(range(1, counts[0] + 1), range(1, counts[1] + 1)):
        if columns * rows <= most:
            scales.append(letterbox_scale(size_px, (_reach(columns, side[0]), _reach(rows, side[1]))))
    return min(max(scales), largest)


class Tiling:
    """Where the tiles of a picture lie.

    Args:
        shown_px: width and height of the picture at the scale at which it is shown.
        side: those of the network's input, and so of each tile.

    Attributes:
        canvas_px: width and height of what is cut into tiles: the picture, or the input where that is larger.
        places: (T, 4) left, top, right, bottom of the tiles in it (px).
    """

    def __init__(self, shown_px: tuple[int, int], side: tuple[int, int]) -> None:
        self.canvas_px = (max(shown_px[0], side[0]), max(shown_px[1], side[1]))
        lefts, tops = (_begins(*lengths) for lengths in zip(self.canvas_px, side, strict=True))
        self.places: IntArray = np.array(
            [(left, top, left + side[0], top + side[1]) for top in tops for left in lefts], dtype=np.int64
        )
        border = np.array([0, 0, *self.canvas_px])
        self._inner: BoolArray = self.places != border

    def __len__(self) -> int:
        return len(self.places)

    def cut(self, canvas: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
        """Return the tiles of a canvas (..., height, width), each for itself in memory."""
        if len(self) == 1:
            return [canvas]
        return [
            np.ascontiguousarray(canvas[..., top:bottom, left:right])
            for left, top, right, bottom in self.places.tolist()
        ]

    def together(self, found: list[DecodedBoxes], overlap: float) -> DecodedBoxes:
        """Return boxes (px of the canvas), each of a tile that sees it well; some may be of one thing still.

        Args:
            found: of each tile.
            overlap: two parts of a vehicle that no tile sees whole are joined where they overlap by more
                (intersection over union) in the area that both tiles see.
        """
        tile = np.repeat(np.arange(len(self)), [len(one.scores) for one in found])
        shift = np.tile(self.places[:, :2], 2)[tile]
        corners: FloatArray = np.concatenate([one.corners for one in found]) + shift.astype(float)
        scores = np.concatenate([one.scores for one in found])
        classes = np.concatenate([one.classes for one in found])
        depth = self._depths(corners)
        rows = np.arange(len(tile))
        own = depth[rows, tile]
        depth[rows, tile] = -np.inf
        other = depth.max(axis=1, initial=-np.inf)
        cut = own < _CUT_PX
        # Half its size farther in: both tiles would have to be as wrong for each to leave it to the other.
        size = (corners[:, 2:] - corners[:, :2]).max(axis=1, initial=0.0)
        stays = ~((other >= _CUT_PX) & (cut | (other > own + _CUT_PX + size / 2.0)))
        spreads = [one.spreads for one in found if one.spreads is not None]
        # A network that has distinguished its boxes has done so in each tile for itself.
        every = DecodedBoxes(corners, scores, classes, False, np.concatenate(spreads) if spreads else None)
        return self._joined(every.taken(stays), tile[stays], np.flatnonzero(cut[stays]), overlap)

    def _depths(self, corners: FloatArray) -> FloatArray:
        """Return how far within each tile boxes (M, 4) lie, (M, T) (px).

        Edges of the picture do not count.
        """
        inwards = np.array([1.0, 1.0, -1.0, -1.0])
        distance = inwards * (corners[:, None] - self.places[None])
        nearest: FloatArray = np.where(self._inner[None], distance, np.inf).min(axis=2)
        return nearest

    def _joined(self, boxes: DecodedBoxes, tile: IntArray, cut: IntArray, overlap: float) -> DecodedBoxes:
        """Join the parts of what no tile sees whole; `cut` are their rows."""
        group = np.arange(len(tile))
        for a, b in combinations(cut.tolist(), 2):
            if tile[a] != tile[b] and boxes.classes[a] == boxes.classes[b]:
                both = boxes.corners[[a, b]]
                if _agree(both, self.places[tile[[a, b]]], overlap):
                    group[group == group[b]] = group[a]
        outermost, leads = [], []
        for one in np.unique(group).tolist():
            rows = np.flatnonzero(group == one)
            part = boxes.corners[rows]
            outermost.append(rows[[*part[:, :2].argmin(axis=0), *part[:, 2:].argmax(axis=0)]])
            leads.append(rows[np.argmax(boxes.scores[rows])])
        of_side = np.array(outermost, dtype=np.int64).reshape(-1, 4)
        sides = np.arange(4)
        joined = boxes.taken(np.array(leads, dtype=np.int64))
        spreads = None if boxes.spreads is None else boxes.spreads[of_side, sides]
        return joined._replace(corners=boxes.corners[of_side, sides], spreads=spreads)


def _agree(both: FloatArray, places: IntArray, overlap: float) -> bool:
    """Return whether two boxes (2, 4) of two tiles are alike in the area that both tiles see."""
    low, high = places[:, :2].max(axis=0), places[:, 2:].min(axis=0)
    first, last = np.clip(both[:, :2], low, high), np.clip(both[:, 2:], low, high)
    sides = last - first
    if (sides <= 0.0).any():
        return False
    seen = np.hstack([first, sides]).astype(float)
    return bool(pairwise_iou(seen[:1], seen[1:])[0, 0] > overlap)


def _counts(size_px: tuple[int, int], side: tuple[int, int], scale: float) -> list[int]:
    """Return how many columns and rows of tiles a camera needs at a scale."""
    shown = scaled_px(size_px, scale)
    return [_count(*lengths) for lengths in zip(shown, side, strict=True)]


def _shared_px(side: int) -> int:
    return round(_SHARED * side)


def _reach(count: int, side: int) -> int:
    """Return how far so many tiles reach at most (px)."""
    return count * side - (count - 1) * _shared_px(side)


def _count(length: int, side: int) -> int:
    """Return how many tiles a length needs (px)."""
    shared = _shared_px(side)
    return max(ceil((length - shared) / (side - shared)), 1)


def _begins(length: int, side: int) -> list[int]:
    """Return where the tiles of a length begin (px), evenly from one end to the other."""
    spare = np.linspace(0.0, length - side, _count(length, side))
    return [int(one) for one in np.round(spare)]
