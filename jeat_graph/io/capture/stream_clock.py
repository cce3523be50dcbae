"""When a picture of a live stream was taken: by the stream's own time stamps, on the clock of this machine.

Stamps say exactly how far apart two pictures were taken; arrival says when that was, late by what the camera
and the network need. So the time of a picture is its stamp plus an offset, and the offset is the least
lateness seen: of all pictures the one that was on its way for the shortest time is nearest to the truth.
Clocks drift: the offset may also rise, but slowly.
"""

from __future__ import annotations

import math

#: The offset rises by this share of the time that passes (two clocks of crystals differ by less), and falls
#: by no more than this share, so that times never run backwards.
_RISE, _FALL = 2e-4, 1e-2
#: A stream is settled when a picture comes at its time: not sooner than this share of its distance in stamps.
_AT_ITS_TIME = 0.5
#: What has gone on for so long is no store that is being emptied (s).
_LONGEST_STORE_S = 10.0
#: Stamps that leap by more than this (s) start over.
_LEAP_S = 10.0
#: Stamps are another clock's if for so long (s) every picture is late by more than this (s).
_WATCH_S, _LATE_S = 10.0, 1.0
#: So many pictures in a row whose stamp is that of the one before: the stream has none.
_STANDING = 5
#: Two pictures are at least so far apart (s): times that are written to the microsecond stay two.
_APART_S = 1e-4


class StreamClock:
    """Times of the pictures of one connection.

    Attributes:
        by_stamps: whether the stream's stamps count; else pictures have the time of their arrival.
    """

    def __init__(self, by_stamps: bool = True) -> None:
        self.by_stamps = by_stamps
        self._last_t = -math.inf
        self.restart(by_stamps)

    def restart(self, by_stamps: bool = True) -> None:
        """Start over with a new connection; times still ascend."""
        self.by_stamps = by_stamps
        self._settled = False
        self._first_s: float | None = None
        self._standing = 0
        self._stamp_s = self._arrival_s = self._offset_s = 0.0
        self._watched_s, self._least_late_s = 0.0, math.inf

    def time_of(self, stamp_s: float, arrival_s: float) -> float | None:
        """Return the time of a picture (s).

        Args:
            stamp_s: its time stamp in the stream (s, from anywhere).
            arrival_s: when it came (s).

        Returns:
            On the clock of `arrival_s`, after that of the picture before; None where the picture had been
            waiting in a store of the stream, so that nothing says when it was taken.
        """
        if not self.by_stamps:
            return self._after(arrival_s)
        if self._first_s is None:
            self._begin(stamp_s, arrival_s)
            return None
        step_s, waited_s = stamp_s - self._stamp_s, arrival_s - self._arrival_s
        self._standing = 0 if step_s else self._standing + 1
        if self._standing >= _STANDING:
            self.by_stamps = False
            return self._after(arrival_s)
        if not 0.0 < step_s < _LEAP_S:
            self._begin(stamp_s, arrival_s)
            return None
        self._stamp_s, self._arrival_s = stamp_s, arrival_s
        if not self._settled:
            at_its_time = waited_s >= _AT_ITS_TIME * step_s
            if not at_its_time and arrival_s - self._first_s < _LONGEST_STORE_S:
                return None
            self._settled, self._offset_s, self._watched_s = True, arrival_s - stamp_s, arrival_s
            return self._after(arrival_s)
        late_s = arrival_s - stamp_s - self._offset_s
        self._offset_s += min(max(late_s, -_FALL * step_s), _RISE * step_s)
        if self._are_anothers(late_s, arrival_s):
            self.by_stamps = False
            return self._after(arrival_s)
        return self._after(stamp_s + self._offset_s)

    def _begin(self, stamp_s: float, arrival_s: float) -> None:
        self._settled, self._first_s = False, arrival_s
        self._stamp_s, self._arrival_s = stamp_s, arrival_s
        self._watched_s, self._least_late_s = arrival_s, math.inf

    def _are_anothers(self, late_s: float, arrival_s: float) -> bool:
        """Tell whether the stamps do not go with the arrivals: made up by the container, say."""
        self._least_late_s = min(self._least_late_s, abs(late_s))
        if arrival_s - self._watched_s < _WATCH_S:
            return False
        anothers = self._least_late_s > _LATE_S
        self._watched_s, self._least_late_s = arrival_s, math.inf
        return anothers

    def _after(self, t: float) -> float:
        """Return the time, or one just after that of the picture before."""
        self._last_t = max(t, self._last_t + _APART_S)
        return self._last_t
