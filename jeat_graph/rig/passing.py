"""Whether two cameras face each other, by when vehicles pass.

Vehicles pass a place on a road at irregular times, and two cameras that see it see one pattern of times. Of
cameras side by side, vehicles that grow in the one picture have the pattern of those that grow in the other;
of cameras that face each other, that of those that shrink. Both are compared, at all places along the road
and at all differences of the clocks, and the one that is right stands out from chance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.rig.sensor_tracks import STEP_S, SensorTracks

# Lines across the road at which passing times are taken: quantiles of where vehicles are.
_LINES = np.linspace(0.04, 0.96, 13)
# Between the outer lines the logarithm of the size must change by this, or it tells no direction.
_LEAST_GROWTH = 0.4
# Passing times agree within so many steps; what chance gives is the mean over so many, on either side.
_NEAR_STEPS, _USUAL_STEPS = 2, 60
# The second camera's line lies beside the first's: vehicles of the one direction pass it so many steps later,
# those of the other earlier.
_BETWEEN_LINES = (-6, -4, -2, 0, 2, 4, 6)
# Facing each other stands out by so many standard deviations (of unrelated traffic at most 5.9), and by so
# many times as much as side by side does.
_CLEAR, _CLEARER = 6.5, 1.4


class PassingPattern(NamedTuple):
    """Where the passing times of two sensors agree best.

    Attributes:
        offset_s: what the second's clock is ahead there, to some tenths (s).
        deviations: by how many standard deviations more agree than by chance.
    """

    offset_s: float
    deviations: float


class _Passings(NamedTuple):
    """Times (N, L) at which tracks pass the lines (s), NaN where they do not; 1 if they grow, or -1 (N,)."""

    t: FloatArray
    grows: IntArray


def facing_pattern(first: SensorTracks, second: SensorTracks) -> PassingPattern | None:
    """Compare what passes two cameras that may face each other.

    Args:
        first: tracks of the sensor whose clock is the common one.
        second: of the other.

    Returns:
        Where they agree best as cameras that face each other; None where they do not clearly do.
    """
    ours, theirs = _passings(first), _passings(second)
    if ours is None or theirs is None:
        return None
    facing, beside = _best(ours, theirs, -1), _best(ours, theirs, 1)
    return facing if facing.deviations > max(_CLEAR, _CLEARER * beside.deviations) else None


def _passings(tracks: SensorTracks) -> _Passings | None:
    """When vehicles pass the lines, and which of them grow; None where this cannot be seen."""
    moving = np.flatnonzero(tracks.moves)
    if not len(moving):
        return None
    # Lower edges: centres of high vehicles are seen as if they were farther away.
    foot = tracks.centre[moving] + tracks.size[moving] * [0.0, 0.5]
    there = np.isfinite(foot[:, :, 0])
    first, last = there.argmax(axis=1), there.shape[1] - 1 - there[:, ::-1].argmax(axis=1)
    number = np.arange(len(moving))
    heading = foot[number, last] - foot[number, first]
    heading /= np.maximum(np.linalg.norm(heading, axis=1, keepdims=True), 1e-9)
    axis = np.linalg.eigh(heading.T @ heading)[1][:, -1]
    along = foot @ axis
    lines = np.quantile(along[there], _LINES)
    log_size = 0.5 * np.log(tracks.size[moving].prod(axis=2)[there])
    growth = float(np.polyfit(along[there], log_size, 1)[0])
    if abs(growth) * (lines[-1] - lines[0]) < _LEAST_GROWTH:
        return None
    way = np.where(heading @ axis > 0.0, 1, -1)
    t = np.full((len(moving), len(lines)), np.nan)
    for k, sign in enumerate(way):
        steps = np.flatnonzero(there[k])
        ahead = np.maximum.accumulate(sign * along[k, steps])
        wanted = sign * lines
        inside = (wanted > ahead[0]) & (wanted < ahead[-1])
        t[k, inside] = np.interp(wanted[inside], ahead, tracks.start_s + STEP_S * steps)
    if not np.isfinite(t).any():
        return None
    return _Passings(t, way if growth > 0.0 else -way)


def _best(ours: _Passings, theirs: _Passings, way: int) -> PassingPattern:
    """Try all lines and differences of the clocks.

    Args:
        ours: of the first sensor.
        theirs: of the second.
        way: 1 if those that grow in both belong together, -1 if they shrink in the other.
    """
    margin = _USUAL_STEPS * STEP_S
    low = float(np.nanmin(theirs.t) - np.nanmax(ours.t)) - margin
    steps = int((np.nanmax(theirs.t) - np.nanmin(ours.t) + margin - low) / STEP_S) + 1
    best = PassingPattern(0.0, 0.0)
    for one in ours.t.T:
        for other in theirs.t.T:
            growing, shrinking = (
                _differences(one[ours.grows == grows], other[theirs.grows == way * grows], low, steps)
                for grows in (1, -1)
            )
            for later in _BETWEEN_LINES:
                found = _what_stands_out(np.roll(growing, -later) + np.roll(shrinking, later), low)
                best = max(best, found, key=lambda pattern: pattern.deviations)
    return best


def _differences(ours: FloatArray, theirs: FloatArray, low: float, steps: int) -> FloatArray:
    """Count (steps,) of the differences of all passing times, from `low` (s) on."""
    apart = (theirs[None, :] - ours[:, None]).ravel()
    apart = apart[np.isfinite(apart)]
    return np.bincount(((apart - low) / STEP_S).astype(np.int64), minlength=steps).astype(np.float64)


def _what_stands_out(count: FloatArray, low: float) -> PassingPattern:
    near, wide = (np.ones(2 * steps + 1) for steps in (_NEAR_STEPS, _USUAL_STEPS))
    agree = np.convolve(count, near, mode="same")
    usual = np.convolve(count, wide, mode="same") * len(near) / len(wide)
    # Where few agree by chance, one more says nothing.
    deviations = (agree - usual) / np.sqrt(usual + 1.0)
    k = int(deviations.argmax())
    return PassingPattern(low + STEP_S * (k + 0.5), float(deviations[k]))
