"""Rows of the model as tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.filters import box_sides, singer
from jeat_graph.smoothers.rows import ModelRows
from jeat_graph.tracking.classes import ClassTally

#: Sensors of which all combinations are listed beforehand.
_MOST_LISTED = 8
#: Position, velocity and acceleration, which stand side by side.
_MOTION = slice(singer.POSITION, singer.ACCELERATION + 1)


class ClassNames(NamedTuple):
    """The classes of a table.

    Attributes:
        names: by number, as the model has them.
        numbers: that they have for users, by name.
    """

    names: Sequence[str]
    numbers: dict[str, int]


class TableForm(NamedTuple):
    """What a table says beside its rows.

    Attributes:
        sensors: names of its sensors.
        places: where the model's sensors stand among these.
        called: the classes; None for a table without any.
        clip: width and height of the picture (px) at whose edge boxes end; None where they do not.
        least: probability of existence below which a row is left out.
    """

    sensors: tuple[str, ...]
    places: Places
    called: ClassNames | None
    clip: tuple[float, float] | None
    least: float


def table_of(rows: ModelRows, form: TableForm, instants: FloatArray | None = None) -> Trajectories:
    """Return rows of the model as a table.

    Args:
        rows: of the model.
        form: of the table.
        instants: at which there was a table, be it of no row (s).
    """
    sensors, places, called, clip, least = form
    t, ids, mean, variance, real, used, label, share = rows
    state, spread = mean.reshape(-1, 2, singer.MOTION), variance.reshape(-1, 2, singer.MOTION)
    sides, size = box_sides.corners(state), singer.box_size(state)
    if clip is not None:
        sides = np.clip(sides, 0.0, np.array([*clip, *clip]))
    classes = None
    if called is not None:
        # The last one is for those below 0.
        classes = np.array([*called.names, ""], dtype=np.str_)[label], np.where(label >= 0, share, np.nan)
    table = Trajectories(
        t=t,
        track_id=ids,
        boxes=np.concatenate([sides[:, :2], sides[:, 2:] - sides[:, :2]], axis=1),
        existence=real,
        mean=state[:, :, _MOTION].transpose(0, 2, 1).reshape(-1, 6),
        var=spread[:, :, _MOTION].transpose(0, 2, 1).reshape(-1, 6),
        used=places.bits(used),
        sensors=sensors,
        classes=None if classes is None else classes[0],
        class_probability=None if classes is None else classes[1],
        size_var=size**2 * spread[:, :, singer.LOG_SIZE],
        instants=instants,
        class_ids=(called.numbers or None) if called is not None else None,
    )
    left = (table.boxes[:, 2:] > 0.0).all(axis=1) & (table.existence >= least)
    return table if left.all() else table.take(np.flatnonzero(left))


class Places:
    """Where the sensors of the model stand among those of a table, for the bits of `used`.

    Args:
        at: (S,) places.
    """

    def __init__(self, at: Sequence[int]) -> None:
        self.at = np.array(at, dtype=np.int64)
        self._same = list(at) == list(range(len(at)))
        few = len(at) <= _MOST_LISTED
        self._listed = self._one_by_one(np.arange(1 << len(at), dtype=np.int64)) if few else None

    def bits(self, used: IntArray) -> IntArray:
        """Return the bits of sensors (N,) at their places in the table."""
        if self._same:
            return used
        return self._one_by_one(used) if self._listed is None else self._listed[used]

    def _one_by_one(self, used: IntArray) -> IntArray:
        out = np.zeros_like(used)
        for k, place in enumerate(self.at.tolist()):
            out |= (used >> k & 1) << place
        return out


def with_classes(rows: ModelRows, tally: ClassTally | None, names: Sequence[str]) -> ModelRows:
    """Return rows of tracks of the last step with what their votes say of their classes.

    Args:
        rows: of the model.
        tally: the votes; None for no classes.
        names: of the classes, by number.
    """
    if tally is None or not len(rows[1]):
        return rows
    called, share = tally.columns(rows[1])
    number = {name: k for k, name in enumerate(names)}
    label = np.array([number.get(name, -1) for name in called.tolist()], dtype=np.int64)
    t, ids, mean, variance, real, used, _, _ = rows
    return t, ids, mean, variance, real, used, label, np.nan_to_num(share)


def reported_table(
    rows: Callable[[], ModelRows],
    tally: ClassTally | None,
    form: TableForm,
    now: float | None,
) -> Trajectories:
    """Return the table of a step from what its engine reported.

    Args:
        rows: gives the rows of the model.
        tally: the votes for classes; None for no classes.
        form: of the table.
        now: time of the step (s); None before the first.
    """
    names = () if form.called is None else form.called.names
    return table_of(with_classes(rows(), tally, names), form, None if now is None else np.array([now]))
