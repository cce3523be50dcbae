"""What a layout of a network's outputs is, and what is known of a network when its layout is looked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.detection.models.exports import Export
from jeat_graph.detection.models.onnx_head import Port

#: Sides of an output with a row for each box: batch, rows, numbers.
ROWS = 3
#: Name of an output that may stand beside a layout's own: of each box standard deviations of its left, top,
#: right and bottom side (px of the input), [1, 4, N] in the order of the boxes.
SPREADS = "spreads"
#: A network's outputs by name, in the order of the file.
Outputs = Mapping[str, npt.NDArray[Any]]
_IMAGENET_MEAN, _IMAGENET_STD = (123.675, 116.28, 103.53), (58.395, 57.12, 57.375)
_WHITE = 255.0


class DecodedBoxes(NamedTuple):
    """Boxes in the network's input.

    Attributes:
        corners: (M, 4) left, top, right, bottom (px of the input; of the picture where the network gets
            the picture's size).
        scores: (M,) 0 to 1.
        classes: (M,) number of the class.
        distinct: whether no two boxes are of one thing, so that none are to be suppressed.
        spreads: (M, 4) standard deviations of left, top, right and bottom (px of the input); None where the
            network does not give them.
    """

    corners: FloatArray
    scores: FloatArray
    classes: IntArray
    distinct: bool
    spreads: FloatArray | None = None

    def taken(self, rows: IntArray | BoolArray) -> DecodedBoxes:
        """Return some of the boxes."""
        spreads = None if self.spreads is None else self.spreads[rows]
        return DecodedBoxes(self.corners[rows], self.scores[rows], self.classes[rows], self.distinct, spreads)


class Fit(IntEnum):
    """How well a layout goes with what is known of a network; the best one is taken."""

    #: It contradicts the notes or the shapes.
    NO = 0
    #: Nothing speaks against it, and nothing for it: it is taken only if the user asks for it.
    POSSIBLE = 1
    #: The names of the outputs say so.
    NAMES = 2
    #: The outputs have its form.
    FORM = 3
    #: Every side of the outputs is what it would be.
    EXACT = 4
    #: The notes of the file say so, and the shapes agree.
    NOTES = 5


class Feed(NamedTuple):
    """How pictures become input.

    Attributes:
        rgb: whether red comes first; else blue.
        fit: `letterbox`, `letterbox-centre` or `stretch`.
        scale: a grey level is multiplied by it,
        mean: then this is taken off, in the order of the colours,
        std: and it is divided by this.
        pad: grey level of letterboxes.
    """

    rgb: bool
    fit: str
    scale: float
    mean: tuple[float, ...] = (0.0, 0.0, 0.0)
    std: tuple[float, ...] = (1.0, 1.0, 1.0)
    pad: float = 114.0

    def __str__(self) -> str:
        order = "RGB" if self.rgb else "BGR"
        shift = f", mean {list(self.mean)}, std {list(self.std)}" if any(self.mean) else ""
        return f"{order}, {self.fit}, scale {self.scale:.4g}{shift}"

    @property
    def words(self) -> str:
        """Say the same for people."""
        order = "RGB" if self.rgb else "BGR"
        levels = "0 to 255" if self.scale == 1.0 else "0 to 1"
        shift = ", less mean and deviation of ImageNet" if any(self.mean) else ""
        fit = {
            "letterbox": "letterbox",
            "letterbox-centre": "letterbox in the middle",
            "stretch": "stretched",
        }
        return f"{order} {levels}{shift}, {fit[self.fit]}"


#: Blue first, 0 to 255, filled up at the right and below; stretched, less ImageNet's mean.
BGR_LETTERBOX = Feed(rgb=False, fit="letterbox", scale=1.0)
BGR_IMAGENET = Feed(rgb=False, fit="stretch", scale=1.0, mean=_IMAGENET_MEAN[::-1], std=_IMAGENET_STD[::-1])
#: Red first, 0 to 1: filled up on all sides, stretched, or stretched and less ImageNet's mean.
RGB_LETTERBOX = Feed(rgb=True, fit="letterbox-centre", scale=1.0 / _WHITE)
RGB_STRETCHED = Feed(rgb=True, fit="stretch", scale=1.0 / _WHITE)
RGB_IMAGENET = Feed(
    rgb=True,
    fit="stretch",
    scale=1.0 / _WHITE,
    mean=tuple(one / _WHITE for one in _IMAGENET_MEAN),
    std=tuple(one / _WHITE for one in _IMAGENET_STD),
)


@dataclass(frozen=True)
class Network:
    """What is known of a network.

    Attributes:
        outputs: names and shapes of its outputs: as it gives them where the file leaves sides open.
        side: width and height of its input (px).
        export: what the notes of its file say.
    """

    outputs: tuple[Port, ...]
    side: tuple[int, int]
    export: Export

    @property
    def tables(self) -> tuple[tuple[int | None, ...], ...]:
        """Shapes of the outputs with a row for each box: batch, rows, numbers."""
        return tuple(port.shape for port in self.outputs if len(port.shape) == ROWS)

    @property
    def table(self) -> tuple[int | None, int | None] | None:
        """The last two sides of the only such output, beside which there are masks at most; else None."""
        tables = self.tables
        masks = sum(len(port.shape) > ROWS for port in self.outputs)
        if len(tables) != 1 or 1 + masks != len(self.outputs):
            return None
        return tables[0][1], tables[0][2]

    @property
    def names(self) -> set[str]:
        """Names of the outputs, in lower case."""
        return {port.name.lower() for port in self.outputs}

    def last_side(self, *names: str) -> int | None:
        """Return the last side of the first output that has one of some names (lower case)."""
        found = (port.shape[-1] for port in self.outputs if port.name.lower() in names and port.shape)
        return next(found, None)


#: The score at which a box is as likely real as not, of networks that score how well a box will fit: its
#: overlap with the object, and 0 where there is none. Such a score is P(real) times the mean overlap of boxes
#: that match, .8 to .9, so even is .40 to .45. Measured with truth, by the logistic regression of
#: `calibrate`: .446 and .450 for boxes of YOLOX in MOT17 and DanceTrack.
EVEN_FIT = 0.45
#: The same of networks that score the probability itself: a softmax over classes and nothing.
EVEN_PROBABILITY = 0.5


@dataclass(frozen=True)
class OutputLayout:
    """One layout of outputs: all that the rest of the package knows of it.

    Attributes:
        name: what it is called in settings and messages.
        detectors: which networks have it, for the page `docs/reference/layouts.md`, which is made of records.
        outputs: what its outputs look like, for that page.
        fit: tells how well it goes with a network.
        decode: turns outputs, in the shapes that the network gives them with its batch of one, into boxes;
            given the sides of the input (px), and how many of a row's numbers are scores of classes, None for
            all. Classes count from 0.
        classes: tells how many classes the outputs have room for, None where nobody knows.
        feed: how its networks are usually fed.
        least_score: boxes below are left out, as the networks' own tools have it.
        even_score: at which a box is as likely real as not.
        settled: tells by the first outputs which layout it is after all, where values alone can tell.
    """

    name: str
    detectors: str
    outputs: str
    fit: Callable[[Network], Fit]
    decode: Callable[[Outputs, tuple[int, int], int | None], DecodedBoxes]
    classes: Callable[[Network], int | None]
    feed: Feed = RGB_LETTERBOX
    least_score: float = 0.25
    even_score: float = EVEN_FIT
    settled: Callable[[Outputs, tuple[int, int]], str] | None = None
