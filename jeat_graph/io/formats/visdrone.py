"""VisDrone's text of sequences: lines of MOTChallenge with ten columns, whose classes have names.

Columns 7 to 10 are score, category, truncation and occlusion. In truth a score of 0 means ignore, and so do
the categories of ignored regions and of other objects.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from jeat_graph.data.tables.reading import Reading
from jeat_graph.data.tables.spreadsheets import is_number
from jeat_graph.io.formats import motchallenge
from jeat_graph.io.formats.record import BoxFormat, Certainty, FileBoxes, FileHead, always

CATEGORIES = (
    "ignored regions",
    "pedestrian",
    "people",
    "bicycle",
    "car",
    "van",
    "truck",
    "tricycle",
    "awning-tricycle",
    "bus",
    "motor",
    "others",
)
_NOT_JUDGED = (CATEGORIES[0], CATEGORIES[-1])
_COLUMNS = 10
# Its sequences are called so: `uav0000013_00000_v.txt`.
_NAME = re.compile(r"uav\d+_\d+_\w\.txt", re.IGNORECASE)


def read_boxes(path: str | Path, how: Reading, truth: bool = False) -> FileBoxes:
    """Read truth, detections or results.

    Raises:
        DataError: names the line and what is wrong.
    """
    named = how.class_names if how.class_names is not None else dict(enumerate(CATEGORIES))
    found = motchallenge.read_boxes(path, replace(how, class_names=named), truth)
    if found.classes is None or found.ignore is None:
        return found
    return replace(found, ignore=found.ignore | np.isin(found.classes, _NOT_JUDGED))


def _recognise(head: FileHead) -> Certainty:
    numbers = len(head.fields) == _COLUMNS and all(map(is_number, head.fields))
    return Certainty.BY_EXACT_CONTENT if numbers and _NAME.fullmatch(head.path.name) else Certainty.NONE


FORMAT = BoxFormat(
    name="visdrone",
    title="VisDrone",
    reads="text of its sequences (10 columns), with the names of its categories; score 0, ignored regions "
    "and `others` are ignored in truth; known from MOTChallenge by the file's name (`uav…_v.txt`)",
    recognise=_recognise,
    read=read_boxes,
    counts_frames=always,
)
