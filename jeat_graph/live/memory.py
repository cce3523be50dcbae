"""What has come before, known by its content, in bounded memory.

Fingerprints of 64 bits are kept of all that came, as long as there are few. When there are more than fit,
only every other one is kept, by its own lowest bit, then one in four, and so on. So what is kept is a sample
of all that ever came, drawn by the content itself: of what belongs to the sample it is known for sure whether
it came before, of anything else nothing is known. A tracker that is started again tells by this whether its
input is given once more or a clock was set back.
"""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from jeat_graph.data.detections import Scan

#: So many fingerprints are kept at most.
CAPACITY = 8192
_BYTES = 8


class Memory:
    """A sample of the fingerprints of all that came.

    Args:
        whole: whether it is there from the beginning: only then what it does not know has never come.
    """

    def __init__(self, whole: bool = True) -> None:
        self._whole = whole
        self._level = 0
        self._kept: set[int] = set()

    def knows(self, fingerprint: int | None) -> bool | None:
        """Whether it has come: True or False for sure; None where nothing is known."""
        if fingerprint is None or not self._in_sample(fingerprint):
            return None
        if fingerprint in self._kept:
            return True
        return False if self._whole else None

    def note(self, fingerprint: int | None) -> None:
        """Take note of what has come; None is nothing."""
        if fingerprint is None or not self._in_sample(fingerprint):
            return
        self._kept.add(fingerprint)
        if len(self._kept) > CAPACITY:
            self._level += 1
            self._kept = {kept for kept in self._kept if self._in_sample(kept)}

    def _in_sample(self, fingerprint: int) -> bool:
        return fingerprint & ((1 << self._level) - 1) == 0

    def state(self) -> dict[str, Any]:
        """Return what `set_state` takes."""
        kept = np.sort(np.fromiter(self._kept, dtype=np.uint64, count=len(self._kept)))
        return {"whole": self._whole, "level": self._level, "kept": kept.view(np.int64)}

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned."""
        self._whole, self._level = state["whole"], state["level"]
        kept = np.asarray(state["kept"], dtype=np.int64).view(np.uint64)
        self._kept = set(kept.tolist())


def fingerprint_of(scan: Scan) -> int | None:
    """Return 64 bits of a scan: its sensor, its time, and its boxes to whole px.

    None of a scan that found nothing, which may well come twice: by a clock that counts frames from 0.
    """
    if not len(scan):
        return None
    boxes = np.rint(scan.boxes) + 0.0  # no negative zeros
    return fingerprint(scan.sensor.encode("utf-8", "replace"), np.float64(scan.t).tobytes(), boxes.tobytes())


def fingerprint(*parts: bytes) -> int:
    """Return 64 bits of some bytes."""
    digest = hashlib.blake2b(b"\0".join(parts), digest_size=_BYTES)
    return int.from_bytes(digest.digest(), "little")
