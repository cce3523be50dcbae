"""The smoothers of the engine `paper`: which rows are final when, and by which engine.

The tracks' states are cut into segments of `STRIDE` steps; each step closes the segments of one track in
`STRIDE`, so that no step has much more to do than another.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray, TextArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.paper.path import PathEngine, Rows, TrackPath, solve
from jeat_graph.tracking.paper.segmenting import cut_segments
from jeat_graph.tracking.paper.state import PaperTracks, sizes_of
from jeat_graph.tracking.paper.table import boxes_at

#: Steps in a segment: GTSAM solves for one state in so many. More would hardly be faster.
STRIDE = 24
# So many segments of a track become final at a time: the pass back over the lag's is the same for one.
_TOGETHER = 2
# A time that is an interval's begin but for rounding is in it.
_ROUNDING = 1e-9


class StepTaken(NamedTuple):
    """What the smoothers are told of one step, N living tracks after it.

    Attributes:
        t: time of the step (s).
        births: how many of the tracks were born in it; they are the last ones.
        ids: (N,) identities, ascending.
        tracks: their states.
        z: (N, 2) the centres that they took in, weighed by their information (px).
        information: (N,) of these along either axis, 0 where there was none (1/px²).
        sensors: names of the sensors.
        classes: (N,) class of each, or None where none was ever named.
        class_probability: (N,) its share, or None.
        given: (N,) identities that the tables are to have in place of `ids`, or None.
    """

    t: float
    births: int
    ids: IntArray
    tracks: PaperTracks
    z: FloatArray
    information: FloatArray
    sensors: tuple[str, ...]
    classes: TextArray | None
    class_probability: FloatArray | None
    given: IntArray | None = None


class PaperSmoothers:
    """Takes the steps of a tracker in and gives smoothed trajectories of the tracks that were confirmed.

    A track has rows from its first to its last detection, also of the time before it was confirmed. With a
    fixed lag a row is final when measurements of `smoother.lag_s` have followed, and at most 3 `STRIDE` steps
    later; else when its track has ended. Final rows wait in memory until they are fetched.

    Args:
        config: settings of the smoother, the engine `paper` and the picture.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._engine = PathEngine.of(config)
        self._engine.load()
        self._lag_s = config.smoother.lag_s if self._engine.lagged else math.inf
        self._paths: dict[int, TrackPath] = {}
        self._living: IntArray = np.zeros(0, dtype=np.int64)
        self._steps: deque[StepTaken] = deque()
        self._first = 0  # number of the first step that is kept
        self._final: list[Trajectories] = []
        self._smoothed = 0
        self._rate_hz = config.smoother.output_rate_hz
        self._bin = -math.inf
        self._wanted: list[float] = []  # times that have rows, where not all have
        self._fallbacks = 0

    def counts(self) -> dict[str, int]:
        """How many tracks were smoothed, and how often our own pass stood in for GTSAM."""
        living = sum(path.fallbacks for path in self._paths.values())
        return {"tracks": self._smoothed, "fallbacks": self._fallbacks + living}

    def record(self, taken: StepTaken) -> None:
        """Record one step, and do a part of the work."""
        number = self._first + len(self._steps)
        if len(taken.ids) - taken.births != len(self._living):
            self._end(self._living[~np.isin(self._living, taken.ids)].tolist())
        self._steps.append(taken)
        self._living = taken.ids
        self._note_wanted(taken.t)
        given = taken.ids if taken.given is None else taken.given
        for row in range(len(taken.ids) - taken.births, len(taken.ids)):
            identity = int(taken.ids[row])
            self._paths[identity] = TrackPath(self._engine, int(given[row]), number, taken, row)
        due = taken.ids[(taken.ids + number) % STRIDE == 0].tolist()
        self._cut(due, number)
        self._depart(taken, due)
        if number % STRIDE == 0:
            self._forget_steps()

    def drain(self, sensors: tuple[str, ...]) -> Trajectories:
        """Return, and forget, final rows, in order of time."""
        rows, self._final = Trajectories.concatenate([Trajectories.empty(sensors), *self._final]), []
        return _in_order(rows)

    def smoothed(self, sensors: tuple[str, ...]) -> Trajectories:
        """Return all rows not drained yet, those too that may still change."""
        parts = [Trajectories.empty(sensors), *self._final]
        if self._steps:
            newest = self._steps[-1]
            number = self._first + len(self._steps) - 1
            self._cut(self._living.tolist(), number)
            parts += self._remaining(newest.ids[newest.tracks.confirmed].tolist())
        return _in_order(Trajectories.concatenate(parts))

    def finish(self, sensors: tuple[str, ...]) -> Trajectories:
        """End all tracks and return all rows not drained yet."""
        self.begin_anew()
        return self.drain(sensors)

    def begin_anew(self) -> None:
        """End all tracks; times may begin again from any moment."""
        self._end(self._living.tolist())
        self._living, self._bin = np.zeros(0, dtype=np.int64), -math.inf

    def _end(self, ended: Iterable[int]) -> None:
        """Smooth what is left of tracks that are over since the newest step that is kept."""
        ended = list(ended)
        if not ended:
            return
        last = self._steps[-1]
        confirmed = last.ids[last.tracks.confirmed & np.isin(last.ids, ended)].tolist()
        self._cut(confirmed, self._first + len(self._steps) - 1)
        self._final += self._remaining(confirmed)
        self._fallbacks += sum(self._paths[identity].fallbacks for identity in confirmed)
        self._smoothed += len(confirmed)
        for identity in ended:
            del self._paths[identity]

    def _cut(self, identities: list[int], number: int) -> None:
        """Close the open segments of tracks at a step; those that began at one step together."""
        groups: dict[int, list[int]] = {}
        for identity in identities:
            groups.setdefault(self._paths[identity].first_step, []).append(identity)
        for first, members in groups.items():
            if first == number:
                continue
            steps = [self._steps[k] for k in range(first - self._first, number - self._first + 1)]
            paths = [self._paths[identity] for identity in members]
            pieces = cut_segments(np.array(members), steps, [path.reference for path in paths], self._engine)
            for path, piece in zip(paths, pieces, strict=True):
                path.add(piece, number)

    def _forget_steps(self) -> None:
        """Drop the steps that all living tracks have closed segments of."""
        newest = self._first + len(self._steps) - 1
        needed = min((path.first_step for path in self._paths.values()), default=newest)
        while self._first < needed:
            self._steps.popleft()
            self._first += 1
        if self._wanted:
            oldest = min((path.open_from for path in self._paths.values()), default=math.inf)
            self._wanted = [t for t in self._wanted if t >= oldest]

    def _depart(self, taken: StepTaken, due: list[int]) -> None:
        """Let segments of living tracks become final: those behind the lag and before a last detection."""
        at = np.searchsorted(taken.ids, due)
        at = at[taken.tracks.confirmed[at]]
        until = np.minimum(taken.tracks.t_update[at], taken.t - self._lag_s)
        paths = [self._paths[identity] for identity in taken.ids[at].tolist()]
        counts = [path.before(t) for path, t in zip(paths, until.tolist(), strict=True)]
        ready = [(path, count) for path, count in zip(paths, counts, strict=True) if count >= _TOGETHER]
        if not ready:
            return
        paths, counts = [path for path, _ in ready], [count for _, count in ready]
        rows = solve(paths, counts)
        for path, count in ready:
            path.leave(count)
        self._final += self._tables(paths, rows)

    def _remaining(self, identities: list[int]) -> list[Trajectories]:
        """Return all rows of tracks of the newest step that are not final, up to each last detection."""
        if not identities:
            return []
        newest = self._steps[-1]
        paths = [self._paths[identity] for identity in identities]
        last_seen = newest.tracks.t_update[np.searchsorted(newest.ids, identities)].tolist()
        rows = solve(paths, [path.number for path in paths], whole=True)
        seen = []
        for path, t, parts in zip(paths, last_seen, rows, strict=True):
            alone = path.alone()
            kept = parts if alone is None else [alone]
            seen.append([Rows(*(column[part.t <= t] for column in part)) for part in kept])
        return self._tables(paths, seen)

    def _tables(self, paths: list[TrackPath], rows: list[list[Rows]]) -> list[Trajectories]:
        """Turn smoothed states of tracks of the newest step into a table, if there are any."""
        parts = [part for track in rows for part in track]
        if not parts:
            return []
        newest = self._steps[-1]
        lengths = [sum(len(part.t) for part in track) for track in rows]
        row = np.repeat(np.searchsorted(newest.ids, [path.identity for path in paths]), lengths)
        t, used, mean, cov, size_mean, size_cov = (np.concatenate(one) for one in zip(*parts, strict=True))
        size = sizes_of(size_mean)
        boxes, shown = boxes_at(mean[:, :, 0], size, self._config)
        table = Trajectories(
            t=t,
            track_id=np.repeat(np.array([path.given for path in paths], dtype=np.int64), lengths),
            boxes=boxes,
            existence=np.ones(len(t)),
            mean=mean.transpose(0, 2, 1).reshape(-1, 6),
            var=np.repeat(np.diagonal(cov, axis1=1, axis2=2), 2, axis=1),
            used=used,
            sensors=newest.sensors,
            classes=None if newest.classes is None else newest.classes[row],
            class_probability=None if newest.class_probability is None else newest.class_probability[row],
            size_var=size * size * size_cov[:, :1, 0],
        )
        if self._rate_hz > 0.0:
            shown &= np.isin(t, self._wanted)
        return [table if shown.all() else table.take(shown)]

    def _note_wanted(self, t: float) -> None:
        """Note whether the table has rows at a step: at the first in each interval of the output's rate."""
        interval = math.floor(t * self._rate_hz + _ROUNDING)
        if self._rate_hz > 0.0 and interval > self._bin:
            self._bin = interval
            self._wanted.append(t)


def _in_order(table: Trajectories) -> Trajectories:
    """Return rows in order of time, then of identity."""
    return table.take(np.lexsort((table.track_id, table.t)))
