"""Writes a set in the folders of the DSEC-Detection data set.

::

    train/000000/images/timestamps.txt                    times of the pictures (µs), one a line
    train/000000/images/left/distorted/000000.png         pictures, as the lens makes them
    train/000000/events/left/events.h5
    train/000000/object_detections/left/tracks.npy        boxes with identities, at the pictures' times
    test/000001/                                          likewise
    train_val_test_split.yaml                             names by split; those of `val` lie in train/

There is no `images/left/rectified`: events and pictures share one lens. Classes are those of DSEC-Detection;
vans and pick-ups are cars.
Source: https://github.com/uzh-rpg/dsec-det, its description of folders and fields.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import DataError
from jeat_graph.io.media.video import open_frames
from jeat_graph_sehn.simulation.layouts.sets import SetSegment
from jeat_graph_sehn.simulation.world.vehicles import KIND_NAMES

CLASSES = ("pedestrian", "rider", "car", "bus", "truck", "bicycle", "motorcycle", "train")
TRACK_DTYPE = np.dtype(
    [
        ("t", "<u8"),
        ("x", "<f8"),
        ("y", "<f8"),
        ("h", "<f8"),
        ("w", "<f8"),
        ("class_id", "u1"),
        ("class_confidence", "<f8"),
        ("track_id", "<u8"),
    ]
)


def write_dsec_det(segment: SetSegment, size_px: tuple[int, int], out: Path) -> bool:
    """Write a segment below `out`; returns true.

    Args:
        segment: which.
        size_px: width and height of the picture.
        out: the set's folder.

    Raises:
        DataError: files that cannot be read, or frames and times that differ in number.
    """
    folder = out / ("test" if segment.split == "test" else "train") / segment.name
    pictures, events = folder / "images" / "left" / "distorted", folder / "events" / "left"
    tracks = folder / "object_detections" / "left"
    for place in (pictures, events, tracks):
        place.mkdir(parents=True)
    times = segment.times_us()
    (folder / "images" / "timestamps.txt").write_text("".join(f"{t}\n" for t in times.tolist()))
    _write_pictures(segment, len(times), pictures)
    shutil.copyfile(segment.events, events / "events.h5")
    np.save(tracks / "tracks.npy", dsec_tracks(segment.boxes()))
    return True


def dsec_tracks(boxes: npt.NDArray[np.void]) -> npt.NDArray[np.void]:
    """Return boxes (K,) with the fields, types and classes of DSEC-Detection."""
    tracks: npt.NDArray[np.void] = np.zeros(len(boxes), dtype=TRACK_DTYPE)
    for name in TRACK_DTYPE.names or ():
        tracks[name] = boxes[name]
    ours = np.array([CLASSES.index(name if name in CLASSES else "car") for name in KIND_NAMES.tolist()])
    tracks["class_id"] = ours[boxes["class_id"]]
    return tracks


def write_split(segments: list[SetSegment], out: Path) -> None:
    """Write which segments are for what."""
    import yaml

    named = {split: [s.name for s in segments if s.split == split] for split in ("train", "val", "test")}
    (out / "train_val_test_split.yaml").write_text(yaml.safe_dump(named, sort_keys=False))


def _write_pictures(segment: SetSegment, count: int, out: Path) -> None:
    import cv2

    with open_frames(segment.folder) as frames:
        if len(frames) != count:
            raise DataError(f"has {len(frames)} pictures and {count} times", segment.folder)
        for k in range(count):
            path = out / f"{k:06d}.png"
            own = frames.path / path.name  # pictures that are PNG already are taken as they are
            if own.is_file():
                shutil.copyfile(own, path)
            elif not cv2.imwrite(str(path), np.ascontiguousarray(frames.frame(k)[..., ::-1])):
                raise DataError("cannot be written", path)
