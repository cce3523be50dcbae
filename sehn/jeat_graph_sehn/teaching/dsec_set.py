"""Labels as a data set in the layout of DSEC-Detection: events of what is masked are left out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.dsec_writer import EventWriter
from jeat_graph.io.events.indexed import open_indexed
from jeat_graph_sehn.simulation.layouts.dsec_det import CLASSES, TRACK_DTYPE
from jeat_graph_sehn.teaching.labels import TrackLabels
from jeat_graph_sehn.teaching.recordings import EventRecording

_US = 1e6
_PARTS = ("train/taught", "test/held-back")
_SPLIT = "train:\n- taught\nval: []\ntest:\n- held-back\n"


def write_dsec_set(parts: Sequence[TrackLabels], events: EventRecording, out: Path) -> None:
    """Write events and boxes of both parts.

    Args:
        parts: labels to learn from and to judge by, on the clock of the events.
        events: the recording.
        out: the folder, which is there.
    """
    for name, labels in zip(_PARTS, parts, strict=True):
        folder = out / name / "events" / "left"
        boxes = out / name / "object_detections" / "left"
        folder.mkdir(parents=True)
        boxes.mkdir(parents=True)
        np.save(boxes / "tracks.npy", tracks_of(labels))
        _write_events(labels, events, folder / "events.h5")
    (out / "train_val_test_split.yaml").write_text(_SPLIT, encoding="utf-8")


def tracks_of(labels: TrackLabels) -> npt.NDArray[np.void]:
    """Return the boxes that are asked for (K,), with the fields of DSEC-Detection, by time."""
    truth = labels.truth
    rows = np.flatnonzero(~truth.ignore)
    rows = rows[np.lexsort((truth.object_id[rows], truth.t[rows]))]
    found: npt.NDArray[np.void] = np.zeros(len(rows), dtype=TRACK_DTYPE)
    found["t"] = np.rint(truth.t[rows] * _US)
    for k, name in enumerate(("x", "y", "w", "h")):
        found[name] = truth.boxes[rows, k]
    found["class_id"] = CLASSES.index("car")
    found["class_confidence"], found["track_id"] = labels.weight[rows], truth.object_id[rows]
    return found


def _write_events(labels: TrackLabels, events: EventRecording, path: Path) -> None:
    """Write the events from the first to the last label, without those of masks."""
    frames = labels.truth.frame_times()
    edges = np.rint(np.concatenate([frames[:1], (frames[1:] + frames[:-1]) / 2.0, frames[-1:]]) * _US)
    file = open_indexed(events.path)
    assert file is not None  # it was opened so
    with file, EventWriter(path, events.size_px, "gzip") as writer:
        for k, t in enumerate(frames.tolist()):
            begin, end = max(int(edges[k]), 0), max(int(edges[k + 1]), 0)
            if end <= begin:
                continue
            now = labels.truth.t == t
            masks = labels.truth.boxes[now & labels.truth.ignore]
            asked = labels.truth.boxes[now & ~labels.truth.ignore]
            piece = file.between(begin, end)
            kept = ~within(piece, masks) | within(piece, asked)
            writer.append(
                EventArray.trusted(piece.t_us[kept], piece.x[kept], piece.y[kept], piece.polarity[kept]), end
            )


def within(events: EventArray, boxes: FloatArray) -> BoolArray:
    """Whether each event (N,) lies in any of some boxes (B, 4; left, top, width, height)."""
    found = np.zeros(len(events), dtype=bool)
    x, y = events.x + 0.5, events.y + 0.5
    for left, top, width, height in boxes.tolist():
        found |= (x >= left) & (x < left + width) & (y >= top) & (y < top + height)
    return found
