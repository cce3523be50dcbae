"""On one clock: the times of events beside those of frames, where files say what their time 0 is."""

from __future__ import annotations

from typing import NamedTuple

from jeat_graph.data.time_text import exact_text

_US_PER_S = 1_000_000
# Times from here on count from 1970 (µs): it is March 1973.
_EPOCH_US = 10**14


class FrameClock(NamedTuple):
    """The clock of frames.

    Attributes:
        first_s: time of the first frame, as the frames are given out (s).
        origin_s: time 0 of it, in s since 1970; 0 where the file's times are given out as they stand.
    """

    first_s: float
    origin_s: float


def events_later_us(t_offset_us: int, origin_us: int, frames: FrameClock | None) -> tuple[int, str]:
    """Return what to add to the times of events for the clock of the frames.

    Where both files count from 1970, their clocks tell. Where only the events' file does, its times are
    taken from its own beginning, as a video's are.

    Args:
        t_offset_us: what leads to the clock of frames that belong to the events, as HDF5 may say (µs).
        origin_us: time 0 of the events on the clock of their file (µs), 0 where that is time 0 itself.
        frames: None where there are none.

    Returns:
        What to add (µs), and a line that says so where a clock was chosen, else empty.
    """
    if frames is None:
        return t_offset_us, ""
    events_us = t_offset_us + origin_us
    origin_frames_us = round(frames.origin_s * _US_PER_S)
    first_us = round(frames.first_s * _US_PER_S) + origin_frames_us
    if events_us >= _EPOCH_US and first_us >= _EPOCH_US:
        later_us = events_us - origin_frames_us
        note = ""
        if later_us and later_us != t_offset_us:
            added = exact_text(later_us / _US_PER_S)
            note = f"{added} s are added to their times: frames and events count from 1970"
        return later_us, note
    if t_offset_us >= _EPOCH_US:
        return 0, (
            f"their clock counts from 1970 (time 0 is {exact_text(t_offset_us / _US_PER_S)} s) and that "
            "of the frames does not: both are taken to begin together; if they do not, say --event-delay"
        )
    return t_offset_us, ""
