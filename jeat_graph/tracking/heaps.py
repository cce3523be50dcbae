"""Boxes of a step that do not count, since far too many lie on one spot."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from jeat_graph.association import heaps
from jeat_graph.core import tracking as core
from jeat_graph.data.arrays import BoolArray
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import InputWarning
from jeat_graph.filters.model_constants import ModelConstants


class Heaps:
    """Finds them, and says once for each sensor that there were some.

    Args:
        engine: "reference" for the NumPy definition of which count; the core's else.
        constants: of the model.
    """

    def __init__(self, engine: str, constants: ModelConstants) -> None:
        self._engine, self._constants = engine, constants
        self._noted: set[str] = set()
        self._quiet = False

    def kept(self, batch: Sequence[Scan]) -> BoolArray | None:
        """Return which boxes (M,) of the scans, one after the other, count; None where all do."""
        if all(len(scan) <= self._constants.most_on_one_spot for scan in batch):
            return None
        parts = []
        for scan in batch:
            parts.append(self._of_scan(scan))
        if all(part is None for part in parts):
            return None
        return np.concatenate(
            [
                np.ones(len(scan), dtype=np.bool_) if part is None else part
                for scan, part in zip(batch, parts, strict=True)
            ]
        )

    def end(self) -> None:
        """Say nothing of any scan any more."""
        self._quiet = True

    def _of_scan(self, scan: Scan) -> BoolArray | None:
        if len(scan) <= self._constants.most_on_one_spot:
            return None
        sides = np.concatenate([scan.boxes[:, :2], scan.boxes[:, :2] + scan.boxes[:, 2:]], axis=1)
        kept_boxes = heaps.kept_boxes if self._engine == "reference" else core.kept_boxes
        kept = kept_boxes(sides, np.ascontiguousarray(scan.scores), self._constants)
        if len(kept) == len(scan):
            return None
        self._say(scan, len(kept))
        out = np.zeros(len(scan), dtype=np.bool_)
        out[kept] = True
        return out

    def _say(self, scan: Scan, kept: int) -> None:
        if self._quiet or scan.sensor in self._noted:
            return
        c = self._constants
        # Up from here: a scan, all scans, the tracker's `take_in`, `step` with its lock, and its caller.
        warnings.warn(
            f"sensor {scan.sensor!r}: of {len(scan)} boxes at t = {scan.t:g} s {len(scan) - kept} do not "
            f"count, and so from now on: at most {c.most_on_one_spot} count on one spot, {c.most_touching} "
            "that touch one box, those of the best scores; does the detector suppress what it finds twice "
            "(NMS)?",
            InputWarning,
            stacklevel=7,
        )
        self._noted.add(scan.sensor)
