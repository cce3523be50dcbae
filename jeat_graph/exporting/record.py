"""What an export is: one record, in the one file that writes for another program."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from jeat_graph.data.tables.reading import ReadingOptions


@dataclass(frozen=True)
class ExportRequest:
    """What a user asks to be written.

    Attributes:
        source: run directory, table, road or set.
        out: the file or folder.
        to: name of the export.
        only: `causal` or `smoothed`, or None for what the export takes by itself.
        track: the one track, or None.
        output_rate: frames per second of what is written (Hz), or None.
        camera: file of the camera, or None.
        video: file name of the video, or None.
        start: time of the video's first frame (s since 1970), or None.
        reading: what a result does not say itself.
    """

    source: str
    out: str
    to: str
    only: str | None = None
    track: int | None = None
    output_rate: float | None = None
    camera: str | None = None
    video: str | None = None
    start: float | None = None
    reading: ReadingOptions = field(default_factory=ReadingOptions)


#: Options that only some exports can make use of, as fields of a request.
SOME_TAKE = ("only", "track", "output_rate", "camera", "video", "start")


@dataclass(frozen=True)
class ExportTarget:
    """An export.

    A module of `jeat_graph.exporting` that has one, called `EXPORT`, is found by the registry; nothing else
    names it.

    Attributes:
        name: of `--to`.
        program: who reads it, for the docs.
        writes: what is written, and how its name ends.
        write: writes it, and returns the text behind `wrote OUT`; raises `DataError`.
        options: those of `SOME_TAKE` that it takes.
    """

    name: str
    program: str
    writes: str
    write: Callable[[ExportRequest], str]
    options: tuple[str, ...] = ()
