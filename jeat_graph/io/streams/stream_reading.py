"""How scans of a stream are read: as the rows of tables are, with the same options, but one after another.

What a table says as a whole, a stream says bit by bit: from which number its frames count, and which video it
is of. The first scan decides, and what does not go with it is refused.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import TextArray
from jeat_graph.data.class_columns import LISTS_COUNT_FROM, declared_classes, name_classes, naming_hint
from jeat_graph.data.column_names import FRAME_COLUMNS, TIME_COLUMNS
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import first_frame, split_picture_name
from jeat_graph.data.notes import note
from jeat_graph.data.scan import Scan, scan_with_area
from jeat_graph.data.tables.file_table import LARGEST_EXACT
from jeat_graph.data.tables.frame_filling import check_rate, scale_scores, score_hint
from jeat_graph.data.tables.reading import Reading
from jeat_graph.data.time_text import KNOWN, seconds_of_text
from jeat_graph.data.time_units import in_seconds
from jeat_graph.io.tables.class_names import names_by_number

# Of more classes than these no more are named.
_MOST_NAMED = 20
_SCORE_IS_WRONG = "score must be in"


class StreamReading:
    """Reads times, classes and scores of a stream's scans; raises errors without their place.

    Args:
        how: unit of times, rate and first frame, video, names of classes, scale of scores.
        classes: of these detections are taken, and those without a class; None takes all.
        goes_on: whether the stream may begin in the middle of a recording: its first frame then says nothing
            of the number from which frames count.

    Raises:
        DataError: a list of class names that cannot be read, or a rate that is none.
    """

    def __init__(
        self, how: Reading | None = None, classes: Sequence[str] | None = None, *, goes_on: bool = False
    ) -> None:
        self.how = Reading() if how is None else how
        self._classes = None if classes is None else list(classes)
        self._goes_on = goes_on
        self._first: int | None = None
        self._video: str | None = None
        self._warned_of_video = False
        self._found: set[str] = set()  # classes that came, as long as none of those asked for has
        self._names = names_by_number(self.how.class_names, None, LISTS_COUNT_FROM)
        self._rate_hz = None if self.how.rate_hz is None else check_rate(self.how.rate_hz, "--rate")

    def seconds(self, column: str, value: Any) -> float:
        """Return a time in seconds.

        Args:
            column: `t`, one that names its unit, or one that counts frames.
            value: a number, or a number, date, time code or picture's name as text.

        Raises:
            DataError: it is none of these, or not finite; or frames without a rate.
        """
        if column in FRAME_COLUMNS:
            return self._time_of_frame(column, value)
        own = TIME_COLUMNS.get(column)
        unit = self.how.time_unit if own is None else own
        if own is not None and self.how.time_unit not in ("s", own):
            raise DataError(f"{column} is in {own}, but --time-unit says {self.how.time_unit}; leave it out")
        number = _number(value)
        if number is None and isinstance(value, str) and own is None:
            return self._time_of_text(column, value)
        if number is None:
            raise DataError(f"{column} must be {KNOWN}, got {value!r:.60}")
        if not math.isfinite(number):
            raise DataError(f"{column} must be finite, got {number}")
        return number if unit == "s" else float(in_seconds(np.array([number]), unit)[0])

    def takes_video(self, name: str) -> bool:
        """Whether scans of a video are taken: of the one that is chosen, or of the only one.

        Raises:
            DataError: it is the second, and none is chosen.
        """
        if self.how.video is not None:
            other = name != str(self.how.video)
            if other and not self._warned_of_video:
                note(f"what is of video {name!r}, or another than {self.how.video}, is passed over")
            self._warned_of_video = self._warned_of_video or other
            return not other
        if self._video is None:
            self._video = name
        if name != self._video:
            raise DataError(
                f"holds several videos ({self._video}, {name}): read one of them with --only-video NAME"
            )
        return True

    def scan(
        self,
        t: float,
        sensor: str,
        boxes: npt.ArrayLike,
        scores: npt.ArrayLike,
        columns: Mapping[str, TextArray],
        embeddings: npt.ArrayLike | None = None,
        camera_motion: npt.ArrayLike | None = None,
        box_std: npt.ArrayLike | None = None,
    ) -> tuple[Scan, int]:
        """Make a scan of what its lines say.

        Args:
            t: time (s).
            sensor: its name.
            boxes: (M, 4) left, top, width, height (px).
            scores: (M,) on the scale of `how`.
            columns: (M,) classes by the name of their column, of `class_columns.CLASS_COLUMNS`.
            embeddings: (M, E), or None.
            camera_motion: (11,), or None.
            box_std: (M, 4), or None.

        Returns:
            The scan, and how many boxes without area were left out of it.

        Raises:
            DataError: as `Scan`.
        """
        classes = name_classes(declared_classes(columns), self._names)
        if self.how.score_scale != "unit":
            scores = scale_scores(np.asarray(scores, dtype=np.float64), self.how.score_scale, "")
        try:
            more = embeddings, camera_motion, box_std
            found, flat = scan_with_area(t, sensor, boxes, scores, classes, *more)
        except DataError as error:
            place, wrong, rest = error.message.partition(_SCORE_IS_WRONG)
            score = _number(rest.rpartition("got ")[2]) if wrong else None
            raise (error if score is None else DataError(place + score_hint(score))) from None
        return self._of_classes(found), flat

    def never_came(self) -> str | None:
        """Say that nothing of the classes asked for has come, and what has; None where that is not so.

        Most likely a name is misspelt, or classes are numbers.
        """
        there = sorted(self._found - {""})
        if self._classes is None or not there or set(self._classes) & set(there):
            return None
        return (
            f"nothing was of class {' or '.join(self._classes)}; there were: {', '.join(there)}"
            + naming_hint(there)
        )

    def _of_classes(self, scan: Scan) -> Scan:
        """Leave out detections of classes that are not asked for."""
        if self._classes is None or scan.classes is None:
            return scan
        came = set(scan.classes.tolist())
        self._found |= came if len(self._found) < _MOST_NAMED else came & set(self._classes)
        keep = np.isin(scan.classes, [*self._classes, ""])
        vectors = None if scan.embeddings is None else scan.embeddings[keep]
        return replace(
            scan,
            boxes=scan.boxes[keep],
            scores=scan.scores[keep],
            classes=scan.classes[keep],
            embeddings=vectors,
            box_std=None if scan.box_std is None else scan.box_std[keep],
        )

    def _time_of_text(self, column: str, text: str) -> float:
        found = seconds_of_text(text, self._rate_hz)
        if found is None:
            raise DataError(f"{column} must be {KNOWN}, got {text[:40]!r}")
        if self.how.time_unit != "s":
            raise DataError(f"{column} holds dates, but --time-unit says {self.how.time_unit}; leave it out")
        return found

    def _time_of_frame(self, column: str, value: Any) -> float:
        number = _number(value)
        named = split_picture_name(value) if number is None and isinstance(value, str) else None
        if named is not None:
            frame = named[1]
        elif number is not None and number.is_integer() and abs(number) <= LARGEST_EXACT:
            frame = int(number)
        else:
            raise DataError(f"{column} must be a whole number or a picture's name, got {value!r:.60}")
        if self._rate_hz is None:
            raise DataError("has frame numbers only; give their rate with --rate")
        if self._first is None and self.how.first_frame is None and self._goes_on:
            raise DataError(
                "counts frames, and where a stream goes on from a checkpoint its first frame does not tell "
                "from which number: give --first-frame 0 or 1"
            )
        if self._first is None:
            self._first = first_frame(np.array([frame]), self.how.first_frame)
        if frame < self._first:
            raise DataError(f"frames count from {self._first}, got {frame}")
        return (frame - self._first) / self._rate_hz


def video_of_picture(column: str, value: Any) -> str | None:
    """Return what the name of a picture says of its video; None where a column says frames by number."""
    if column not in FRAME_COLUMNS or _number(value) is not None or not isinstance(value, str):
        return None
    named = split_picture_name(value)
    return None if named is None else named[0]


def _number(value: Any) -> float | None:
    """A number, also one as text; None of anything else.

    Raises:
        DataError: a whole number that is larger than any time.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        return float(value)
    except ValueError:
        return None
    except OverflowError:
        raise DataError("a time is too large") from None
