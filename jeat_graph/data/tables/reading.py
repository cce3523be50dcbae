"""How files are read: what they do not say themselves, the same for detections, truth and results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

from jeat_graph.data.class_columns import LISTS_COUNT_FROM, listed_names
from jeat_graph.data.errors import DataError


class TableOptions(TypedDict, total=False):
    """The fields of `Reading` as keywords, but for `image`, which a configuration has too; see there."""

    rate_hz: float | None
    time_unit: str
    first_frame: int | None
    video: str | int | None
    class_names: str | Path | Sequence[str] | Mapping[int, str] | None
    score_scale: str
    fill_empty: bool
    images: str | Path | None


class ReadingOptions(TableOptions, total=False):
    """The fields of `Reading` as keywords; see there."""

    image: tuple[float, float] | None


@dataclass(frozen=True)
class Reading:
    """How a file is read.

    Attributes:
        rate_hz: frames per second of files that count frames; None where they say it themselves.
        time_unit: unit of the column `t` where it holds numbers: `s`, `ms`, `us` or `ns`.
        first_frame: number of a recording's first frame, 0 or 1; None for the rule of `data.frame_numbers`.
        video: name or number of the one that is read of a file's several videos.
        class_names: names of classes that a file says by number (`io.tables.class_names`): a list, a mapping,
            names with commas between them, or a file.
        image: width and height of the picture (px), for boxes in shares of it.
        score_scale: `unit` if scores are in [0, 1], `percent`, or `logistic` for raw scores of any size.
        fill_empty: whether frames without boxes are empty scans rather than no scans.
        images: COCO data set JSON with the list of images of COCO results.
    """

    rate_hz: float | None = None
    time_unit: str = "s"
    first_frame: int | None = None
    video: str | int | None = None
    class_names: str | Path | Sequence[str] | Mapping[int, str] | None = None
    image: tuple[float, float] | None = None
    score_scale: str = "unit"
    fill_empty: bool = True
    images: str | Path | None = None

    def listed_classes(self) -> dict[int, str] | None:
        """Return the names of classes by number, for a table that is no file; None where nobody says them.

        Raises:
            DataError: they stand in a file, which is read elsewhere (`io.tables.class_names`).
        """
        names = self.class_names
        if isinstance(names, str) and "," in names:
            names = [name.strip() for name in names.split(",")]
        if isinstance(names, str | Path):
            raise DataError(
                "names of classes are a list or a mapping here; jeat_graph.track reads files of them"
            )
        return None if names is None else listed_names(names, LISTS_COUNT_FROM)
