"""What a file format of boxes is: one record, in the one file that reads and perhaps writes the format."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray, TextArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import FrameCount
from jeat_graph.data.tables.reading import Reading
from jeat_graph.data.trajectories import Trajectories

_BOM = b"\xef\xbb\xbf"
#: So many bytes tell what a file is.
HEAD_BYTES = 4096


@dataclass(frozen=True, eq=False)
class FileBoxes:
    """Boxes of one camera.

    Attributes:
        t: (R,) time of each (s).
        boxes: (R, 4) left, top, width, height (px).
        error: makes an error that names a row's (from 0) place in the file.
        recorded: gives all times (T,) at which the file says, or lets suppose, that it was looked (s).
        scores: (R,) as the file has them; None where it has none.
        ids: (R,) identities, or None.
        box_std: (R, 4) standard deviations of left, top, right, bottom (px), NaN where unknown, or None.
        classes: (R,) names, or numbers as text, or None.
        ignore: (R,) true for what is not to be judged, or None.
        distance: (R,) from the camera (m), NaN where unknown, or None.
        truncation: (R,) how far the picture's edge cuts the object, as KITTI numbers it, or None.
        occlusion: (R,) how far others hide it, as KITTI numbers it, or None.
        frames: the frame numbers of a file that counts frames, else None.
    """

    t: FloatArray
    boxes: FloatArray
    error: Callable[[int, str], DataError]
    recorded: Callable[[], FloatArray]
    scores: FloatArray | None = None
    box_std: FloatArray | None = None
    ids: IntArray | None = None
    classes: TextArray | None = None
    ignore: BoolArray | None = None
    distance: FloatArray | None = None
    truncation: FloatArray | None = None
    occlusion: FloatArray | None = None
    frames: FrameCount | None = None

    def take(self, rows: IntArray) -> FileBoxes:
        """Return some of the boxes, whose errors still name the file's own places."""
        names = ("scores", "box_std", "ids", "classes", "ignore", "distance", "truncation", "occlusion")
        columns: dict[str, Any] = {name: getattr(self, name) for name in names}
        columns = {name: None if column is None else column[rows] for name, column in columns.items()}
        return replace(
            self,
            t=self.t[rows],
            boxes=self.boxes[rows],
            error=lambda row, message: self.error(int(rows[row]), message),
            **columns,
        )


class SequenceInfo(NamedTuple):
    """What a file beside a sequence says of it; None where it says nothing.

    Attributes:
        rate_hz: frames per second.
        length: number of frames.
        size_px: width and height of the picture.
        origin: the file.
    """

    rate_hz: float | None = None
    length: int | None = None
    size_px: tuple[int, int] | None = None
    origin: Path | None = None


class Certainty(IntEnum):
    """How sure a format is that a file is its own; the highest of all formats decides."""

    NONE = 0
    #: Nothing speaks against it: what no other format takes.
    POSSIBLE = 1
    #: Its content looks so.
    BY_CONTENT = 2
    #: Its content looks so, and that of no similar format.
    BY_EXACT_CONTENT = 3
    #: Its name ends so.
    NAMED = 4
    #: Its bytes say so, whatever its name.
    SAYS = 5


@dataclass(frozen=True)
class FileHead:
    """The beginning of a file, by which its format is recognised.

    Attributes:
        path: the file, or the folder.
        data: its first bytes, `HEAD_BYTES` at most, unpacked where the name ends in `.gz`; none of a folder.
    """

    path: Path
    data: bytes = field(repr=False)

    @cached_property
    def suffix(self) -> str:
        """The end of the name in lower case, without `.gz`."""
        suffix = self.path.suffix.lower()
        return Path(self.path.stem).suffix.lower() if suffix == ".gz" else suffix

    @cached_property
    def text(self) -> str:
        """The beginning as text, without white space before it."""
        return self.data.removeprefix(_BOM).lstrip().decode("utf-8", errors="replace")

    @cached_property
    def blank(self) -> bool:
        """Whether there is nothing but white space in the whole file."""
        return not self.text and len(self.data) < HEAD_BYTES

    @cached_property
    def line(self) -> str:
        """The first line that is not blank."""
        return re.split(r"[\r\n]", self.text, maxsplit=1)[0]

    @cached_property
    def fields(self) -> list[str]:
        """Its fields, between commas or white space; a comma behind the last is none."""
        return re.split(r"\s*,\s*|\s+", re.sub(r",\s*$", "", self.line).strip())


def never(_: FileHead) -> Certainty:
    """Tell no file: for a format that a user must name."""
    return Certainty.NONE


@dataclass(frozen=True)
class BoxFormat:
    """A file format of boxes: detections, truth, or results.

    A module of `jeat_graph.io.formats` that has one, called `FORMAT`, is found by the registry; nothing else
    names the format.

    Attributes:
        name: by which users name it (`--input-format`).
        title: by which messages and the docs name it.
        reads: what of it is read, for the docs: one line of Markdown without `|`.
        recognise: how sure it is that a file is its own; of a folder, which has no bytes, too.
        read: reads it: the file, what it does not say itself, and whether it is truth. None of a table with a
            header, which `io.tables` reads by the names of its columns.
        counts_frames: whether a file of it counts frames and says no times, so that it needs a rate.
        rate_hz: frames per second (Hz), where the format fixes them.
        facts: reads what a file beside it says of the sequence, or None.
        in_shares: whether boxes are in shares of the picture, whose size must be given.
        is_folder: tells whether a folder is one of its files; None of a format without folders.
        suffix: end of the name of a run's table in this format; empty where none is written.
        write: writes tracks that are at frame times, at a rate (Hz); None of a table with a header, or of a
            format that is read alone.
    """

    name: str
    title: str
    reads: str
    recognise: Callable[[FileHead], Certainty]
    read: Callable[[str | Path, Reading, bool], FileBoxes] | None
    counts_frames: Callable[[str | Path], bool]
    rate_hz: float | None = None
    facts: Callable[[str | Path], SequenceInfo] | None = None
    in_shares: bool = False
    is_folder: Callable[[str | Path], bool] | None = None
    suffix: str = ""
    write: Callable[[Trajectories, Path, float], None] | None = None

    @property
    def is_table(self) -> bool:
        """Whether it is a table with a header, whose columns are known by their names."""
        return self.read is None

    def read_boxes(self, path: str | Path, how: Reading, *, truth: bool = False) -> FileBoxes:
        """Read a file.

        Args:
            path: the file, or the folder.
            how: what the file does not say itself.
            truth: whether it is truth.

        Raises:
            DataError: names the file, the line or row, and what is wrong.
        """
        if self.read is None:
            raise DataError(f"is {self.title}, a table: its columns say what it holds", path)
        return self.read(path, how, truth)


def always(_: str | Path) -> bool:
    """Say that every file of a format counts frames."""
    return True


def no_frames(_: str | Path) -> bool:
    """Say that no file of a format counts frames."""
    return False
