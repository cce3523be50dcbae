"""Scans as callers give them, checked and turned into what a step takes."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.box_std import join_std, known_std
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError, TimeOrderError, UnknownSensorError

ScanLike: TypeAlias = (
    Scan
    | tuple[float, str, npt.ArrayLike, npt.ArrayLike]
    | tuple[float, str, npt.ArrayLike, npt.ArrayLike, Any]
    | tuple[float, str, npt.ArrayLike, npt.ArrayLike, Any, Any]
)

#: Parts of a scan that is given as a tuple; classes and embeddings may be left out.
_LEAST, _MOST = 4, 6
_TAKEN = "step takes a Scan, a tuple (t, sensor, boxes, scores), or a sequence of these"


def as_scans(scans: Any) -> list[Scan]:
    """Return one or more scans of one and the same time as a list.

    Raises:
        DataError: what is no scan, or boxes or scores that are not valid.
        TimeOrderError: scans of several times.
    """
    batch = _listed(scans)
    if any(scan.t != batch[0].t for scan in batch):
        raise TimeOrderError("the scans of one step must have one and the same time")
    return batch


class Gathered(NamedTuple):
    """The boxes of scans of one time, sensor by sensor, those that count.

    Attributes:
        sensors: (K,) numbers of the sensors that have a scan, ascending.
        numbers: (K,) of boxes of each.
        boxes: (M, 4) left, top, width, height (px); perhaps the scan's own, not to be written to.
        scores: (M,) of them; the same.
        box_std: (M, 4) standard deviations of their sides (px), NaN where unknown; None where all are.
        order: (M,) which of the boxes given, one scan after the other, each is.
    """

    sensors: IntArray
    numbers: IntArray
    boxes: FloatArray
    scores: FloatArray
    box_std: FloatArray | None
    order: IntArray


def gather(batch: Sequence[Scan], codes: Sequence[int], kept: BoolArray | None) -> Gathered:
    """Put the boxes of scans of one time in order; several scans of one sensor are one.

    Args:
        batch: the scans.
        codes: number of each one's sensor.
        kept: which of their boxes count, one scan after the other; None for all.
    """
    if len(batch) == 1 and kept is None:
        (scan,) = batch
        count = len(scan)
        places = np.arange(count, dtype=np.int64)
        found = scan.boxes, scan.scores, known_std(scan.box_std)
        return Gathered(np.array(codes), np.array([count]), *found, places)
    sensor = sensors_of(batch, codes)
    order = np.argsort(sensor, kind="stable")
    order = order if kept is None else order[kept[order]]
    scanning = np.array(sorted(set(codes)), dtype=np.int64)
    boxes = np.concatenate([scan.boxes for scan in batch])[order]
    scores = np.concatenate([scan.scores for scan in batch])[order]
    numbers = np.bincount(sensor[order], minlength=max(codes) + 1)[scanning].astype(np.int64)
    std = join_std([scan.box_std for scan in batch], [len(scan) for scan in batch])
    return Gathered(scanning, numbers, boxes, scores, None if std is None else std[order], order)


def sensors_of(batch: Sequence[Scan], codes: Sequence[int]) -> IntArray:
    """Return the number of each box's sensor (M,), one scan after the other."""
    return np.repeat(codes, [len(scan) for scan in batch]).astype(np.int64)


def _listed(scans: Any) -> list[Scan]:
    if isinstance(scans, Scan):
        return [scans]
    if isinstance(scans, (tuple, list)) and len(scans) > 1 and isinstance(scans[1], str):
        return [_scan_of(scans)]
    if not isinstance(scans, Iterable) or isinstance(scans, (str, dict)):
        raise _refusal(scans)
    out = [_scan_of(scan) for scan in scans]
    if not out:
        raise DataError(f"a step has at least one scan, also where nothing was found; {_TAKEN}")
    return out


def _scan_of(scan: Any) -> Scan:
    if isinstance(scan, Scan):
        return scan
    if isinstance(scan, (tuple, list)) and _LEAST <= len(scan) <= _MOST and isinstance(scan[1], str):
        return Scan(*scan)
    raise _refusal(scan)


def _refusal(scan: Any) -> DataError:
    count = f" of {len(scan)}" if isinstance(scan, (tuple, list)) else ""
    return DataError(f"{_TAKEN}, not a {type(scan).__name__}{count}; boxes alone are for Tracker.update")


def sensor_index(name: str, names: Sequence[str]) -> int:
    """Return the place of a sensor among the names of all.

    Raises:
        UnknownSensorError: it is not among them.
    """
    if name in names:
        return names.index(name)
    near = difflib.get_close_matches(name, names, 1)
    hint = (
        f"did you mean {near[0]!r}?"
        if near
        else f"declared: {', '.join(names)}; declare it with --set 'sensors.{name}={{rate_hz: 20}}' "
        '(in Python load_config("default", [...]) of the same text)'
    )
    raise UnknownSensorError(f"sensor {name!r} is not declared in the configuration; {hint}")


def surest_motion(batch: Sequence[Scan]) -> FloatArray | None:
    """Return the camera's motion (11,) of the scan that knows it best; None if none does."""
    measured = [scan.camera_motion for scan in batch if scan.camera_motion is not None]
    return min(measured, key=lambda one: float(one[7] + one[8])) if measured else None
