"""What a protocol is: which boxes of truth are to be found, and which tracks are left out of the count."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from jeat_graph.data.arrays import BoolArray, FloatArray, TextArray
from jeat_graph.data.trajectories import GroundTruth, Trajectories


@dataclass(frozen=True, eq=False)
class FrameBoxes:
    """Boxes of truth and tracks in one frame, before anything is left out.

    Attributes:
        iou: (G, M) of truth and tracks.
        truth: (G, 4) left, top, width, height (px).
        tracks: (M, 4) likewise.
        ignore: (G,) true where the truth itself says that it is not to be judged.
        classes: (G,) of the truth, in lower case, or None.
        truncation: (G,) how far the picture's edge cuts the object, as KITTI numbers it, or None.
        occlusion: (G,) how far others hide it, as KITTI numbers it, or None.
    """

    iou: FloatArray
    truth: FloatArray
    tracks: FloatArray
    ignore: BoolArray
    classes: TextArray | None = None
    truncation: FloatArray | None = None
    occlusion: FloatArray | None = None


#: Which boxes of truth (G,) are to be found and which tracks (M,) count.
Judged = tuple[BoolArray, BoolArray]


@dataclass(frozen=True)
class JudgingProtocol:
    """Rules of what is judged.

    A module of `eval.protocols` that has one, called `PROTOCOL`, is found by the registry; nothing else names
    it.

    Attributes:
        name: of `--protocol`.
        says: its rules in one sentence, for the docs.
        classes: classes that it can judge, in lower case, each by itself; none where it takes all as one.
        suits: whether a truth looks like one that its challenge has.
        judge: says of one frame what counts, for a class of `classes`, or None.
        prepare: takes out of truth and tracks what has no part in the judgement of a class.
    """

    name: str
    says: str
    judge: Callable[[FrameBoxes, str | None], Judged]
    prepare: Callable[[GroundTruth, Trajectories, str | None], tuple[GroundTruth, Trajectories]]
    classes: tuple[str, ...] = ()
    suits: Callable[[GroundTruth], bool] = lambda _: False


@dataclass(frozen=True)
class RulesFor:
    """The rules of a protocol for one class.

    Attributes:
        protocol: whose rules these are.
        wanted: the class that is judged by itself, in lower case, or None for all as one.
    """

    protocol: JudgingProtocol
    wanted: str | None = None
