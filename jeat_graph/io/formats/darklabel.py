"""What the annotation tool DarkLabel writes: one line a frame, `frame, n`, then n boxes.

A box is `id, x1, y1, x2, y2, label`, or the same without `id`; corners in px. Frames count from 0.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from jeat_graph.data.class_columns import LISTS_COUNT_FROM, name_classes
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import FrameCount, first_frame
from jeat_graph.data.tables.frame_filling import check_rate, fill_frames
from jeat_graph.data.tables.reading import Reading
from jeat_graph.data.tables.spreadsheets import is_number
from jeat_graph.io.formats.record import BoxFormat, Certainty, FileBoxes, FileHead, always
from jeat_graph.io.tables.class_names import names_by_number
from jeat_graph.io.tables.csv_text import read_text

_WITH_ID, _WITHOUT_ID = 6, 5
_BEFORE_BOXES = 2
_LAYOUT = "a line of DarkLabel is frame, n, then n times id, x1, y1, x2, y2, label (or without id)"


def read_boxes(path: str | Path, how: Reading, _truth: bool = False) -> FileBoxes:
    """Read annotations.

    Raises:
        DataError: names the line and what is wrong; or no rate is given.
    """
    text = read_text(path).decode("utf-8", errors="replace")
    lines, labelled, frames, rows, labels = [], [], [], [], []
    width: int | None = None
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text), 1):
        if not line.strip():
            continue
        fields = _fields(line)
        width = width or _width(fields)
        frame = _checked(fields, width, path, number)
        labelled.append(frame)
        step = width or _WITH_ID
        for start in range(_BEFORE_BOXES, len(fields), step):
            box = fields[start : start + step]
            rows.append(_numbers(box, path, number))
            labels.append(box[-1])
            frames.append(frame)
            lines.append(number)
    rate, numbers = check_rate(how.rate_hz, path), np.array(labelled, dtype=np.int64)
    first = first_frame(numbers, how.first_frame)
    if len(numbers) and numbers.min() < first:
        raise DataError(f"frames count from {first}, got {numbers.min()}", path)
    found = np.array(rows, dtype=np.float64).reshape(-1, (width or _WITH_ID) - 1)
    sides = found[:, -4:]
    names = names_by_number(how.class_names, path, LISTS_COUNT_FROM)
    return FileBoxes(
        t=(np.array(frames, dtype=np.int64) - first) / rate,
        boxes=np.concatenate((sides[:, :2], sides[:, 2:] - sides[:, :2]), axis=1),
        error=lambda row, message: DataError(message, path, lines[row]),
        recorded=lambda: (fill_frames(numbers, path) - first) / rate,
        ids=found[:, 0].astype(np.int64) if width == _WITH_ID else None,
        classes=name_classes(np.array(labels, dtype=np.str_), names),
        frames=FrameCount.of(numbers, first),
    )


def _fields(line: str) -> list[str]:
    return [field.strip() for field in line.strip().rstrip(",").split(",")]


def _width(fields: list[str]) -> int | None:
    """Fields of one box, by a line that has boxes; None where it has none, or is no line of the format."""
    if len(fields) < _BEFORE_BOXES or not all(field.isdigit() for field in fields[:_BEFORE_BOXES]):
        return None
    count, rest = int(fields[1]), len(fields) - _BEFORE_BOXES
    return next((step for step in (_WITH_ID, _WITHOUT_ID) if count and rest == count * step), None)


def _checked(fields: list[str], width: int | None, path: str | Path, line: int) -> int:
    """Return the frame of a line.

    Raises:
        DataError: it is no line of the format.
    """
    whole = len(fields) >= _BEFORE_BOXES and all(field.isdigit() for field in fields[:_BEFORE_BOXES])
    if not whole or len(fields) - _BEFORE_BOXES != int(fields[1]) * (width or 0):
        raise DataError(_LAYOUT, path, line)
    return int(fields[0])


def _numbers(box: list[str], path: str | Path, line: int) -> list[float]:
    """Return identity, if there is one, and corners of a box.

    Raises:
        DataError: they are no finite numbers, or no corners.
    """
    bad = next((one for one in box[:-1] if not is_number(one) or not np.isfinite(float(one))), None)
    if bad is not None:
        raise DataError(f"must hold finite numbers, got {bad[:40]!r}", path, line)
    numbers = [float(one) for one in box[:-1]]
    left, top, right, bottom = numbers[-4:]
    if right <= left or bottom <= top:
        raise DataError(
            f"x2, y2 must lie right of and below x1, y1, got {left:g}, {top:g}, {right:g}, {bottom:g}; boxes "
            "by width and height are not read: export them as corners",
            path,
            line,
        )
    if len(numbers) == _WITH_ID - 1 and numbers[0] != int(numbers[0]):
        raise DataError(f"the id must be a whole number, got {box[0]}", path, line)
    return numbers


def _recognise(head: FileHead) -> Certainty:
    """Lines of which each says how many boxes follow, at least one of them with a name."""
    lines = [line for line in re.split(r"[\r\n]+", head.text) if line.strip()]
    lines = lines if len(lines) < 2 or head.text.endswith(("\n", "\r")) else lines[:-1]  # the last may be cut
    found = [_fields(line) for line in lines]
    widths = [_width(fields) for fields in found]
    empty = [len(fields) == _BEFORE_BOXES and fields[1] == "0" and fields[0].isdigit() for fields in found]
    if not any(widths) or not all(width or none for width, none in zip(widths, empty, strict=True)):
        return Certainty.NONE
    named = any(not is_number(fields[-1]) for fields, width in zip(found, widths, strict=True) if width)
    return Certainty.BY_EXACT_CONTENT if named else Certainty.NONE


FORMAT = BoxFormat(
    name="darklabel",
    title="DarkLabel",
    reads="one line a frame, `frame, n`, then n times `id, x1, y1, x2, y2, label` (or without `id`); needs "
    "`--rate`",
    recognise=_recognise,
    read=read_boxes,
    counts_frames=always,
)
