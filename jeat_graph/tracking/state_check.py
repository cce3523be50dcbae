"""Whether the state of a tracker, read from a file, is one that a tracker can be in.

A file may have been made by a program that was broken, or by hand. A covariance of zero, a place that is no
number or an identity given out twice would go into every answer from there on.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.config.kernel_form import kernel_model
from jeat_graph.config.schema import Config
from jeat_graph.data.errors import DataError
from jeat_graph.tracking.compaction import allocate
from jeat_graph.tracking.snapshot import Snapshot
from jeat_graph.tracking.state import start_scene

# These may be infinite: what never happened is infinitely long ago, and a field without boxes has no ends.
_MAY_BE_INFINITE = frozenset(
    ("rest_since", "last_box", "seen_apart", "t_missed", "last_look", "first_look", "field")
)
_COVARIANCES = ("cov", "size_cov", "jerk_cov", "size_trial_cov")
_PROBABILITIES = frozenset(
    ("existence", "p_detect", "hidden", "worth", "jerk_weight", "size_weight", "borne_out", "trust")
) | {"blind", "unproven", "vain", "gap_share"}
_POSITIVE = ("scale",)
_ROUNDING = 1e-6  # by how much a probability may be off, and a variance relative to the largest


def checked_snapshot(snapshot: Snapshot, config: Config) -> Snapshot:
    """Return a snapshot if a tracker can be in that state.

    Raises:
        DataError: says what cannot be.
    """
    t, count = snapshot.t, snapshot.num_tracks
    if t is not None and not (isinstance(t, float) and math.isfinite(t)):
        raise DataError(f"is damaged: the time is {t!r}")
    sensors, scene = _templates(config)
    _check_alike(snapshot.tracks, sensors, count)
    _check_alike(snapshot.scene, scene, None)
    ids = snapshot.tracks.track_id
    if not isinstance(snapshot.next_id, int) or np.any(
        np.diff(np.concatenate([[0], ids, [snapshot.next_id]])) < 1
    ):
        raise DataError("is damaged: identities are not those that were given out")
    for state in (snapshot.tracks, snapshot.scene):
        for name, values in state._asdict().items():
            _check_values(name, values)
    return snapshot


def made_with(kind: type[Any]) -> frozenset[str]:
    """Return the names of the attributes that a class's `__init__` sets, which each of its objects has."""
    import dis

    for one in kind.__mro__:
        function: Any = vars(one).get("__init__")
        if hasattr(function, "__code__"):
            steps = dis.get_instructions(function)
            return frozenset(str(step.argval) for step in steps if step.opname == "STORE_ATTR")
    return frozenset()


class _Template(NamedTuple):
    """Kinds and shapes of arrays by name; of arrays with a row a track, those of a row."""

    kinds: dict[str, np.dtype[Any]]
    shapes: dict[str, tuple[int, ...]]


def _templates(config: Config) -> tuple[_Template, _Template]:
    model = kernel_model(config)
    errors, densities = (
        len(model.sensors.correlation_time_s),
        (config.motion.densities, config.size.densities),
    )
    tracks = allocate(0, len(config.sensor_names), errors, *densities)
    scene = start_scene(model.sensors, config)
    return _template(tracks, 1), _template(scene, 0)


def _template(state: Any, skipped: int) -> _Template:
    arrays = state._asdict()
    return _Template(
        {name: array.dtype for name, array in arrays.items()},
        {name: array.shape[skipped:] for name, array in arrays.items()},
    )


def _check_alike(state: Any, template: _Template, rows: int | None) -> None:
    for name, values in state._asdict().items():
        shape = template.shapes[name] if rows is None else (rows, *template.shapes[name])
        if (
            not isinstance(values, np.ndarray)
            or values.dtype != template.kinds[name]
            or values.shape != shape
        ):
            raise DataError(f"is damaged: {name} is no array of the shape {shape}")


def _check_values(name: str, values: npt.NDArray[Any]) -> None:
    """Refuse numbers that an array of that name cannot hold."""
    if values.dtype.names is not None:
        for field in values.dtype.names:
            _check_values(field, values[field])
        return
    if values.dtype.kind != "f":
        return
    good = ~np.isnan(values) if name in _MAY_BE_INFINITE else np.isfinite(values)
    if name in _PROBABILITIES:
        good &= (values >= -_ROUNDING) & (values <= 1.0 + _ROUNDING)
    if name in _POSITIVE:
        good &= values > 0.0
    if not good.all():
        raise DataError(f"is damaged: {name} holds {values[~good].flat[0]}")
    if name in _COVARIANCES and values.size:
        _check_covariances(name, values)


def _check_covariances(name: str, values: npt.NDArray[Any]) -> None:
    """Refuse what is no covariance: not symmetric, or with a variance that is not positive."""
    least = np.linalg.eigvalsh(values)[..., 0]
    largest = np.abs(values).max(axis=(-1, -2))
    lopsided = np.abs(values - np.swapaxes(values, -1, -2)).max(axis=(-1, -2)) > _ROUNDING * largest
    if np.any(lopsided | (largest <= 0.0) | (least < -_ROUNDING * largest)):
        raise DataError(f"is damaged: {name} holds what is no covariance")
