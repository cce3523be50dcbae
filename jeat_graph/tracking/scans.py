"""Scans as callers give them, checked and turned into what a step takes."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

import numpy.typing as npt

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
