"""Times as text: dates of ISO 8601 and time codes, in seconds."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from datetime import UTC, datetime, timedelta
from decimal import Decimal

import numpy as np

from jeat_graph.data.arrays import FloatArray

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_DATE = re.compile(r"\d{4}-\d\d-\d\d([T ].*)?$")
# Python takes a decimal fraction of a minute or an hour, too, and reads it as one of a second.
_FRACTION = re.compile(r"([T ]\d\d:\d\d:\d\d)[.,](\d+)")
# Hours, minutes and seconds with a fraction, or with the number of the frame within the second.
_CODE = re.compile(r"(?:(\d+):)?([0-5]?\d):([0-5]?\d)(?:[.,](\d+)|[:;](\d+))?$")
_MINUTE_S, _HOUR_S = 60, 3600
_NS_DECIMALS = 9
# Beyond this a number has no digits behind the point (s).
_LARGEST_S = 1e15

#: What is read as a time that is no number, for messages.
KNOWN = "a number, a date such as 2026-05-01T12:00:00.04, or a time code such as 00:01:02.5"


def seconds_of_text(text: str, rate_hz: float | None = None) -> float | None:
    """Return a time in seconds, or None where the text is none.

    Args:
        text: a date (seconds since 1970; UTC where it names no zone), or a time code `H:MM:SS.f`, `MM:SS.f`
            or `HH:MM:SS:FF`.
        rate_hz: frames per second, by which the frames `FF` of a time code count.
    """
    text = text.strip()
    if _DATE.match(text):
        return _date(text)
    code = _CODE.match(text)
    if code is None:
        return None
    hours, minutes, seconds, fraction, frames = code.groups()
    if frames is not None and (rate_hz is None or hours is None):
        return None
    whole = int(hours or 0) * _HOUR_S + int(minutes) * _MINUTE_S + int(seconds)
    # By way of text, so that 1.04 s is the number that is nearest to 1.04.
    part = int(frames) / rate_hz if frames is not None and rate_hz is not None else 0.0
    return float(f"{whole}.{fraction}") if fraction else whole + part


def _date(text: str) -> float | None:
    # Python knows six decimals of a second; loggers write up to nine.
    fraction = _FRACTION.search(text)
    bare = text if fraction is None else text[: fraction.start()] + fraction[1] + text[fraction.end() :]
    if "." in bare or "," in bare:
        return None
    try:
        moment = datetime.fromisoformat(bare)
    except ValueError:
        return None
    moment = moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment
    whole = (moment - _EPOCH) // timedelta(seconds=1)
    return float(whole + Decimal(f"0.{fraction[2]}")) if fraction else float(whole)


def exact_text(t_s: float) -> str:
    """Return a time (s) as text from which the same number is read, to the nanosecond.

    What is given as advice must work when it is typed in, for seconds since 1970 too.
    """
    if not abs(t_s) < _LARGEST_S:
        return repr(float(t_s))
    return np.format_float_positional(round(t_s, _NS_DECIMALS), trim="-")


def looks_like_time(text: str) -> bool:
    """Tell whether a text is meant as a date or a time code, be it valid or not."""
    return bool(_DATE.match(text.strip()) or _CODE.match(text.strip()))


def all_seconds(
    texts: Iterable[str], refuse: Callable[[int, str], Exception], rate_hz: float | None = None
) -> FloatArray:
    """Return times (R,) in seconds.

    Args:
        texts: (R,) dates or time codes, or numbers among them.
        refuse: makes the exception for a row (from 0) that is none of these, from a message.
        rate_hz: frames per second, for time codes with frames.
    """
    out: list[float] = []
    for row, text in enumerate(texts):
        value = seconds_of_text(text, rate_hz)
        if value is None:
            try:
                value = float(text)
            except ValueError:
                known = f"; known are {KNOWN}"
                hint = "; give the rate of its frames with --rate" if _has_frames(text) else known
                raise refuse(row, f"t must be a time, got {text[:40]!r}{hint}") from None
            if not math.isfinite(value):
                raise refuse(row, f"t must be a finite number, got {value}")
        out.append(value)
    return np.array(out, dtype=np.float64)


def _has_frames(text: str) -> bool:
    code = _CODE.match(text.strip())
    return code is not None and code[5] is not None
