"""Chosen pictures of a video with the labels at their times."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.io.media.video import RgbImage, open_frames
from jeat_graph_sehn.teaching.drawn_truth import WeighedTruth
from jeat_graph_sehn.teaching.labels import TrackLabels
from jeat_graph_sehn.teaching.recordings import chosen_frames
from jeat_graph_sehn.training.truth_at import TrueBoxes

#: At most so many pictures of a part, at least so far apart (s): neighbours are almost one picture.
MOST_PICTURES, PICTURES_APART_S = 1000, 0.2
_GREY = 114


@dataclass(frozen=True, eq=False)
class Stills:
    """Chosen pictures of one part of a recording.

    Attributes:
        video: where they are.
        numbers: of the frames, ascending.
        times: (K,) of each (s).
        truth: labels by time.
    """

    video: Path
    numbers: list[int]
    times: FloatArray
    truth: WeighedTruth

    def boxes(self, index: int) -> tuple[TrueBoxes, FloatArray]:
        """Return the boxes of a picture, and their weights (G,)."""
        t = float(self.times[index])
        found = self.truth.at(t)
        return found, self.truth.weights(found.object_id, t)


def stills_of(
    labels: TrackLabels, video: Path, most: int = MOST_PICTURES, apart_s: float = PICTURES_APART_S
) -> Stills:
    """Choose pictures of the time of labels.

    Args:
        labels: of one part of the recording.
        video: a video, or folder of pictures.
        most: at most so many.
        apart_s: at least so far apart (s).
    """
    truth = WeighedTruth(labels)
    with open_frames(video) as frames:
        times = frames.times_s
    numbers = chosen_frames(times, (float(truth.times[0]), float(truth.times[-1])), most, apart_s)
    return Stills(video, numbers, times[numbers], truth)


def painted(picture: RgbImage, truth: TrueBoxes) -> RgbImage:
    """Return a picture (H, W, 3) in which what is masked is grey, save where something is asked for."""
    mask = np.zeros(picture.shape[:2], dtype=bool)
    for ignored in (True, False):
        for left, top, right, bottom in truth.corners[truth.ignored == ignored].tolist():
            rows = slice(max(int(np.floor(top)), 0), max(int(np.ceil(bottom)), 0))
            columns = slice(max(int(np.floor(left)), 0), max(int(np.ceil(right)), 0))
            mask[rows, columns] = ignored
    out = picture.copy()
    out[mask] = _GREY
    return out
