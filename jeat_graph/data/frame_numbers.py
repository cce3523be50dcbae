"""Frame numbers: from which they count, and which frame a picture's name says.

One rule for all files that do not fix it themselves (KITTI counts from 0): frames count from 0 where there is
a frame 0, else from 1. Frame k is at (k - first) / rate. Files of one recording are decided together
(`first_frames`): the first frame of a recording may be empty in one of them and not in another.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.notes import note

#: What a recording's first frame may be.
FIRST_FRAMES = (0, 1)
_NUMBER = re.compile(r"\d+(?!.*\d)", re.DOTALL)
# More digits than these are no frame number, and no whole number that all readers can hold.
_MOST_DIGITS = 15


def first_frame(frames: IntArray | FloatArray, given: int | None = None) -> int:
    """Return the number of a recording's first frame.

    Args:
        frames: (R,) numbers that occur.
        given: what the user says, or None.

    Raises:
        DataError: `given` is neither 0 nor 1.
    """
    if given is None:
        return 0 if len(frames) and np.nanmin(frames) == 0 else 1
    if given not in FIRST_FRAMES:
        raise DataError(f"frames count from 0 or 1, not from {given}")
    return given


class FrameCount(NamedTuple):
    """The frame numbers of a file, and from which of them it was read.

    Attributes:
        first: number that was taken as the recording's first frame, at time 0.
        lowest: lowest number that occurs; `first` where none does.
        highest: highest number that occurs; `first` where none does.
        fixed: whether the format says where it counts from.
        length: number of the recording's frames, where a file beside says it, else None.
        usual: from which number files of the format count as a rule; None where there is no rule.
    """

    first: int
    lowest: int
    highest: int
    fixed: bool = False
    length: int | None = None
    usual: int | None = None

    @staticmethod
    def of(frames: IntArray | FloatArray, first: int, *, usual: int | None = None) -> FrameCount:
        """Describe the numbers (R,) of a file that was read from `first`."""
        if not len(frames):
            return FrameCount(first, first, first, usual=usual)
        return FrameCount(first, int(frames.min()), int(frames.max()), usual=usual)

    @property
    def from_0(self) -> bool:
        """Whether the file itself says that it counts from 0: by its format, or by a frame 0."""
        return self.first == 0 if self.fixed else self.lowest == 0


def note_first(title: str, count: FrameCount | None, given: int | None = None) -> None:
    """Say from which number a file was taken to count, where nobody said it and it is not the usual one.

    Args:
        title: what the file is called.
        count: its frame numbers; None of one that has times.
        given: what the user said.
    """
    if count is None or given is not None or count.fixed or count.usual in (None, count.first):
        return
    if count.from_0:
        note(f"{title}: frames count from 0, for there is a frame 0")
    else:
        note(f"{title}: frames count from 1, for there is no frame 0 (--first-frame 0 says otherwise)")


def first_frames(files: Sequence[FrameCount | None], truth: int | None = None) -> list[int | None]:
    """Decide together from which number the frames of one recording's files count.

    Where a file counts from 0, all do, but for those whose numbers fit only if they count from 1: of a truth
    or one of several inputs, the numbers 1 to N beside 0 to N - 1, or a last frame that is the recording's
    length; of a result, a frame behind the last one of its truth.

    Args:
        files: what each was read as; None of one that has times of its own.
        truth: which of them is the truth that the others are judged by, or None.

    Returns:
        The number of the first frame for each; None of one that has times of its own.
    """
    zero = [count.highest for count in files if count is not None and count.from_0]
    judge = None if truth is None else files[truth]

    def first(k: int, count: FrameCount) -> int:
        if count.fixed or not zero:
            return count.first
        if count.from_0:
            return 0
        if judge is not None and judge.from_0 and k != truth:
            return 1 if count.highest > judge.highest else 0
        all_of_them = count.lowest == 1 and count.highest == max(zero) + 1
        return 1 if all_of_them or count.highest == count.length else 0

    return [None if count is None else first(k, count) for k, count in enumerate(files)]


def split_picture_name(name: str) -> tuple[str, int] | None:
    """Split the name of a picture into what all pictures of a video share, and the number of its frame.

    The number is the last one in the name without folder and type: `cam1/frame_000012.jpg` is frame 12.

    Args:
        name: with or without folders.

    Returns:
        The name without number and type, and the number; None where it has none.
    """
    folder, mark, last = name.replace("\\", "/").rpartition("/")
    stem = re.sub(r"\.[A-Za-z]\w*$", "", last.strip())
    found = _NUMBER.search(stem)
    if found is None or len(found[0]) > _MOST_DIGITS:
        return None
    rest = stem[: found.start()] + stem[found.end() :]
    return folder.strip() + mark + rest.rstrip("_-. "), int(found[0])
