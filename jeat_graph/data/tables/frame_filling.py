"""Frame numbers and times, and the empty scans that a format cannot say."""

from __future__ import annotations

import math
from pathlib import Path
from typing import SupportsFloat

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError

# More empty scans than this come from a wrong frame number, rate or time unit, not from a camera.
_MOST_FILLED = 5_000_000
# So many frames share a step by chance in one case of 2^9 at most.
_ENOUGH_FOR_A_STEP = 10
#: What scores may be (`scale_scores`).
SCORE_SCALES = ("unit", "percent", "logistic")


def check_rate(rate_hz: float | None, path: str | Path | None) -> float:
    """Return the frame rate (Hz) of a file that counts frames.

    Raises:
        DataError: none is given, or it is no number, or not positive and finite.
    """
    if rate_hz is None:
        raise DataError("has frame numbers only; give their rate with --rate (in Python rate_hz)", path)
    if not isinstance(rate_hz, SupportsFloat):  # of a user in Python
        raise DataError(f"the frame rate must be a number (Hz), not {rate_hz!r:.40}", path)
    if not (math.isfinite(rate_hz) and rate_hz > 0):
        raise DataError(f"the frame rate must be positive, got {rate_hz} Hz", path)
    return float(rate_hz)


def fill_frames(frames: IntArray, path: str | Path | None, last: int | None = None) -> IntArray:
    """Return all frames from the first to the last, also those in which nothing was found.

    Where at least ten frames occur and all of them are n, 2n, 3n, … apart, every n-th frame counts: the
    recording was looked at in every n-th frame only.

    Args:
        frames: (R,) frame numbers that occur, in any order, several times or not.
        path: the file, for messages, if there is one.
        last: the recording's last frame, if it is known; the first one is then taken to be 1.

    Returns:
        Frame numbers (T,), ascending.

    Raises:
        DataError: the range is too wide to be that of a recording.
    """
    seen = np.unique(frames)
    first = int(seen[0]) if len(seen) else 1
    end = int(seen[-1]) if len(seen) else 0
    step = int(np.gcd.reduce(np.diff(seen))) if len(seen) >= _ENOUGH_FOR_A_STEP else 1
    if last is not None:
        first, end = min(first, 1), max(end, last)
        step = 1
    if (end - first) // step > _MOST_FILLED + len(seen):
        raise DataError(
            f"frames {first} to {end} hold only {len(seen)} that are not empty; "
            "with fill_empty=False the others are taken as not recorded",
            path,
        )
    return np.arange(first, end + 1, step, dtype=np.int64)


def gap_times(times: FloatArray, rate_hz: float, path: str | Path | None) -> FloatArray:
    """Return the times of scans that are missing between the first and the last, by the sensor's rate.

    A gap of about n periods gets n - 1 times, evenly spaced, so that jitter and drift do no harm.

    Args:
        times: (R,) times that occur (s), in any order.
        rate_hz: rate of the scans (Hz).
        path: the file, for messages, if there is one.

    Raises:
        DataError: the gaps are too wide to be those of a recording.
    """
    seen = np.unique(times)
    if len(seen) < 2:
        return np.zeros(0)
    gaps = np.diff(seen)
    missing = np.maximum(np.rint(gaps * check_rate(rate_hz, path)) - 1, 0)
    if missing.sum() > _MOST_FILLED + len(seen):
        raise DataError(
            f"at {rate_hz:g} Hz, {missing.sum():.0f} scans would be empty; is the rate right?", path
        )
    count = missing.astype(np.int64)
    which = np.repeat(np.arange(len(gaps)), count)
    nth = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + 1
    return np.asarray(seen[which] + gaps[which] * nth / (count[which] + 1), dtype=np.float64)


def scale_scores(scores: FloatArray, how: str, path: str | Path | None) -> FloatArray:
    """Bring scores (R,) to [0, 1].

    Args:
        scores: as the file has them.
        how: `unit` (as they are), `percent` (0…100), or `logistic` (any number s becomes 1/(1 + exp(-s))).
        path: the file, for messages, if there is one.

    Raises:
        DataError: `how` is none of these.
    """
    if how == "unit":
        return scores
    if how == "percent":
        return scores / 100.0
    if how == "logistic":
        # tanh does not overflow where exp would.
        return np.asarray(0.5 * (1.0 + np.tanh(0.5 * scores)), dtype=np.float64)
    raise DataError(f"score_scale must be unit, logistic or percent, not {how!r}", path)


def score_hint(score: float) -> str:
    """Say what to do about a score outside [0, 1]."""
    return (
        f"score must be in [0, 1], got {score:g}; for 0 to 100 give --score-scale percent, for raw scores of "
        "any size --score-scale logistic (in Python score_scale=)"
    )
