"""Records the steps of a tracker and hands them to the smoothers in packets of some steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray, RecordArray
from jeat_graph.smoothers.measurements import concatenate_measurements
from jeat_graph.tracking.classes import Votes
from jeat_graph.tracking.step_record import StepRecord


class Packet(NamedTuple):
    """Some consecutive steps of a tracker: plain arrays, fit to be sent to another process.

    Attributes:
        t: (K,) times of the steps (s).
        wanted: (K,) whether the smoothed table gets rows at the step.
        counts: (K,) living tracks after each step; their L = Σ counts rows follow one another below.
        ids: (L,) identities.
        existence: (L,) probability of existence.
        worth: (L,) probability that what one sensor alone sees with such scores is a vehicle; 1 elsewhere.
        used: (L,) bit k is set where a detection of sensor k was taken.
        confirmed: (L,) whether the track is confirmed.
        held: (L,) whether it is reported as standing still.
        fit: (L, 2) how likely its box fits, by the scores of its detections (`filters.fit`).
        updates: (M,) records of the update log.
        ended: identities of the tracks that ended.
        votes: what the M detections say of classes, or None.
        given: (L,) identities that the tables are to have in place of `ids`.
    """

    t: FloatArray
    wanted: BoolArray
    counts: IntArray
    ids: IntArray
    existence: FloatArray
    worth: FloatArray
    used: IntArray
    confirmed: BoolArray
    held: BoolArray
    fit: FloatArray
    updates: RecordArray
    ended: list[int]
    votes: Votes | None
    given: IntArray


class StepRecorder:
    """Copies what the smoothers need of each step of a tracker, and hands out packets of steps.

    A packet is full after so many steps as a smoother takes measurements at once, or when a confirmed track
    has ended, so that its smoother is freed at once. When that is depends on the steps alone.

    Args:
        config: settings of the smoother.
    """

    def __init__(self, config: Config) -> None:
        self._steps = max(config.smoother.chunk, 1)
        self._rate_hz = config.smoother.output_rate_hz
        self._bin = -np.inf
        self._ids: IntArray = np.zeros(0, dtype=np.int64)
        self._confirmed: BoolArray = np.zeros(0, dtype=np.bool_)
        self._ended: list[int] = []
        self._recorded: list[tuple[StepRecord, bool]] = []

    def record(self, step: StepRecord) -> bool:
        """Record one step; whether the packet is full then."""
        self._recorded.append((step, self._row_wanted(step.t)))
        over = False
        if len(step.ids) - step.births != len(self._ids):
            gone = ~np.isin(self._ids, step.ids)
            self._ended.extend(self._ids[gone].tolist())
            over = bool(self._confirmed[gone].any())
        self._ids, self._confirmed = step.ids, step.confirmed
        return over or len(self._recorded) >= self._steps

    def drain(self) -> Packet | None:
        """Return, and forget, the steps recorded since the last call; None if there are none."""
        if not self._recorded:
            return None
        steps, wanted = zip(*self._recorded, strict=True)
        packet = Packet(
            np.array([step.t for step in steps]),
            np.array(wanted, dtype=np.bool_),
            np.array([len(step.ids) for step in steps], dtype=np.int64),
            np.concatenate([step.ids for step in steps]),
            np.concatenate([step.existence for step in steps]),
            np.concatenate([step.worth for step in steps]),
            np.concatenate([step.used for step in steps]),
            np.concatenate([step.confirmed for step in steps]),
            np.concatenate([step.held for step in steps]),
            np.concatenate([step.fit for step in steps]),
            concatenate_measurements([step.updates for step in steps if len(step.updates)]),
            self._ended,
            Votes.join([step.votes for step in steps], [len(step.updates) for step in steps]),
            np.concatenate([step.ids if step.given is None else step.given for step in steps]),
        )
        self._recorded, self._ended = [], []
        return packet

    def _row_wanted(self, t: float) -> bool:
        """Whether the table gets rows at this step: the first one in each interval of the output's rate."""
        if self._rate_hz <= 0.0:
            return True
        bin_ = np.floor(t * self._rate_hz + 1e-9)
        wanted = bool(bin_ > self._bin)
        self._bin = bin_
        return wanted
