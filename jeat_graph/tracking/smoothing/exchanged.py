"""Put right in hindsight which of two vehicles that met was which."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, RecordArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import with_progress
from jeat_graph.data.steps import check_steps
from jeat_graph.data.time_text import exact_text
from jeat_graph.smoothers.exchanging import TwoSided, exchange_gains
from jeat_graph.smoothers.measurements import concatenate_measurements
from jeat_graph.tracking.smoothing.encounters import encounters
from jeat_graph.tracking.smoothing.history import TrackHistory
from jeat_graph.tracking.smoothing.observation_times import ObservationTimes
from jeat_graph.tracking.smoothing.priors import ErrorStates
from jeat_graph.tracking.smoothing.two_sided import two_sided

#: How often `encounters` looks at tracks, and how far from 0 it can count its looks (s).
_LOOKS_HZ, _FARTHEST_S = 20.0, 2.0**62 / 20.0


def exchange_histories(histories: Sequence[TrackHistory], config: Config) -> tuple[list[TrackHistory], int]:
    """Exchange the futures of tracks that met where that is likelier than that the tracker was right.

    Args:
        histories: confirmed tracks with all their measurements, nothing smoothed or handed out yet.
        config: the motion model, and how often the tracker mixes two vehicles up.

    Returns:
        The histories, each of the identity that it began with, and the number of exchanges.

    Raises:
        DataError: the tracks last so long that they cannot be gone through, as where a time is wrong.
    """
    found, count = list(histories), 0
    share = config.smoother.exchange_share
    if len(found) < 2 or share == 0.0:
        return found, 0
    least = float(np.log1p(-share) - np.log(share))
    sides = _Sides(found, config)
    # Whose place each has taken: encounters are found once, and gone through in order of time.
    now = np.arange(len(found))
    rows = [history.whole() for history in found]
    _check_times(rows)
    met = encounters(rows)
    for first, second, start_t, end_t in with_progress(list(zip(*met, strict=True))):
        i, j = int(now[first]), int(now[second])
        if _of_different_classes(found[i], found[j]):
            continue
        a, b = sides.of(i), sides.of(j)
        moments = _moments(a, b, start_t, end_t)
        gains = exchange_gains(a, b, moments)
        if len(gains) and gains.max() > least:
            moment = float(moments[gains.argmax()])
            past_i, past_j = found[i], found[j]
            found[i] = _continued(past_i, past_j, moment, config)
            found[j] = _continued(past_j, past_i, moment, config)
            sides.forget(i, j)
            now[first], now[second] = j, i
            count += 1
    return found, count


def _check_times(rows: Sequence[RecordArray]) -> None:
    """Refuse tracks that cannot be gone through in the steps of `encounters`: a wrong time makes such."""
    # One after the other, for days of many short tracks are no harm.
    for one in rows:
        start, end = float(one["t"][0]), float(one["t"][-1])
        check_steps(start, end, _LOOKS_HZ, "looks at a track", "leave it out: smoother.exchange_share=0")
        if max(abs(start), abs(end)) > _FARTHEST_S:
            raise DataError(
                f"a track lasts from {exact_text(start)} to {exact_text(end)} s: is one of its times wrong?"
            )


class _Sides:
    """What past and future say of histories, made when it is asked for: most never meet another."""

    def __init__(self, histories: Sequence[TrackHistory], config: Config) -> None:
        self._histories = histories
        self._errors = ErrorStates.of(config)
        self._known: dict[int, TwoSided] = {}

    def of(self, i: int) -> TwoSided:
        """Both sides of history i as it is now."""
        if i not in self._known:
            rows = self._histories[i].whole()
            self._known[i] = two_sided(rows, rows[0], self._errors)
        return self._known[i]

    def forget(self, *changed: int) -> None:
        """Histories have been changed."""
        for i in changed:
            self._known.pop(i, None)


def _moments(a: TwoSided, b: TwoSided, start_t: float, end_t: float) -> FloatArray:
    """Moments (C,) of an encounter at which two tracks may have changed places: between any two keys."""
    keys = []
    for track in (a, b):
        low, high = np.searchsorted(track.t, (start_t, end_t))
        keys.append(track.t[max(low - 1, 0) : high + 1])
    t = np.unique(np.concatenate(keys))
    middle = 0.5 * (t[:-1] + t[1:])
    # Two keys so close that no number lies between them have no moment between them either.
    return middle[(t[:-1] < middle) & (middle < t[1:])]


def _of_different_classes(a: TrackHistory, b: TrackHistory) -> bool:
    """Whether most of what detectors said of two tracks names two classes: then they are not alike."""
    if not a.votes or not b.votes:
        return False
    return max(a.votes, key=a.votes.__getitem__) != max(b.votes, key=b.votes.__getitem__)


def _continued(past: TrackHistory, future: TrackHistory, moment: float, config: Config) -> TrackHistory:
    """A history that is one until a moment and another from then on."""
    whole = TrackHistory(past.track_id, config, ErrorStates.of(config), True, past.given)
    before, after = past.whole(), future.whole()
    count, since = np.searchsorted(before["t"], moment), np.searchsorted(after["t"], moment)
    whole.add_measurements(concatenate_measurements([before[:count], after[since:]]))
    seen, later = past.observed, future.observed
    steps = [
        seen.select(slice(0, int(np.searchsorted(seen.t, moment)))),
        later.select(slice(int(np.searchsorted(later.t, moment)), None)),
    ]
    whole.votes = dict(past.votes)
    whole.add_steps(ObservationTimes.concatenate(steps), True)
    return whole
