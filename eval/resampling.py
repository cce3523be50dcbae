"""Tracks at the times of the truth: causal tables predicted forward, smoothed ones interpolated."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories

# Two clocks that agree to a microsecond are one: times are often written with few digits.
TIME_TOLERANCE_S = 1e-6
#: How far causal estimates are carried forward (s): to the next picture of a camera that skipped two of 20 a
#: second. A tracker that has been silent for longer is taken to say that there is no track.
MAX_AGE_S = 0.15


@dataclass(frozen=True, eq=False)
class Resampled:
    """Tracks at given times, in the order of those times.

    Attributes:
        frame: (M,) index into the times asked for, not decreasing.
        track_id: (M,) identity.
        boxes: (M, 4) left, top, width, height (px).
        mean: (M, 6) x, y, vx, vy, ax, ay of the centre (px, px/s, px/s²).
        var: (M, 6) variances; NaN where the table has none.
        row: (M,) the table's row that was predicted from, or the latest one that a smoothed estimate follows.
        age_s: (M,) time from the table's row to the frame: since the row a causal estimate was predicted
            from, or to the nearer of the two rows that a smoothed one lies between.
    """

    frame: IntArray
    track_id: IntArray
    boxes: FloatArray
    mean: FloatArray
    var: FloatArray
    row: IntArray
    age_s: FloatArray


def expand_ranges(start: IntArray, count: IntArray) -> tuple[IntArray, IntArray]:
    """List the members of ranges, one range after the other.

    Args:
        start: (K,) first member of each range.
        count: (K,) number of its members.

    Returns:
        The range each member belongs to (sum of count,) and the member itself (sum of count,).
    """
    owner = np.repeat(np.arange(len(count), dtype=np.int64), count)
    first = np.cumsum(count) - count
    return owner, np.arange(len(owner), dtype=np.int64) - first[owner] + start[owner]


def check_unique(table: Trajectories) -> None:
    """Refuse a table in which one track stands twice at one time.

    Raises:
        DataError: naming the track and the time.
    """
    order = np.lexsort((table.t, table.track_id))
    twice = (np.diff(table.track_id[order]) == 0) & (np.diff(table.t[order]) == 0)
    if twice.any():
        row = order[int(np.argmax(twice))]
        raise DataError(f"track {table.track_id[row]} has two rows at t = {table.t[row]:g} s; one is allowed")


def predict_to(
    table: Trajectories,
    times: FloatArray,
    *,
    max_age_s: float = MAX_AGE_S,
    instants: FloatArray | None = None,
) -> Resampled:
    """Causal estimates at given times, from nothing that came later.

    At a time t the tracks are those of the latest instant t' <= t of the table, if t - t' <= `max_age_s`.
    Their centres move on with constant acceleration, `x + v Δ + a Δ²/2`, their sizes stay; tracks without
    known motion stay where they were. Variances grow by the terms that need no covariance between
    position and velocity (a table has none), which is exact at Δ = 0.

    Args:
        table: rows in any order.
        times: (T,) ascending (s).
        max_age_s: how far estimates may be predicted; beyond it there is no track.
        instants: (I,) all the times at which the tracker gave output, if known: at an instant without rows
            it reported no track. Without them such an instant cannot be known from one at which the tracker
            did not run, and earlier rows are predicted across it.
    """
    order = np.argsort(table.t, kind="stable")
    row_t = table.t[order]
    known = row_t if instants is None else np.concatenate((row_t, np.asarray(instants, dtype=np.float64)))
    instant_t = np.unique(known)
    if not len(instant_t):
        nothing = np.zeros(0, dtype=np.int64)
        return _gather(table, nothing, nothing, np.zeros(0))
    latest = np.searchsorted(instant_t, times + TIME_TOLERANCE_S, side="right") - 1
    age = times - instant_t[np.maximum(latest, 0)]
    alive = (latest >= 0) & (age <= max_age_s + TIME_TOLERANCE_S)
    first = np.searchsorted(row_t, instant_t, side="left")
    last = np.searchsorted(row_t, instant_t, side="right")
    count = np.where(alive, (last - first)[latest], 0)
    frame, member = expand_ranges(first[latest], count)
    return _gather(table, order[member], frame, np.maximum(age, 0.0)[frame])


def rows_outside(table: Trajectories, times: FloatArray, instants: FloatArray | None = None) -> IntArray:
    """Rows of a table that lie before the first or after the last frame of the truth.

    Of a tracker that runs at the truth's rate, or more seldom, those more than half a frame away. One that
    runs more often is still within the truth's last frame until the next would come.

    Args:
        table: rows in any order.
        times: (T,) frames of the truth, ascending, at least one (s).
        instants: (I,) all the times at which the tracker gave output, if known.

    Returns:
        (R,) those rows, in order of time; none where the truth has fewer than two frames.
    """
    if len(times) < 2 or not len(table):
        return np.zeros(0, dtype=np.int64)
    frame_s = float(np.median(np.diff(times)))
    ticks = np.unique(table.t if instants is None else np.concatenate((table.t, instants)))
    tick_s = min(float(np.median(np.diff(ticks))), frame_s) if len(ticks) > 1 else frame_s
    slack_s = frame_s - 0.5 * tick_s + TIME_TOLERANCE_S
    rows = np.flatnonzero((table.t < times[0] - slack_s) | (table.t > times[-1] + slack_s))
    return rows[np.argsort(table.t[rows], kind="stable")]


def with_rows(
    tracks: Resampled, times: FloatArray, table: Trajectories, rows: IntArray
) -> tuple[FloatArray, Resampled]:
    """Add rows of a table, as they are, to its tracks at given times: their times become frames too.

    Args:
        tracks: the table's tracks at `times`.
        times: (T,) ascending (s).
        table: the table.
        rows: (R,) rows at other times than these.

    Returns:
        All times (T',), ascending, and the tracks at them.
    """
    every = np.unique(np.concatenate((times, table.t[rows])))
    added = _gather(table, rows, np.searchsorted(every, table.t[rows]), np.zeros(len(rows)))
    moved = replace(tracks, frame=np.searchsorted(every, times)[tracks.frame])
    order = np.argsort(np.concatenate((moved.frame, added.frame)), kind="stable")
    columns = {
        name: np.concatenate((column, getattr(added, name)))[order] for name, column in vars(moved).items()
    }
    return every, Resampled(**columns)


def on_the_clock_of(table: Trajectories, times: FloatArray) -> bool:
    """Whether a table of which nothing else is known gives rows at the truth's frames, and at no other times.

    Then a frame without rows of it is one at which its tracker found nothing.

    Args:
        table: rows in any order.
        times: (T,) frames of the truth, ascending (s).
    """
    own = np.unique(table.t)
    if len(times) < 2 or len(own) < 2:
        return False
    frame_s = float(np.median(np.diff(times)))
    both = np.diff(np.unique(np.concatenate((times, own))))
    apart = (both <= TIME_TOLERANCE_S) | (both >= 0.5 * frame_s)
    return bool(apart.all() and np.median(np.diff(own)) < 1.5 * frame_s)


def _among(t: FloatArray, moments: FloatArray) -> BoolArray:
    """Return which times (N,) are some of others, ascending and at least one."""
    place = np.searchsorted(moments, t - TIME_TOLERANCE_S)
    return np.asarray(np.abs(moments[np.minimum(place, len(moments) - 1)] - t) <= TIME_TOLERANCE_S)


def _rows_at_each(t: FloatArray, track_id: IntArray, instants: FloatArray) -> bool:
    """Whether rows of tracks (N,) lie at the tracker's times, mostly one step from one to the next."""
    ticks = np.unique(instants)
    if not _among(t, ticks).all():
        return False
    steps = np.diff(np.searchsorted(ticks, t - TIME_TOLERANCE_S))[np.diff(track_id) == 0]
    return bool(len(steps)) and float(np.median(steps)) == 1.0


def _gather(table: Trajectories, row: IntArray, frame: IntArray, age: FloatArray) -> Resampled:
    mean = np.nan_to_num(table.mean[row])
    dt = age[:, None]
    shift = mean[:, 2:4] * dt + mean[:, 4:6] * (0.5 * dt * dt)
    boxes = table.boxes[row].copy()
    boxes[:, :2] += shift
    mean[:, 0:2] += shift
    mean[:, 2:4] += mean[:, 4:6] * dt
    var = table.var[row].copy()
    var[:, 0:2] += var[:, 2:4] * dt**2 + var[:, 4:6] * (0.25 * dt**4)
    var[:, 2:4] += var[:, 4:6] * dt**2
    return Resampled(
        frame=frame, track_id=table.track_id[row], boxes=boxes, mean=mean, var=var, row=row, age_s=age
    )


def interpolate_to(
    table: Trajectories,
    times: FloatArray,
    *,
    max_gap_s: float | None = None,
    instants: FloatArray | None = None,
) -> Resampled:
    """Smoothed trajectories at given times, between the two neighbouring rows of each track.

    Nothing is reported before a track's first row or after its last, nor at a time at which others have a row
    and it has none: then it is known not to be reported. The same holds for the times at which the tracker
    ran, if the table is one that has rows at each of these. The centre follows the quintic through
    position, velocity and acceleration of both rows, which is the mean of the white-jerk motion model
    between two known states (Barfoot, State Estimation for Robotics, ch. 11), and the velocity is its
    derivative; a track without known motion moves in a straight line. Acceleration is linear in time: the
    quintic's second derivative has the positions' errors times 60/Δ², thousands of px/s² between rows 10 ms
    apart. The box keeps its offset from the centre (it may be clipped) and its log size linear in time.
    Variances are linear in time, which is exact at the rows.

    Args:
        table: rows in any order, at most one a track and time.
        times: (T,) ascending (s).
        max_gap_s: rows further apart than this are not joined; any gap is bridged by default.
        instants: (I,) all the times at which the tracker ran, if known.
    """
    order = np.lexsort((table.t, table.track_id))
    t = table.t[order]
    moments, at_each = np.unique(t), False
    if (
        instants is not None
        and len(instants)
        and len(t)
        and _rows_at_each(t, table.track_id[order], instants)
    ):
        at_each = True
        moments = np.unique(np.concatenate((moments, instants[~_among(instants, moments)])))
    _, first, count = np.unique(table.track_id[order], return_index=True, return_counts=True)
    begin = np.searchsorted(times, t[first] - TIME_TOLERANCE_S, side="left")
    end = np.searchsorted(times, t[first + count - 1] + TIME_TOLERANCE_S, side="right")
    track, frame = expand_ranges(begin.astype(np.int64), (end - begin).astype(np.int64))

    # One search over all tracks: rank the times, and let (track, rank) be a single ascending number.
    rank = np.searchsorted(moments, t)
    row_key = np.repeat(np.arange(len(first)), count) * len(moments) + rank
    now = np.searchsorted(moments, times[frame] + TIME_TOLERANCE_S, side="right") - 1
    before = np.searchsorted(row_key, track * len(moments) + now, side="right") - 1
    before = np.maximum(before, first[track])
    after = np.minimum(before + 1, (first + count - 1)[track])

    step = t[after] - t[before]
    into = np.clip(times[frame] - t[before], 0.0, step)
    sampled = np.abs(moments[np.maximum(now, 0)] - times[frame]) <= TIME_TOLERANCE_S
    apart = sampled | (rank[after] - rank[before] > 1 if at_each else False)
    ok = ~apart | (into <= TIME_TOLERANCE_S) | (step - into <= TIME_TOLERANCE_S)
    if max_gap_s is not None:
        ok &= (step <= max_gap_s + TIME_TOLERANCE_S) | (into <= TIME_TOLERANCE_S)
    ok_rows = np.flatnonzero(ok)
    ok_rows = ok_rows[np.argsort(frame[ok_rows], kind="stable")]
    frame, before, after = frame[ok_rows], before[ok_rows], after[ok_rows]
    step, into = step[ok_rows], into[ok_rows]
    return _between(table, order[before], order[after], frame, step, into)


def _between(
    table: Trajectories, a: IntArray, b: IntArray, frame: IntArray, step: FloatArray, into: FloatArray
) -> Resampled:
    h = np.where(step > 0.0, step, 1.0)[:, None]
    s = into[:, None] / h
    mean_a, mean_b = np.nan_to_num(table.mean[a]), np.nan_to_num(table.mean[b])
    still = (mean_a[:, 2:] == 0.0).all(axis=1) & (mean_b[:, 2:] == 0.0).all(axis=1)
    p, v = _quintic(mean_a, mean_b, h, s)
    acc = mean_a[:, 4:6] + s * (mean_b[:, 4:6] - mean_a[:, 4:6])
    line = mean_a[:, :2] + s * (mean_b[:, :2] - mean_a[:, :2])
    mean = np.concatenate((np.where(still[:, None], line, p), v, acc), axis=1)
    mean[still, 2:] = 0.0

    box_a, box_b = table.boxes[a], table.boxes[b]
    offset_a = box_a[:, :2] + 0.5 * box_a[:, 2:] - mean_a[:, :2]
    offset_b = box_b[:, :2] + 0.5 * box_b[:, 2:] - mean_b[:, :2]
    with np.errstate(divide="ignore"):
        log_a, log_b = np.log(box_a[:, 2:]), np.log(box_b[:, 2:])
        # At the ends the rows' own sizes are taken, so that a box without area stays one.
        size = np.exp(log_a + np.where(s > 0.0, s * np.nan_to_num(log_b - log_a), 0.0))
    centre = mean[:, :2] + offset_a + s * (offset_b - offset_a)
    var = table.var[a] + s * (table.var[b] - table.var[a])
    return Resampled(
        frame=frame,
        track_id=table.track_id[a],
        boxes=np.concatenate((centre - 0.5 * size, size), axis=1),
        mean=mean,
        var=var,
        row=a,
        age_s=np.minimum(into, step - into),
    )


def _quintic(a: FloatArray, b: FloatArray, h: FloatArray, s: FloatArray) -> tuple[FloatArray, ...]:
    """Position and velocity (N, 2 each) at the fraction `s` (N, 1) of a step `h` (N, 1) s."""
    p0, v0, a0 = a[:, 0:2], a[:, 2:4] * h, a[:, 4:6] * h * h
    p1, v1, a1 = b[:, 0:2], b[:, 2:4] * h, b[:, 4:6] * h * h
    d = p1 - p0 - v0 - 0.5 * a0
    e = v1 - v0 - a0
    f = a1 - a0
    c3 = 10.0 * d - 4.0 * e + 0.5 * f
    c4 = -15.0 * d + 7.0 * e - f
    c5 = 6.0 * d - 3.0 * e + 0.5 * f
    position = p0 + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
    velocity = v0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    return position, velocity / h
