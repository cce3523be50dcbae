"""The model's tracker to and from files, and back to an earlier moment."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self, cast

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.tracking.appearance import Appearances
from jeat_graph.tracking.classes import ClassTally
from jeat_graph.tracking.damage import refusing_damage
from jeat_graph.tracking.engine import Moment, StepBoxes, TrackEngine
from jeat_graph.tracking.identities.lagging import LagSmoother
from jeat_graph.tracking.identities.log import IdentityLog
from jeat_graph.tracking.input_watch import InputWatch
from jeat_graph.tracking.smoothed_instants import SmoothedInstants

if TYPE_CHECKING:
    from jeat_graph.tracking.model_tracker import ModelTracker


class ModelSnapshot(NamedTuple):
    """All that the next step of a tracker depends on.

    Attributes:
        moment: the engine's.
        sensors: names of those that had had a scan.
        classes: votes on the tracks' classes, or None.
        appearance: what the tracks look like, or None.
        order: (K,) places of the last step's boxes, as the model has them, among those given.
        given: how many these were.
        boxes: of the last step, for diagnostics.
    """

    moment: Moment
    sensors: tuple[str, ...]
    classes: ClassTally | None
    appearance: Appearances | None
    order: IntArray
    given: int
    boxes: StepBoxes

    def living(self) -> tuple[IntArray, int]:
        """Return the identities (N,) of the living tracks, and that of the next one to be born."""
        return self.moment.identities(), self.moment.born() + 1


class SavedModel:
    """A tracker's state to and from files; see `ModelTracker`."""

    if TYPE_CHECKING:
        config: Config
        constants: ModelConstants
        _model: TrackEngine
        _diagnostics: bool
        _finished: bool
        _watch: InputWatch
        _class_ids: dict[str, int]
        _called: list[str]
        _instants: SmoothedInstants
        _log: IdentityLog | None
        _lag: LagSmoother | None

        def __init__(
            self, config: Config, *, diagnostics: bool = False, constants: ModelConstants | None = None
        ) -> None:
            """Make a tracker."""

        def snapshot(self) -> ModelSnapshot:
            """Copy all that the next step depends on."""
            ...

        def restore(self, snapshot: ModelSnapshot) -> None:
            """Go back to a snapshot."""

    @property
    def can_save(self) -> bool:
        """Whether a run that was broken off can go on."""
        return self.not_saved_with is None

    @property
    def not_saved_with(self) -> str | None:
        """The setting with which a tracker is not saved, or None where it is."""
        return None if self._model.can_save else f"tracker.engine={self.config.tracker.engine}"

    def save(self, path: str | Path) -> None:
        """Write the whole state to a file (`.npz`), smoothers included, for `load` to go on from.

        This tracker and the loaded one give the same bytes from here on.

        Raises:
            JeatGraphError: the engine is not saved.
        """
        from jeat_graph.tracking.checkpoint import save_state

        save_state(path, self.config, self.state())

    @classmethod
    def load(cls, path: str | Path, config: Config | None = None) -> Self:
        """Return the tracker that was saved to a file; see `Tracker.load`."""
        from jeat_graph.tracking.checkpoint import load_plain_state

        kept, state = load_plain_state(path, config)
        with refusing_damage(path):
            return cls.from_state(kept, state)

    def state(self, snapshot: ModelSnapshot | None = None) -> dict[str, Any]:
        """Return what `from_state` takes: the state now, or at a snapshot, with the smoother's of now.

        Raises:
            JeatGraphError: the engine is not saved.
        """
        now = self.snapshot() if snapshot is None else snapshot
        return {
            "diagnostics": self._diagnostics,
            "finished": self._finished,
            "constants": _changed(self.constants),
            "model": dict(self._model.state(now.moment)),
            "sensors": list(now.sensors),
            "classes": now.classes,
            "appearance": now.appearance,
            "order": now.order,
            "given": now.given,
            "boxes": now.boxes,
            "class_ids": self._class_ids,
            "called": self._called,
            "instants": self._instants.state(),
            "log": None if self._log is None else self._log.state(),
            "lag": None if self._lag is None else self._lag.state(),
        }

    @classmethod
    def from_state(cls, config: Config, state: dict[str, Any]) -> Self:
        """Make a tracker of what `state` returned.

        Raises:
            DataError: no tracker can be in that state.
        """
        constants = _constants_of(state.get("constants", {}))
        tracker = cls(config, diagnostics=bool(state["diagnostics"]), constants=constants)
        model = tracker._model
        try:
            model.set_state(state["model"])
        except ValueError as error:
            raise DataError(f"is damaged: {error}") from None
        sensors, called = tuple(state["sensors"]), list(state["called"])
        if len(set(sensors)) != len(model.last_scans()) or not set(sensors) <= set(config.sensors):
            raise DataError("is damaged: its sensors are not those of its state")
        if not all(isinstance(name, str) for name in called):
            raise DataError("is damaged: names of classes are none")
        order, given, boxes = state["order"], state["given"], state["boxes"]
        _check_order(order, given, len(model.assigned()))
        _check_boxes(boxes, len(order) if state["diagnostics"] else 0, len(sensors))
        _check_tally(state["classes"], called)
        _check_appearance(state["appearance"], len(sensors))
        moment = model.snapshot()
        tracker.restore(
            ModelSnapshot(moment, sensors, state["classes"], state["appearance"], order, given, boxes)
        )
        tracker._finished, tracker._called = bool(state["finished"]), called
        if (tracker._log is None) != (state["log"] is None):
            raise DataError("is damaged: detections of the recording are missing")
        if tracker._log is not None:
            tracker._log = IdentityLog.from_state(state["log"])
        if (tracker._lag is None) != (state["lag"] is None):
            raise DataError("is damaged: what was decided with a lag is missing")
        if tracker._lag is not None:
            tracker._lag.set_state(state["lag"], cast("ModelTracker", tracker))
        tracker._class_ids = {str(name): int(number) for name, number in state["class_ids"].items()}
        _check_labels(state["model"], len(called))
        tracker._instants.set_state(state["instants"])
        if model.time() is not None:
            tracker._watch.end()
        return tracker


def _changed(constants: ModelConstants) -> dict[str, Any]:
    """Return the constants of the model that are not the usual ones, by name."""
    plain: dict[type, Callable[[Any], Any]] = {tuple: lambda values: tuple(map(float, values))}
    return {
        name: plain.get(type(usual), type(usual))(getattr(constants, name))
        for name, usual in vars(ModelConstants()).items()
        if getattr(constants, name) != usual
    }


def _constants_of(changed: Any) -> ModelConstants | None:
    """Return the constants of the model where some were changed."""
    usual = vars(ModelConstants())
    if not isinstance(changed, dict) or not set(changed) <= set(usual):
        raise DataError("is damaged: it has constants that the model has not")
    for name, value in changed.items():
        kind, numbers = type(usual[name]), value if isinstance(value, tuple) else (value,)
        same = type(value) is kind and (kind is not tuple or len(value) == len(usual[name]))
        if not same or not all(type(one) in (int, float) and math.isfinite(one) for one in numbers):
            raise DataError(f"is damaged: the constant {name} is none")
    return replace(ModelConstants(), **changed) if changed else None


def _check_order(order: Any, given: Any, count: int) -> None:
    good = _is_array(order, np.int64, (count,)) and isinstance(given, int) and len(np.unique(order)) == count
    if not good or given < count or not ((order >= 0) & (order < given)).all():
        raise DataError("is damaged: the order of boxes is none")


def _check_boxes(boxes: Any, count: int, sensors: int) -> None:
    good = isinstance(boxes, StepBoxes) and isinstance(boxes.t, float)
    good = good and _is_array(boxes.sensor, np.int64, (count,))
    good = good and _is_array(boxes.boxes, np.float64, (count, 4))
    good = good and bool(((boxes.sensor >= 0) & (boxes.sensor < sensors)).all())
    if not good or not np.isfinite(boxes.boxes).all():
        raise DataError("is damaged: the boxes of the last step are none")


def _check_tally(tally: Any, called: list[str]) -> None:
    if tally is None:
        return
    good = isinstance(tally, ClassTally) and isinstance(tally.names, np.ndarray)
    good = good and tally.names.dtype.kind == "U" and tally.names.ndim == 1 and _ascending(tally.track_id)
    good = good and _is_array(tally.weight, np.float64, (len(tally.track_id), len(tally.names)))
    if not good or not np.isfinite(tally.weight).all() or not set(tally.names.tolist()) <= set(called):
        raise DataError("is damaged: the votes on classes are none")


def _check_appearance(appearance: Any, sensors: int) -> None:
    if appearance is None:
        return
    good = (
        isinstance(appearance, Appearances)
        and _ascending(appearance.track_id)
        and isinstance(appearance.mean, np.ndarray)
    )
    good = good and isinstance(appearance.moments, np.ndarray) and len(appearance.moments) <= sensors
    shape = (len(appearance.track_id), len(appearance.moments), *appearance.mean.shape[2:]) if good else ()
    good = good and len(shape) == 3 and _is_array(appearance.mean, np.float64, shape)
    good = good and _is_array(appearance.moments, np.float64, (len(appearance.moments), 2, 3))
    if not good or not np.isfinite(appearance.mean).all() or not np.isfinite(appearance.moments).all():
        raise DataError("is damaged: what tracks look like is nothing of the kind")


def _is_array(values: Any, kind: type[np.generic], shape: tuple[int, ...]) -> bool:
    return isinstance(values, np.ndarray) and values.dtype == kind and values.shape == shape


def _ascending(ids: Any) -> bool:
    if not isinstance(ids, np.ndarray) or ids.dtype != np.int64 or ids.ndim != 1:
        return False
    return bool((np.diff(ids) > 0).all())


def _check_labels(model: dict[str, Any], classes: int) -> None:
    """Refuse numbers of classes that are not there."""
    for name in ("histories.label", "final.label"):
        if len(model[name]) and not -1 <= int(model[name].min()) <= int(model[name].max()) < classes:
            raise DataError("is damaged: classes are missing")
