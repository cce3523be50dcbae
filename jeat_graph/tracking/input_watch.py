"""Looks at the first scans for slips that no single scan shows: units, corners, another picture."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import InputWarning
from jeat_graph.io.tables.time_units import LONGEST_STEP_S, likely_unit

#: Boxes after which a first opinion is formed, and after which the watch ends.
FIRST_BOXES, LAST_BOXES = 20, 200
#: Boxes after which corners that can be nothing else are reported.
CORNER_BOXES = 3
#: Scans of one sensor by which its step is judged.
STEP_SCANS = 6
# Share of box centres outside the picture above which its size must be another.
_MOST_OUTSIDE = 0.05
# Detectors let boxes reach over the edge by a little.
_OVER_EDGE = 1.1
# In shares of the picture nothing is larger than 1, but for a box that reaches over the edge.
_LARGEST_SHARE = 1.5
# Scatter of the sizes without the corners, over that of the corners, where the one are part of the other.
_FOLLOWS = 0.5


_counted: ContextVar[bool] = ContextVar("outside_counted", default=False)
#: The message about boxes that are no left, top, width, height.
CORNERS = (
    "boxes look like x1, y1, x2, y2, taken for left, top, width, height: name the columns so, or convert "
    'them (in Python format="xyxy" of Tracker.update, or Scan.from_xyxy)'
)


def look_like_corners(boxes: FloatArray, width: float, height: float) -> bool:
    """Whether boxes are most likely two corners each, taken for a corner and a size.

    Every size is then larger than its corner, and the boxes reach far over the picture; or, where the picture
    is as large as they reach, the sizes follow the corners wherever these go.

    Args:
        boxes: (M, 4) as they were given.
        width: of the picture (px).
        height: of the picture (px).
    """
    corner, size = boxes[:, :2], boxes[:, 2:]
    if not len(boxes) or not (size > corner).all():
        return False
    if ((corner + size).max(axis=0) > (_OVER_EDGE * width, _OVER_EDGE * height)).any():
        return True
    if len(boxes) < FIRST_BOXES:
        return False
    return bool(((size - corner).std(axis=0) < _FOLLOWS * corner.std(axis=0)).all())


def only_corners(boxes: FloatArray, width: float, height: float) -> bool:
    """Whether boxes (M, 4) cannot but be two corners each: as such they lie in the picture, else beyond it.

    Args:
        boxes: as they were given (px).
        width: of the picture (px).
        height: of the picture (px).
    """
    corner, far = boxes[:, :2], boxes[:, 2:]
    size = (width, height)
    fit = (far > corner).all() and (corner >= 0.0).all() and (far <= size).all()
    return bool(fit and ((corner + far).max(axis=0) > (_OVER_EDGE * width, _OVER_EDGE * height)).any())


#: The message about boxes in shares of the picture.
SHARES = "all boxes lie in [0, 1]: they must be in px, not in shares of the picture"


def look_like_shares(boxes: FloatArray) -> bool:
    """Whether boxes (M, 4) are most likely in shares of the picture: all lie in its first px."""
    return len(boxes) > 0 and float((boxes[:, :2] + boxes[:, 2:]).max()) <= _LARGEST_SHARE


@contextmanager
def outside_counted() -> Iterator[None]:
    """Within this a recording is tracked whose boxes outside the picture have been reported already."""
    token = _counted.set(True)
    try:
        yield
    finally:
        _counted.reset(token)


class InputWatch:
    """Warns, once for each kind of slip, with an `InputWarning`; then costs nothing any more.

    Args:
        config: what the scans should fit.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._boxes: list[FloatArray] = []
        self._count = 0
        self._opinion_at = FIRST_BOXES
        self._times: dict[str, list[float]] = {}
        self._newest: dict[str, float] = {}
        self._noted: set[str] = set()
        self._ended = False
        self._corners_checked = False

    def check(self, batch: Sequence[Scan]) -> None:
        """Take notice of the scans of one time; those that come again after a late one count once."""
        if self._ended:
            return
        for scan in batch:
            if scan.t <= self._newest.get(scan.sensor, -np.inf):
                continue
            self._newest[scan.sensor] = scan.t
            times = self._times.setdefault(scan.sensor, [])
            if len(times) < STEP_SCANS:
                times.append(scan.t)
                if len(times) == STEP_SCANS:
                    self._judge_step(scan.sensor, np.array(times))
            if self._count < LAST_BOXES and len(scan.boxes):
                self._boxes.append(np.array(scan.boxes))
                self._count += len(scan.boxes)
        if not self._corners_checked and self._count >= CORNER_BOXES:
            self._corners_checked = True
            first = np.concatenate(self._boxes)
            if only_corners(first, self._config.image.width, self._config.image.height):
                self._say("corners", CORNERS)
        if self._count >= self._opinion_at and self._boxes:
            self._judge_boxes(np.concatenate(self._boxes))
            if self._opinion_at == LAST_BOXES:
                self._boxes = []
            self._opinion_at = LAST_BOXES

    def know(self, config: Config) -> None:
        """Go on by another configuration: of a tracker that has met another sensor."""
        self._config = config

    def end(self) -> None:
        """Look at nothing any more: for a tracker that goes on, whose first scans were looked at."""
        self._ended = True

    def _judge_step(self, sensor: str, times: FloatArray) -> None:
        step = float(np.median(np.diff(times)))
        declared = self._config.sensors.get(sensor)
        known_slow = declared is not None and declared.rate_hz * step < 2.0
        if step < LONGEST_STEP_S or known_slow:
            return
        unit = likely_unit(step)
        guess = "are the times in s?"
        if unit is not None:
            guess = f"are the times in {unit}? They must be in s (on the command line: --time-unit {unit})"
        self._say("step", f"sensor {sensor!r} has a median step of {step:.6g} s: {guess}")

    def _judge_boxes(self, boxes: FloatArray) -> None:
        width, height = self._config.image.width, self._config.image.height
        if look_like_shares(boxes):
            self._say("shares", SHARES)
        elif look_like_corners(boxes, width, height):
            self._say("corners", CORNERS)
        else:
            centre = boxes[:, :2] + 0.5 * boxes[:, 2:]
            outside = int(((centre < 0.0) | (centre > (width, height))).any(axis=1).sum())
            if outside > _MOST_OUTSIDE * len(boxes) and not _counted.get():
                given = self._config.input.picture == "given"
                advice = (
                    "is that its size, and are boxes left, top, width, height?"
                    if given
                    else "give its size: --image WIDTHxHEIGHT (in Python image=(width, height))"
                )
                self._say(
                    "outside",
                    f"{outside} of the first {len(boxes)} box centres lie outside the picture of {width:g} x "
                    f"{height:g} px; {advice}",
                )

    def _say(self, kind: str, text: str) -> None:
        if kind not in self._noted:
            self._noted.add(kind)
            # Up from here: a judgement, `check`, the tracker's `take_in`, `step`, its lock, and its caller.
            warnings.warn(text, InputWarning, stacklevel=7)
