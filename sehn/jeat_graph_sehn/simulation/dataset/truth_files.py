"""Gathers the truth of one segment frame by frame and writes it in all formats."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.io.exports.coco_writer import coco_annotations, coco_categories, coco_images, write_coco
from jeat_graph.io.exports.prophesee_writer import write_array
from jeat_graph.io.media.video import VIDEO_FILES
from jeat_graph.io.tables.rounding import round_decimals
from jeat_graph.io.tables.table_writer import write_columns
from jeat_graph.io.tables.truth_io import write_truth
from jeat_graph_sehn.simulation.dataset.layout import BOXES, COCO, SEGMENTS, TRUTH, VEHICLES, segment_name
from jeat_graph_sehn.simulation.segment import FrameTruth
from jeat_graph_sehn.simulation.world.vehicles import KIND_NAMES

_US_PER_S = 1e6
_DIGITS = 6  # of all columns in text
_TIGHT = ("tight_left", "tight_top", "tight_width", "tight_height")
_CONTRAST_DIGITS = 2
_FAINT = 2.0  # contrast-to-noise below which a vehicle hardly stands out
_SIZE = ("length_m", "width_m", "height_m")
_POSE = ("x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad")
_VELOCITY = ("vx_mps", "vy_mps", "vz_mps")


class SegmentTruth:
    """Gathers the truth of a segment's frames.

    Args:
        camera_m: (3,) place of the camera in the truth's world axes, for distances; None if not known.
        min_visible: vehicles of which less can be seen are marked `ignore`.
    """

    def __init__(self, camera_m: FloatArray | None, min_visible: float) -> None:
        self._camera_m = camera_m
        self._min_visible = min_visible
        self._times: list[int] = []
        self._frames: list[FrameTruth] = []

    def append(self, t_us: int, truth: FrameTruth) -> None:
        """Add a frame; boxes without area are passed over.

        Raises:
            DataError: an identity occurs twice, or a class is not known.
        """
        if len(np.unique(truth.object_id)) != len(truth):
            raise DataError(f"frame at {t_us} µs: a vehicle is there twice")
        unknown = ~np.isin(truth.class_name, KIND_NAMES)
        if unknown.any():
            raise DataError(f"frame at {t_us} µs: class {str(truth.class_name[unknown][0])!r} is not known")
        self._times.append(t_us)
        self._frames.append(_take(truth, np.all(truth.boxes[:, 2:] > 0.0, axis=1)))

    def times_us(self) -> IntArray:
        """Times of the frames (F,) in µs."""
        return np.array(self._times, dtype=np.int64)

    def write(self, folder: Path, index: int, size_px: tuple[int, int], video: str) -> dict[str, int]:
        """Write `gt.csv`, `vehicles.csv`, `boxes.npy` and `coco.json`.

        Args:
            folder: where to.
            index: number of the segment.
            size_px: width and height of the pictures.
            video: as in `Protocol`, for the names of the pictures in `coco.json`.

        Returns:
            Counts: boxes, of which ignored, vehicles, and boxes that are asked for but hardly stand out.
        """
        t_us = self.times_us()
        frame = np.repeat(np.arange(len(t_us)), [len(truth) for truth in self._frames])
        rows = {name: self._column(name) for name in FrameTruth.__dataclass_fields__}
        row_t, ids = t_us[frame] / _US_PER_S, rows["object_id"].astype(np.int64)
        boxes = round_decimals(rows["boxes"], _DIGITS)
        visible = round_decimals(rows["visible"], _DIGITS)
        ignore = (visible < self._min_visible) | rows["ignore"].astype(bool)
        pose = round_decimals(rows["pose"], _DIGITS)
        distance = None
        if self._camera_m is not None:
            distance = round_decimals(np.linalg.norm(pose[:, :3] - self._camera_m, axis=1), _DIGITS)
        write_truth(
            GroundTruth(
                t=row_t,
                object_id=ids,
                boxes=boxes,
                motion=round_decimals(rows["motion"], _DIGITS),
                ignore=ignore,
                classes=rows["class_name"],
                distance=distance,
                frames=t_us / _US_PER_S,
            ),
            folder / TRUTH,
        )
        columns: dict[str, Any] = {"t": row_t, "object_id": ids, "class": rows["class_name"]}
        columns["visible"] = visible
        columns |= _named(_TIGHT, rows["tight"])
        columns["contrast"] = round_decimals(rows["contrast"], _CONTRAST_DIGITS)
        columns |= _named(_SIZE, rows["size"]) | _named(_POSE, pose) | _named(_VELOCITY, rows["velocity"])
        write_columns(columns, folder / VEHICLES)
        kind = np.argmax(rows["class_name"][:, None] == KIND_NAMES, axis=1)
        # These formats have no `ignore`: what cannot be seen is left out, or it would count as missed.
        asked = ~ignore
        write_array(folder / BOXES, t_us[frame][asked], boxes[asked], kind[asked], ids[asked])
        name = segment_name(index)
        write_coco(
            folder / COCO,
            coco_images(name, index, t_us, size_px, _frame_names(name, len(t_us), video)),
            coco_annotations(index, frame, boxes, kind, ids, visible, ignore),
            coco_categories(KIND_NAMES),
        )
        return {
            "boxes": len(ids),
            "ignored": int(ignore.sum()),
            "vehicles": len(np.unique(ids)),
            "faint": int((rows["contrast"][asked] < _FAINT).sum()),
        }

    def _column(self, name: str) -> np.typing.NDArray[Any]:
        parts = [getattr(truth, name) for truth in self._frames]
        return np.concatenate(parts) if parts else getattr(_empty_truth(), name)


def _frame_names(segment: str, count: int, video: str) -> list[str]:
    """Return the pictures' paths from the data set's root; in a video they are numbered after a `#`."""
    file = f"{SEGMENTS}/{segment}/{VIDEO_FILES[video]}"
    return [f"{file}/{k:06d}.png" if video == "png" else f"{file}#{k}" for k in range(count)]


def _named(names: tuple[str, ...], values: FloatArray) -> dict[str, FloatArray]:
    rounded = round_decimals(values, _DIGITS)
    return {name: rounded[:, k] for k, name in enumerate(names)}


def _take(truth: FrameTruth, rows: np.typing.NDArray[np.bool_]) -> FrameTruth:
    return FrameTruth(**{name: getattr(truth, name)[rows] for name in FrameTruth.__dataclass_fields__})


def _empty_truth() -> FrameTruth:
    return FrameTruth(
        object_id=np.zeros(0, dtype=np.int64),
        class_name=np.zeros(0, dtype="U5"),
        boxes=np.zeros((0, 4)),
        visible=np.zeros(0),
        motion=np.zeros((0, 6)),
        size=np.zeros((0, 3)),
        pose=np.zeros((0, 6)),
        velocity=np.zeros((0, 3)),
    )
