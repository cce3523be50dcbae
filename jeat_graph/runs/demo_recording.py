"""What `demo` tracks and draws: detections with their truth, and the road's markings in the picture.

A small one comes with the package, in `configs/demo`: `detections.csv.gz`, `gt.csv.gz`, and `picture.json`
with the name of the scenario, width and height of the picture, and the markings. The simulator made it; the
README of jeat-graph-sehn has the command.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.io.tables.sensor_columns import Declared, declared_by
from jeat_graph.io.tables.truth_io import read_truth

DETECTIONS, TRUTH, PICTURE = "detections.csv.gz", "gt.csv.gz", "picture.json"


@dataclass(frozen=True, eq=False)
class DemoRecording:
    """A recording that can be judged and drawn.

    Attributes:
        name: of its scenario; one that begins with `day` is drawn bright.
        detections: scans of all sensors.
        truth: at the times of one sensor.
        width: of the picture (px).
        height: of the picture (px).
        lines: the road's markings, polylines (K, 2) in px; parts of them may lie outside the picture.
        declared: what is known of the sensors, as columns of the detections say it.
    """

    name: str
    detections: Detections
    truth: GroundTruth
    width: int
    height: int
    lines: Sequence[FloatArray]
    declared: Declared


def read_demo_recording() -> DemoRecording:
    """Read the recording that comes with the package."""
    with resources.as_file(resources.files("jeat_graph.configs") / "demo") as folder:
        picture = json.loads((folder / PICTURE).read_text(encoding="utf-8"))
        return DemoRecording(
            name=picture["scenario"],
            detections=read_detections(folder / DETECTIONS),
            truth=read_truth(folder / TRUTH),
            width=picture["width"],
            height=picture["height"],
            lines=[np.array(line) for line in picture["lines"]],
            declared=declared_by(folder / DETECTIONS),
        )
