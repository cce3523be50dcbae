"""Trajectory tables: estimates of many tracks at many times, in columns.

The causal table of a run, its smoothed table and the tracks of one moment are all of this type.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray, TextArray
from jeat_graph.data.class_columns import check_classes, join_classes
from jeat_graph.data.errors import DataError
from jeat_graph.data.to_supervision import OwnDetections
from jeat_graph.data.views import TrajectoryViews


@dataclass(frozen=True, eq=False, repr=False)
class Trajectories(TrajectoryViews):
    """Estimates of tracks, one row a track and time.

    Attributes:
        t: (N,) time (s).
        track_id: (N,) identity, never reused within a run.
        boxes: (N, 4) left, top, width, height (px), clipped to the picture if its size is known.
        existence: (N,) probability that the track is a vehicle.
        mean: (N, 6) x, y, vx, vy, ax, ay of the box centre (px, px/s, px/s²), not clipped.
        var: (N, 6) variances of `mean`.
        used: (N,) bit k is set where a detection of `sensors[k]` was used at `t`; 0 where the track coasts:
            `take(used > 0)` has the rows that a detector saw.
        sensors: names of the sensors of the whole table, at most 63; this is no column. `sensor_text()` has
            the names row by row.
        classes: (N,) class that most of the track's detections so far name, weighed by their scores; empty
            text where none names any. None where no detection of the recording has a class.
        class_probability: (N,) share of those scores that speak for it, NaN where it is unknown; or None.
        size_var: (N, 2) variances of width and height, those of the whole box, not of what the picture leaves
            of it (px²); NaN where they are unknown, as all are where nothing is given.
        instants: (I,) all the times (s) at which the tracker gave output, ascending, those too at which it
            reported nothing; or None where that is not known, as of a data frame.
        class_ids: number of each class, as detectors gave it, by its name; or None where they gave none.
        causal_id: (N,) where identities were decided again, that of the causal table's track whose detection
            was the last up to this row; else None.
        identity_probability: (N,) that this row is of the object that the identity is mostly of; or None.
        own: after `Tracker.update`, the user's detections with the tracks that took them; or None.

    Raises:
        DataError: if the columns differ in length or shape.
    """

    t: FloatArray
    track_id: IntArray
    boxes: FloatArray
    existence: FloatArray
    mean: FloatArray
    var: FloatArray
    used: IntArray
    sensors: tuple[str, ...] = ()
    classes: TextArray | None = None
    class_probability: FloatArray | None = None
    size_var: FloatArray = None  # type: ignore[assignment]  # filled in below
    instants: FloatArray | None = None
    class_ids: Mapping[str, int] | None = None
    own: OwnDetections | None = None
    causal_id: IntArray | None = None
    identity_probability: FloatArray | None = None

    def __post_init__(self) -> None:
        n = len(self.t)
        if self.size_var is None:
            object.__setattr__(self, "size_var", np.full((n, 2), np.nan))
        for name, width in (("boxes", 4), ("mean", 6), ("var", 6), ("size_var", 2)):
            if getattr(self, name).shape != (n, width):
                raise DataError(f"{name} must have shape ({n}, {width}), not {getattr(self, name).shape}")
        for name in ("track_id", "existence", "used"):
            if getattr(self, name).shape != (n,):
                raise DataError(f"{name} must have shape ({n},), not {getattr(self, name).shape}")
        check_classes(n, self.classes, self.class_probability)
        for name in DECIDED:
            column = getattr(self, name)
            if column is not None and column.shape != (n,):
                raise DataError(f"{name} must have shape ({n},), not {column.shape}")
        if (self.causal_id is None) != (self.identity_probability is None):
            raise DataError("causal_id and identity_probability go together: give both or neither")

    def __len__(self) -> int:
        return len(self.t)

    @staticmethod
    def empty(sensors: tuple[str, ...] = ()) -> Trajectories:
        """Return a table without rows."""
        return Trajectories(
            t=np.zeros(0),
            track_id=np.zeros(0, dtype=np.int64),
            boxes=np.zeros((0, 4)),
            existence=np.zeros(0),
            mean=np.zeros((0, 6)),
            var=np.zeros((0, 6)),
            used=np.zeros(0, dtype=np.int64),
            sensors=sensors,
        )

    @staticmethod
    def concatenate(parts: Sequence[Trajectories]) -> Trajectories:
        """Stack tables, in the order given; the result names the sensors of all.

        Where one that has rows does not know its instants, the whole does not.
        """
        if not parts:
            return Trajectories.empty()
        if any(part.sensors != parts[0].sensors for part in parts):
            names = tuple(sorted({name for part in parts for name in part.sensors}))
            parts = [_naming(part, names) for part in parts]
        stacked: dict[str, Any] = {
            name: np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS
        }
        ids: dict[str, int] = {}
        for part in parts:
            ids |= part.class_ids or {}
        classes, probability = join_classes([(len(p), p.classes, p.class_probability) for p in parts])
        filled = [part for part in parts if len(part)] or parts
        if all(part.causal_id is not None for part in filled):
            stacked |= {name: np.concatenate([getattr(part, name) for part in filled]) for name in DECIDED}
        known = [part.instants for part in parts if len(part) or part.instants is not None]
        given = [at for at in known if at is not None]
        return Trajectories(
            **stacked,
            sensors=parts[0].sensors,
            classes=classes,
            class_probability=probability,
            instants=np.unique(np.concatenate(given)) if given and len(given) == len(known) else None,
            class_ids=ids or None,
        )

    def take(self, rows: npt.ArrayLike) -> Self:
        """Return the rows chosen by an index or mask array."""
        index = np.asarray(rows)
        columns: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        del columns["instants"]  # no column: the tracker ran at these times, whatever rows are taken
        arrays = {name: c[index] for name, c in columns.items() if isinstance(c, np.ndarray)}
        taken = replace(self, **arrays)
        return taken if self.own is None else replace(taken, own=self.own.of(taken.track_id))

    def sensor_text(self) -> list[str]:
        """Names of the sensors used in each row, joined by `|`; empty where the track coasted."""
        text = {
            int(mask): "|".join(name for k, name in enumerate(self.sensors) if mask >> k & 1)
            for mask in np.unique(self.used)
        }
        return [text[int(mask)] for mask in self.used]


def _naming(table: Trajectories, sensors: tuple[str, ...]) -> Trajectories:
    """Return a table that names more sensors, among them its own.

    Raises:
        DataError: more than a table can name.
    """
    if len(sensors) > MOST_SENSORS:
        raise DataError(f"a table names at most {MOST_SENSORS} sensors, and these name {len(sensors)}")
    used = np.zeros(len(table), dtype=np.int64)
    for k, name in enumerate(table.sensors):
        used |= (table.used >> k & 1) << sensors.index(name)
    return replace(table, used=used, sensors=sensors)


#: Bits of `used`.
MOST_SENSORS = 63
#: Names of the columns that a table has where identities were decided again.
DECIDED = ("causal_id", "identity_probability")
#: Names of the columns that every table has.
COLUMNS = ("t", "track_id", "boxes", "existence", "mean", "var", "used", "size_var")


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """True boxes of objects, one row an object and time.

    Attributes:
        t: (N,) time (s).
        object_id: (N,) identity.
        boxes: (N, 4) left, top, width, height (px).
        motion: (N, 6) x, y, vx, vy, ax, ay of the box centre (px, px/s, px/s²), or None if not known.
        ignore: (N,) true where the object is neither to be found nor to be held against a track.
        classes: (N,) class names, or None.
        distance: (N,) distance from the camera (m), or None.
        frames: (T,) all the times at which truth was recorded, also those without any object.
        truncation: (N,) how far the picture's edge cuts the object: 0 not at all (KITTI's numbers), or None.
        occlusion: (N,) how far others hide it: 0 not at all, 3 unknown (KITTI's numbers), or None.
    """

    t: FloatArray
    object_id: IntArray
    boxes: FloatArray
    motion: FloatArray | None
    ignore: BoolArray
    classes: TextArray | None = None
    distance: FloatArray | None = None
    frames: FloatArray | None = None
    truncation: FloatArray | None = None
    occlusion: FloatArray | None = None

    def __post_init__(self) -> None:
        n = len(self.t)
        if self.boxes.shape != (n, 4) or self.object_id.shape != (n,) or self.ignore.shape != (n,):
            raise DataError("the columns of the truth differ in length")
        if self.motion is not None and self.motion.shape != (n, 6):
            raise DataError(f"motion must have shape ({n}, 6), not {self.motion.shape}")

    def __len__(self) -> int:
        return len(self.t)

    def frame_times(self) -> FloatArray:
        """Times at which the truth was recorded, ascending (T,)."""
        return np.unique(self.t) if self.frames is None else self.frames
