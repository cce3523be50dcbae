"""The detections of a recording so far, and which track of the causal pass took each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError
from jeat_graph.data.scan import trusted_scan
from jeat_graph.tracking.identities.passes import Pass

# So many scans are kept as they came before they become columns.
_SCANS_PER_PART = 4096


class IdentityLog:
    """What a tracker was given, for whoever decides afterwards who was who: some 100 bytes a detection."""

    def __init__(self) -> None:
        self._parts: list[tuple[Detections, Pass]] = []
        self._scans: list[Scan] = []
        self._camera: list[FloatArray] = []
        self._passes: list[Pass] = []

    def add(
        self, batch: Sequence[Scan], taken: Pass, camera: FloatArray, kept: BoolArray | None = None
    ) -> None:
        """Take down the scans of a step.

        Args:
            batch: the scans.
            taken: which tracks took their detections (M,), in the same order.
            camera: (2,) how far the camera's motion has taken what is at rest (px).
            kept: (M,) which of these count; None where all do. The others are left out.
        """
        self._camera.append(camera)
        batch, taken = counted(batch, taken, kept)
        self._scans += batch
        self._passes.append(taken)
        if len(self._scans) >= _SCANS_PER_PART:
            self._pack()

    def recording(self) -> tuple[Detections, Pass]:
        """Return all detections (N,), and the causal pass in their order."""
        self._pack()
        if len(self._parts) > 1:
            whole = Detections.concatenate([one for one, _ in self._parts])
            t, names = (np.concatenate(c) for c in zip(*(_rows(one) for one, _ in self._parts), strict=True))
            self._parts = [(whole, _joined([one for _, one in self._parts], _order_of(t, names)))]
        return self._parts[0] if self._parts else (Detections.from_scans([]), _joined([], np.zeros(0, int)))

    def camera(self) -> FloatArray:
        """Return how far the camera had moved at each of the T times of scans (T, 2) (px)."""
        return np.concatenate([np.zeros((0, 2)), *(one.reshape(-1, 2) for one in self._camera)])

    def state(self) -> dict[str, Any]:
        """Return what `from_state` takes, plain data and `Detections`."""
        detections, taken = self.recording()
        causal = {"assigned": taken.assigned, "real": taken.real}
        return {"detections": detections, **causal, "camera": self.camera()}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> IdentityLog:
        """Return the log that gave a state.

        Raises:
            DataError: none gave it.
        """
        log, taken = cls(), Pass(state["assigned"], state["real"])
        # Made again, so that scans are checked as those of a user.
        detections = Detections.from_scans(Scan(**vars(scan)) for scan in state["detections"].scans())
        camera, shape = state["camera"], (len(detections),)
        if camera.shape != (len(np.unique(detections.scan_t)), 2) or not np.isfinite(camera).all():
            raise DataError("is damaged: it does not say where the camera was at each time")
        if taken.assigned.shape != shape or taken.assigned.dtype != np.int64 or taken.real.shape != shape:
            raise DataError("is damaged: its detections are not those that tracks took")
        if (taken.assigned < 0).any() or not ((taken.real >= 0.0) & (taken.real <= 1.0)).all():
            raise DataError("is damaged: its detections were taken by no tracks")
        if detections.num_scans:
            log._parts, log._camera = [(detections, taken)], [camera]
        return log

    def _pack(self) -> None:
        if not self._scans:
            return
        sizes = [len(scan) for scan in self._scans]
        t = np.repeat([scan.t for scan in self._scans], sizes)
        names = np.repeat([scan.sensor for scan in self._scans], sizes)
        taken = _joined(self._passes, _order_of(t, names))
        self._parts.append((Detections.from_scans(self._scans), taken))
        self._scans, self._passes = [], []


def counted(batch: Sequence[Scan], taken: Pass, kept: BoolArray | None) -> tuple[list[Scan], Pass]:
    """Return the scans of a step and who took their detections (M,), without those that do not count."""
    if kept is None:
        return list(batch), taken
    ends = np.cumsum([len(scan) for scan in batch])
    scans = [_where(scan, own) for scan, own in zip(batch, np.split(kept, ends[:-1]), strict=True)]
    return scans, Pass(taken.assigned[kept], taken.real[kept])


def _where(scan: Scan, keep: BoolArray) -> Scan:
    """Return a scan with the boxes (M,) that a mask says."""
    classes = None if scan.classes is None else scan.classes[keep]
    embeddings = None if scan.embeddings is None else scan.embeddings[keep]
    box_std = None if scan.box_std is None else scan.box_std[keep]
    found = scan.boxes[keep], scan.scores[keep], classes, embeddings
    return trusted_scan(scan.t, scan.sensor, *found, scan.camera_motion, box_std)


def _rows(detections: Detections) -> tuple[Any, Any]:
    """Return time (N,) and sensor's name (N,) of each detection."""
    names = np.asarray(detections.sensors, dtype=np.str_)
    return detections.box_t, names[detections.box_sensor]


def _order_of(t: Any, names: Any) -> IntArray:
    """Return the order (N,) in which `Detections` has rows: by time, then sensor, else as they came."""
    return np.lexsort((np.unique(names, return_inverse=True)[1].reshape(-1), t))


def _joined(passes: Sequence[Pass], order: IntArray) -> Pass:
    assigned = np.concatenate([np.zeros(0, dtype=np.int64), *(one.assigned for one in passes)])
    real = np.concatenate([np.zeros(0), *(one.real for one in passes)])
    return Pass(assigned[order], real[order])
