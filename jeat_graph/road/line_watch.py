"""Vehicles as they pass a line of one camera, while they drive: from the boxes of a tracker's answers.

A vehicle stands on the road where the middle of its box's lower side does. Its way across the line is a
straight one, fitted to its places within a second before and after it, so that a passage is reported about a
second late. Times are those of the answers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.embeddings import packed_embedding
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.lanes import Lanes
from jeat_graph.road.report import speed_share

#: Places so long (s) before and after the line tell when and how fast it is passed.
_REACH_S = 1.0
#: A way across the line is reported from so many places on.
_LEAST_PLACES = 4
#: A track that has had no place for longer (s) has ended.
_ENDED_S = 3.0
#: Errors of places that are closer together than this (s) are about the same.
_SAME_ERROR_S = 0.25
#: Least standard deviations: of a place (m), and of a speed as a share.
_LEAST_PLACE_M, _LEAST_SPEED_SHARE = 0.1, 0.01
#: Nothing on a road moves slower (m/s) or faster where it passes a line and a time is reported.
_SLOWEST, _FASTEST = 0.5, 90.0


AppearanceOf: TypeAlias = Callable[[int], FloatArray | None]


class LinePassage(NamedTuple):
    """A vehicle that has passed the line.

    Attributes:
        track_id: its identity.
        t: when (s).
        sigma_t: standard deviation (s).
        speed: m/s.
        sigma_speed: standard deviation as a share of it.
        lane: name, or empty.
        kind: class, or empty.
        appearance: its embedding when it passed (`data.embeddings.packed_embedding`), or empty.
    """

    track_id: int
    t: float
    sigma_t: float
    speed: float
    sigma_speed: float
    lane: str
    kind: str
    appearance: str = ""


class _Way:
    """Places of a track near the line: time, distance beyond the line (m), share of the line, x and y (m)."""

    __slots__ = ("appearance", "crossed", "kind", "places", "reported")

    def __init__(self) -> None:
        self.places: list[tuple[float, float, float, float, float]] = []
        self.crossed: float | None = None
        self.reported = False
        self.kind = ""
        self.appearance = ""


class LineWatch:
    """Watches one line of one camera.

    Args:
        camera: calibrated.
        ends: (2, 2) of the line on the road (m; `crossings.road_line`).
        direction: `left` or `right`: the side to which the traffic that counts crosses the line.
        lanes: of the road.
    """

    def __init__(self, camera: RoadCamera, ends: FloatArray, direction: str, lanes: Lanes) -> None:
        self._camera, self._lanes = camera, lanes
        along = ends[1] - ends[0]
        self._length = float(np.linalg.norm(along))
        left = np.array([-along[1], along[0]]) / self._length
        self._start, self._along = ends[0], along / self._length
        self._beyond = left if direction == "left" else -left
        middle = ends.mean(axis=0)
        share = speed_share(camera, float(middle[0]), float(middle[1]))
        self._share = share if math.isfinite(share) else 0.0
        self._ways: dict[int, _Way] = {}

    def take(
        self, t: float, table: Trajectories, appearance_of: AppearanceOf | None = None
    ) -> list[LinePassage]:
        """Take in the tracks of one moment.

        Args:
            t: time (s); one that is before the last is taken where it belongs.
            table: the tracks.
            appearance_of: returns the embedding (E,) of a track, or None; asked as a track passes the line.

        Returns:
            The vehicles of which it is known now that they have passed.
        """
        if not len(table) and not self._ways:
            return []
        boxes = table.boxes
        foot = np.empty((len(boxes), 2))
        foot[:, 0], foot[:, 1] = boxes[:, 0] + 0.5 * boxes[:, 2], boxes[:, 1] + boxes[:, 3]
        place = self._camera.to_road(foot) if len(foot) else foot
        # What the picture cuts off at its lower edge stands nowhere that is seen.
        seen = np.isfinite(place).all(axis=1) & (foot[:, 1] < self._camera.height - 1.0)
        beyond = (place - self._start) @ self._beyond
        share = (place - self._start) @ self._along / self._length
        rows = zip(table.track_id.tolist(), beyond.tolist(), share.tolist(), place.tolist(), strict=True)
        for k, (identity, ahead, part, (x, y)) in enumerate(rows):
            if not seen[k]:
                continue
            way = self._ways.get(identity)
            if way is None:
                way = self._ways[identity] = _Way()
            way.kind = "" if table.classes is None else str(table.classes[k])
            if not way.reported and self._goes(way, t, (ahead, part, x, y)) and appearance_of is not None:
                embedding = appearance_of(identity)
                way.appearance = "" if embedding is None else packed_embedding(embedding)
        return [one for identity in list(self._ways) if (one := self._passage(t, identity)) is not None]

    def _goes(self, way: _Way, t: float, place: tuple[float, float, float, float]) -> bool:
        """Add a place; whether the line was passed between this and the one before."""
        if way.places and t <= way.places[-1][0]:
            return False
        before = way.places[-1] if way.places else None
        way.places.append((t, *place))
        if way.crossed is None:
            if before is not None and before[1] < 0.0 <= place[0]:
                part = -before[1] / (place[0] - before[1])
                if 0.0 <= before[2] + part * (place[1] - before[2]) <= 1.0:
                    way.crossed = before[0] + part * (t - before[0])
            way.places = [one for one in way.places if one[0] >= t - 2.0 * _REACH_S]
            return way.crossed is not None
        return False

    def _passage(self, now: float, identity: int) -> LinePassage | None:
        """What is to be reported of a track now; one that has ended is forgotten."""
        way = self._ways[identity]
        last = way.places[-1][0] if way.places else now
        ended = now - last > _ENDED_S or now < last - _ENDED_S
        if ended:
            del self._ways[identity]
        if way.reported or way.crossed is None or not (ended or last >= way.crossed + _REACH_S):
            return None
        way.reported = True
        found = self._fitted(identity, way)
        way.places = way.places[-1:]
        return found

    def _fitted(self, identity: int, way: _Way) -> LinePassage | None:
        """Fit a straight way through the places around the line; None where none can be reported."""
        rows = np.array(way.places)
        rows = rows[np.abs(rows[:, 0] - (way.crossed or 0.0)) <= _REACH_S]
        if len(rows) < _LEAST_PLACES:
            return None
        t = rows[:, 0] - rows[:, 0].mean()
        squares = float((t * t).sum())
        slope = t @ (rows[:, 1:] - rows[:, 1:].mean(axis=0)) / squares
        across, speed = float(slope[0]), float(np.hypot(slope[2], slope[3]))
        if not (across > _SLOWEST and speed < _FASTEST):
            return None
        middle = rows.mean(axis=0)
        at = middle[0] - middle[1] / across
        residual = rows[:, 1] - middle[1] - across * t
        # Errors of neighbours are similar: so many places count as tell something new.
        span = float(rows[-1, 0] - rows[0, 0])
        effective = max(min(len(rows), span / _SAME_ERROR_S + 1.0), 2.0)
        place_sd = max(float(np.sqrt((residual**2).sum() / (len(rows) - 2))), _LEAST_PLACE_M)
        noise = place_sd / math.sqrt(effective)
        speed_sd = noise / math.sqrt(squares / len(rows)) / across
        x = float(middle[3] + slope[2] * (at - middle[0]))
        return LinePassage(
            identity,
            round(float(at), 4),
            round(noise / across, 5),
            speed,
            math.hypot(max(speed_sd, _LEAST_SPEED_SHARE), self._share),
            str(self._lanes.of(np.array([x]))[0]),
            way.kind,
            way.appearance,
        )

    @staticmethod
    def until(t: float) -> float:
        """Return up to which time (s) all passages are reported, once the answers have come to `t` (s)."""
        return t - _ENDED_S - _REACH_S

    def state(self) -> list[list[Any]]:
        """Return what `set_state` takes: plain data."""
        return [
            [identity, way.crossed, way.reported, way.kind, way.appearance, list(map(list, way.places))]
            for identity, way in self._ways.items()
        ]

    def set_state(self, state: list[list[Any]]) -> None:
        """Go on from what `state` returned."""
        self._ways = {}
        for identity, crossed, reported, kind, appearance, places in state:
            way = self._ways.setdefault(int(identity), _Way())
            way.crossed, way.reported, way.kind = crossed, bool(reported), str(kind)
            way.appearance, way.places = str(appearance), [tuple(one) for one in places]


def chosen_line(lines: Mapping[str, Any], wanted: str | None) -> str:
    """Return the name of the line that counts.

    Raises:
        ValueError: there is no such line, or it has to be said which.
    """
    if wanted is None and len(lines) == 1:
        return next(iter(lines))
    if wanted is None or wanted not in lines:
        names = ", ".join(lines) or "none"
        raise ValueError(
            f"has the lines {names}; say which" if wanted is None else f"has no line {wanted!r}: {names}"
        )
    return wanted
