"""Opens the frames that are detected in, with the times that were asked for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.detection.request import DetectRequest

if TYPE_CHECKING:
    from jeat_graph.io.media.video import FrameSource


def frames_of(request: DetectRequest) -> FrameSource:
    """Open the frames of a request.

    Raises:
        DataError: they cannot be read, or nothing says when they were taken.
    """
    from jeat_graph.io.media.video import open_frames

    assert request.frames is not None
    if request.frame_times is None:
        return open_frames(request.frames, request.rate_hz)
    from jeat_graph.io.events.trigger_times import times_by_triggers

    assert request.events is not None
    times = times_by_triggers(Path(request.events), request.frame_times, request.event_layout)
    return open_frames(request.frames, times=times)
