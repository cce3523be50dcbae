"""What the notes of a file say of its outputs: the task of an Ultralytics export, and what else a row holds.

==========  ================================================  ==============================================
`task`      a row of the dense output                         read as
==========  ================================================  ==============================================
`detect`    box, a score for each class                       boxes
`segment`   the same, then factors of a mask (32)             its boxes
`pose`      the same, then the key points                     its boxes
`obb`       the same, then the angle of the box (rad)         the upright boxes around the turned ones
`classify`  a score for each class of the whole picture       refused: it has no boxes
==========  ================================================  ==============================================

Rows of exports that suppress by themselves are a box, its score, its class, and then the same. Whether an
export does is said by `end2end` and by `nms` of its `args`; `imgsz` is the size of its input where the file
leaves that open.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.class_names import class_names
from jeat_graph.detection.models.onnx_head import Port

DETECT, SEGMENT, POSE, TURNED = "detect", "segment", "pose", "obb"
_TASKS = (DETECT, SEGMENT, POSE, TURNED)
#: Numbers of a box, and of a row of an export that suppresses by itself.
BOX, ROW = 4, 6
_MASK_FACTORS = 32
#: Sides of an output of masks: batch, factors, height, width.
_MASK_SIDES = 4
_LARGEST_SIDE = 8192
# Key points of COCO's people, each with two coordinates and whether it is seen; one class.
_PEOPLE_POINTS = 17 * 3


class Export(NamedTuple):
    """What a file says of its outputs.

    Attributes:
        task: one of this module's table.
        classes: how many classes it names; None where it names none.
        more: numbers behind the class scores of a row; None where nobody knows.
        rtdetr: whether it is Ultralytics' RT-DETR, whose boxes are centres and sizes in shares.
        declared_task: whether the notes say the task.
        suppressed: whether the network suppresses by itself; None where the notes do not say it.
        asked: whether the user says the layout: then a file without notes is what it is said to be.
    """

    task: str
    classes: int | None
    more: int | None
    rtdetr: bool
    declared_task: bool = False
    suppressed: bool | None = None
    asked: bool = False

    @property
    def behind(self) -> int:
        """Numbers behind the class scores of a row, 0 where nobody knows."""
        return self.more or 0

    @property
    def description(self) -> str:
        """Say for messages what the notes say; empty where they say nothing."""
        words = [f"task {self.task}"] if self.declared_task else []
        words += [] if self.classes is None else [f"{self.classes} classes"]
        if self.suppressed is not None:
            words.append("suppression by itself" if self.suppressed else "no suppression by itself")
        words += ["RT-DETR"] if self.rtdetr else []
        return f"; its notes say {', '.join(words)}" if words else ""

    @property
    def words(self) -> str:
        """Say of which task the boxes are, where it is not the usual one."""
        read = {SEGMENT: "boxes of masks", POSE: "boxes of poses", TURNED: "upright boxes around turned ones"}
        return f" ({read[self.task]})" if self.task in read else ""


def export_of(outputs: Sequence[Port], notes: Mapping[str, str]) -> Export:
    """Return what the notes, and outputs beside the boxes, say.

    Args:
        outputs: what the file says of them.
        notes: of the file.

    Raises:
        DataError: its task gives no boxes.
    """
    task = notes.get("task", "").strip().lower()
    if task and task not in _TASKS:
        raise DataError(f"is an export of the task {task!r}, which gives no boxes; export a detector")
    names = class_names(notes)
    points = _points(notes)
    masks = next((port.shape[1] for port in outputs if len(port.shape) == _MASK_SIDES), None)
    if not task:
        task = POSE if points else SEGMENT if masks else DETECT
    more = {DETECT: 0, TURNED: 1, SEGMENT: masks or _MASK_FACTORS, POSE: points or _PEOPLE_POINTS}[task]
    description = f"{notes.get('head', '')} {notes.get('description', '')}".lower().replace("-", "")
    return Export(
        task,
        len(names) or None,
        more,
        "rtdetr" in description,
        declared_task=bool(notes.get("task", "").strip()),
        suppressed=_suppressed(notes),
    )


def noted_side(notes: Mapping[str, str]) -> tuple[int, int] | None:
    """Return the width and height of the input (px) that the notes say, None where they say none."""
    size = _literal(notes.get("imgsz", ""))
    sides = [size, size] if isinstance(size, int) else size
    if not isinstance(sides, list | tuple) or len(sides) != 2:
        return None
    if not all(isinstance(side, int) and 0 < side <= _LARGEST_SIDE for side in sides):
        return None
    height, width = sides
    return width, height


def _suppressed(notes: Mapping[str, str]) -> bool | None:
    """Return whether the notes say that the network suppresses by itself; None where they leave it open.

    `nms` alone leaves it open: YOLOv10 has none, and needs none.
    """
    arguments = _literal(notes.get("args", ""))
    nms = arguments.get("nms") if isinstance(arguments, Mapping) else _literal(notes.get("nms", ""))
    end_to_end = _literal(notes.get("end2end", "").strip().capitalize())
    if nms is True or end_to_end is True:
        return True
    return False if nms is False and end_to_end is False else None


def _literal(text: str) -> object:
    """Return what a note says in Python's words, None where it is nothing of that kind."""
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        return None


def class_channels(channels: int, export: Export) -> int:
    """Return how many numbers of a row of a dense output are scores of classes.

    Args:
        channels: numbers of a row.
        export: what the file says.

    Raises:
        DataError: what the file says of its classes and of its outputs does not go together.
    """
    count = channels - BOX - (export.more or 0)
    if export.classes is None and export.asked:
        return channels - BOX - (export.task == TURNED)
    if export.classes is None and export.task == DETECT and channels == BOX + 1 + _PEOPLE_POINTS:
        raise DataError(
            f"has {channels} numbers a row and no notes: those of a pose of one class, or 52 classes; say "
            "layout: yolov8 for the latter"
        )
    if count < 1 or (export.classes is not None and export.classes != count):
        named = "" if export.classes is None else f" and names {export.classes} classes"
        raise DataError(
            f"has {channels} numbers a row{named}: not what an export of the task {export.task!r} has"
        )
    return count


def _points(notes: Mapping[str, str]) -> int:
    """Return how many numbers the key points of a row are; 0 where the file says nothing of any."""
    shape = _literal(notes.get("kpt_shape", ""))
    sides = shape if isinstance(shape, list | tuple) else []
    return math.prod(sides) if sides and all(isinstance(side, int) and side > 0 for side in sides) else 0
