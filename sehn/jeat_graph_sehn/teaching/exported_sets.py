"""Labels as a data set for other people's training programs: `teach --dataset LAYOUT FOLDER`.

========  =============================================================  =====================================
layout    written                                                        what is masked
========  =============================================================  =====================================
`coco`    `images/000123.png`, `train.json`, `val.json`                  boxes with `iscrowd` 1
`yolo`    `images/train`, `images/val`, `labels/train`, `labels/val`,    painted grey in the pictures
          `data.yaml`
`dsec`    `train/taught`, `test/held-back`, each `events/left/events.h5`  its events are left out
          and `object_detections/left/tracks.npy`
========  =============================================================  =====================================

`val` and `test` have the held-back part. In COCO `score`, and in DSEC `class_confidence`, is the weight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.teaching.coco_set import write_coco_set
from jeat_graph_sehn.teaching.dsec_set import write_dsec_set
from jeat_graph_sehn.teaching.lesson import Lesson
from jeat_graph_sehn.teaching.recordings import EventRecording
from jeat_graph_sehn.teaching.stills import Stills, stills_of
from jeat_graph_sehn.teaching.yolo_set import write_yolo_set
from jeat_graph_sehn.whole_folder import whole_folder

OF_PICTURES: Mapping[str, Callable[[Mapping[str, Stills], Path], None]] = {
    "coco": write_coco_set,
    "yolo": write_yolo_set,
}
LAYOUTS = (*OF_PICTURES, "dsec")


@dataclass(frozen=True)
class SetRequest:
    """What is written where.

    Attributes:
        layout: one of `LAYOUTS`.
        out: the folder; must not be there yet, or be empty.
        video: the pictures, for `coco` and `yolo`.
        events: the events, for `dsec`.
    """

    layout: str
    out: Path
    video: Path | None = None
    events: EventRecording | None = None


class SetWritten(NamedTuple):
    """How many vehicles' boxes are asked for in each part of what was written."""

    learned: int
    judged: int


def check_layout(layout: str, of_pictures: bool) -> None:
    """Refuse a layout that is none, or not of this sensor.

    Raises:
        ConfigError: says which ones are.
    """
    if layout not in LAYOUTS:
        raise ConfigError(f"--dataset {layout}: must be one of {', '.join(LAYOUTS)}")
    if (layout in OF_PICTURES) != of_pictures:
        raise ConfigError(
            f"--dataset {layout}: is of {'events' if of_pictures else 'pictures'}, give --"
            f"{'events FILE' if of_pictures else 'frames VIDEO'}"
        )


def write_set(lesson: Lesson, request: SetRequest) -> SetWritten:
    """Write the labels of a lesson; the folder appears when it is whole.

    Raises:
        DataError: the folder is there and not empty, or something cannot be read or written.
    """
    with whole_folder(request.out) as folder:
        if request.video is not None:
            parts = {
                name: stills_of(labels, request.video)
                for name, labels in zip(("train", "val"), lesson.parts, strict=True)
            }
            OF_PICTURES[request.layout](parts, folder)
        else:
            assert request.events is not None
            write_dsec_set(lesson.parts, request.events, folder)
    asked = [int((~labels.truth.ignore).sum()) for labels in lesson.parts]
    return SetWritten(*asked)
