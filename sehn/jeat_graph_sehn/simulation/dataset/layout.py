"""Names of the files of a data set.

::

    manifest.json            checksums, counts and splits; written last, so a set without it is not complete
    settings.yaml            all that defines the bytes
    camera.yaml              calibration
    scenario.yaml            the scenario, readable by `simulate`
    annotations/train.json   COCO, one file a split (train, val, test)
    train.txt, val.txt, …    the segments of each split
    segments/000000/         one folder a segment:
        frames.mp4           or frames.avi (lossless), or frames/000000.png, …
        frames.csv           index,t_us
        masks/000000.png, …  with --masks: identity of the vehicle that each pixel shows (16 bit, 0: none)
        events.h5            events as in DSEC
        gt.csv               truth as everywhere in this package
        vehicles.csv         visible fraction, size, 3D pose and velocity, row by row beside gt.csv
        boxes.npy            truth as a Prophesee/DSEC box array
        coco.json            truth as COCO
        camera.yaml          calibration, where it is not that of the whole set
        segment.json         counts and checksums
"""

from __future__ import annotations

from pathlib import Path

MANIFEST = "manifest.json"
SETTINGS = "settings.yaml"
CAMERA = "camera.yaml"
SCENARIO = "scenario.yaml"
ANNOTATIONS = "annotations"
SEGMENTS = "segments"
SEGMENT_JSON = "segment.json"
EVENTS = "events.h5"
MASKS = "masks"
TRUTH = "gt.csv"
DETECTIONS = "detections.csv"  # of a simulation at the level of detections
TRUTH_ROAD = "gt_road.csv"  # where the vehicles are on the road, beside the truth in the picture
RIG = "rig.yaml"  # of a simulation with two lenses: how picture and clock of the second lie to the first's
RIGS = "rigs"  # the same of every segment, beside the sets of both cameras
RIG_CAMERA = "camera_evt.yaml"  # its pose, in the axes of `camera.yaml`
RIG_TRUTH = "gt_evt.csv"  # the truth of the same moments in its own picture and on its own clock
VEHICLES = "vehicles.csv"
BOXES = "boxes.npy"
COCO = "coco.json"
PARTIAL_SUFFIX = ".partial"
FORMAT = "jeat-graph pictures 1"


def segment_name(index: int) -> str:
    """Name of the folder of segment `index`."""
    return f"{index:06d}"


def segment_folder(root: Path, index: int) -> Path:
    """Folder of segment `index`."""
    return root / SEGMENTS / segment_name(index)


def partial_folder(root: Path, index: int) -> Path:
    """Folder in which segment `index` grows until it is whole."""
    return root / SEGMENTS / (segment_name(index) + PARTIAL_SUFFIX)


def finished_segments(root: Path) -> list[int]:
    """Indices of the segments that are whole, ascending."""
    folder = root / SEGMENTS
    if not folder.is_dir():
        return []
    return sorted(int(p.name) for p in folder.iterdir() if p.name.isdigit() and (p / SEGMENT_JSON).is_file())
