"""Detections with the truth that they are judged by: the frames of both count from the same number."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from jeat_graph.data.detections import Detections
from jeat_graph.data.tables.reading import Reading, ReadingOptions
from jeat_graph.data.together import Reader, read_together
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.io.tables.detections_io import detection_readers, of_class_in, split_name
from jeat_graph.io.tables.truth_io import read_truth_counted


def read_with_truth(
    path: str | Path, truth: str | Path, like: ReadingOptions, **options: Any
) -> tuple[Detections, GroundTruth]:
    """Read a file of detections and its truth.

    Args:
        path: the detections, or `NAME=path`.
        truth: the truth.
        like: what the truth does not say itself.
        options: of the detections, as `read_many` has them.

    Raises:
        DataError: one of them is not valid.
    """
    how = Reading(**like)
    classes = options.pop("classes", None)
    readers: list[Reader[Any]] = [
        Reader(str(truth), lambda first: read_truth_counted(truth, None, replace(how, first_frame=first))),
        *detection_readers([path], **options),
    ]
    (objects, detections), _ = read_together(readers, options.get("first_frame"), truth=0)
    chosen = detections if classes is None else of_class_in(detections, classes, split_name(path)[1])
    return chosen, objects
