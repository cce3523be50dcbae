"""Why something is a track, or is not: a recording tracked again, with the terms of each track's log odds."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import ConfigError
from jeat_graph.runs.measured import complete_record, recorded_inputs
from jeat_graph.tracking.hypotheses import Hypotheses, SensorEffect
from jeat_graph.tracking.tracker import Tracker

#: Boxes and tracks count as being at a time within so much of it (s).
NEAR_S = 0.15


class TrackMoment(NamedTuple):
    """One track at one step.

    Attributes:
        t: time (s).
        log_odds: of being real.
        terms: what makes them up, by name; their sum, but for what was learnt in this very step.
        other: the most probable other hypothesis, in words.
        reported: whether the causal table has the track.
        visible: probability that it is there and not hidden.
        unseen_s: time since the last detection that confirmed it (s).
        effects: what is known of each sensor did to it; of the last moment of a track alone.
    """

    t: float
    log_odds: float
    terms: dict[str, float]
    other: str
    reported: bool
    visible: float
    unseen_s: float
    effects: tuple[SensorEffect, ...] = ()

    @property
    def existence(self) -> float:
        """Probability of being real."""
        return float(expit(self.log_odds))

    @property
    def reason(self) -> str:
        """Why the table has the track here, or has not."""
        if self.reported:
            return "reported"
        if self.log_odds <= 0.0:
            worst = min(self.terms, key=lambda name: self.terms[name])
            return f"more likely {self.other}; most against it: {worst} ({self.terms[worst]:+.1f})"
        if self.unseen_s > 0.0:
            return f"unseen for {self.unseen_s:.2f} s: not likely to be there still"
        return "outside the picture"


class BoxThere(NamedTuple):
    """A box at a place.

    Attributes:
        t: time (s).
        sensor: its name.
        score: of the box.
        box: (4,) left, top, width, height (px).
        track_id: the track that took it.
    """

    t: float
    sensor: str
    score: float
    box: FloatArray
    track_id: int


class PlaceStory(NamedTuple):
    """What is at a place at a time.

    Attributes:
        boxes: that contain it, in order of time.
        tracks: the last moment of each track that took one of them, or whose own box contains it.
    """

    boxes: list[BoxThere]
    tracks: dict[int, TrackMoment]


class _ReplayedStep(NamedTuple):
    t: float
    batch: list[Scan]
    assigned: list[IntArray]
    found: Hypotheses


def explain_tracks(
    config: Config, detections: Detections, track_ids: Collection[int]
) -> dict[int, list[TrackMoment]]:
    """Return the moments of tracks by their identity, from first box to end; of those that there are.

    Args:
        config: of the recording.
        detections: as they were tracked.
        track_ids: identities of causal tracks.

    Raises:
        ConfigError: the configuration's engine has no hypotheses.
    """
    wanted, out = np.array(sorted(track_ids), dtype=np.int64), dict[int, list[TrackMoment]]()
    last: dict[int, tuple[Hypotheses, int]] = {}
    for step in _steps(config, detections):
        rows = np.flatnonzero(np.isin(step.found.track_id, wanted))
        for row in rows.tolist():
            track_id = int(step.found.track_id[row])
            out.setdefault(track_id, []).append(_moment(step, row))
            last[track_id] = step.found, row
        if not len(rows) and len(out) == len(wanted):
            break
    for track_id, (found, row) in last.items():
        out[track_id][-1] = out[track_id][-1]._replace(effects=tuple(found.effects(row)))
    return out


def explain_place(
    config: Config, detections: Detections, t: float, x: float, y: float, within_s: float = NEAR_S
) -> PlaceStory:
    """Return what lies at a place in the picture around a time.

    Args:
        config: of the recording.
        detections: as they were tracked.
        t: time (s).
        x: the place (px),
        y: and its other coordinate (px).
        within_s: how far from the time boxes and tracks may be (s).

    Raises:
        ConfigError: the configuration's engine has no hypotheses.
    """
    boxes: list[BoxThere] = []
    tracks: dict[int, TrackMoment] = {}
    for step in _steps(config, detections):
        if step.t < t - within_s:
            continue
        if step.t > t + within_s:
            break
        for scan, assigned in zip(step.batch, step.assigned, strict=True):
            for k in np.flatnonzero(_contain(scan.boxes, x, y)):
                score, track_id = float(scan.scores[k]), int(assigned[k])
                boxes.append(BoxThere(scan.t, scan.sensor, score, scan.boxes[k], track_id))
        wanted = _contain(step.found.boxes, x, y)
        wanted |= np.isin(step.found.track_id, [one.track_id for one in boxes])
        for row in np.flatnonzero(wanted):
            tracks[int(step.found.track_id[row])] = _moment(step, int(row))
    return PlaceStory(boxes, tracks)


def run_to_explain(folder: Path, moved: list[str] | None = None) -> tuple[Config, Detections]:
    """Return a run's configuration and its detections.

    Args:
        folder: the run directory.
        moved: where the inputs are now, if they have moved.

    Raises:
        DataError: there is no run, or an input is missing or has changed since.
    """
    return recorded_inputs(folder, complete_record(folder), moved)


def _steps(config: Config, detections: Detections) -> Iterator[_ReplayedStep]:
    causal = replace(config.smoother, engine="none", identities="causal")
    tracker = Tracker(replace(config, smoother=causal))
    if not tracker.can_explain:
        raise ConfigError(f"tracker.engine={config.tracker.engine} weighs no hypotheses: nothing to explain")
    for batch in detections.batches():
        tracker.step(batch)
        ends = np.cumsum([len(scan) for scan in batch])[:-1]
        assigned = np.split(tracker.assigned(sum(map(len, batch))), ends)
        yield _ReplayedStep(batch[0].t, list(batch), assigned, tracker.hypotheses())


def _moment(step: _ReplayedStep, row: int) -> TrackMoment:
    found, terms = step.found, step.found.terms
    named = {}
    for k, name in enumerate(found.sensors):
        named[f"{name}: hits and misses"] = float(terms.hits_and_misses[row, k])
        named[f"{name}: scores"] = float(terms.scores[row, k])
    named["motion"] = float(terms.motion[row])
    named["second box"] = float(terms.second_box[row])
    named["other hypotheses"] = float(terms.rest[row])
    other = int(terms.other[row])
    return TrackMoment(
        t=step.t,
        log_odds=float(found.log_odds[row]),
        terms=named,
        other="noise" if other < 0 else f"a false object of {found.sensors[other]!r}",
        reported=bool(found.reported[row]),
        visible=float(found.visible[row]),
        unseen_s=float(found.unseen_s[row]),
    )


def _contain(boxes: FloatArray, x: float, y: float) -> BoolArray:
    """Whether boxes (M, 4) contain a place: (M,)."""
    place = np.array([x, y])
    low, side = boxes[:, :2], boxes[:, 2:]
    return np.asarray(((low <= place) & (place <= low + side)).all(axis=1))
