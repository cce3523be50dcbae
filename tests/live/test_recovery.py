"""After any sequence of wrong times, restarts and saved states the vehicle is found again, and silence is told."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.live.late import LiveTracker
from jeat_graph.live.memory import CAPACITY, Memory, fingerprint
from jeat_graph.live.messages import Duplicates, decode_scans
from jeat_graph.live.session import Ends, Session
from jeat_graph.live.time_base import TimeBase
from jeat_graph.live.untaken import Untaken
from jeat_graph.tracking.tracker import Tracker

CONFIG = load_config("default", ["smoother.engine=none"])
RATE_HZ = 20.0
#: Scans in a row, in order and without a pause, after which the vehicle must be there (s).
RECOVERED_S = 12.0
#: After so many seconds of which nothing is taken somebody must have been told.
TOLD_S = 6.0


def scan_at(t, sensor="rgb", since=0.0, number=0):
    """A vehicle that crosses the picture again and again; `number` makes each scan's boxes its own."""
    left = 100.0 + 20.0 * ((t - since) % 40.0)
    return Scan(t, sensor, [[left, 100.0, 40.0, 30.0], [900.0, 500.0 + number % 100, 20.0, 20.0]], [0.9, 0.05])


class World:
    """A session with what it said, a clock that can be wrong, and messages of two sensors."""

    def __init__(self, folder: Path, form: str, policy: str = "rewind") -> None:
        self.file, self.form = folder / "state.npz", form
        self.said: list[str] = []
        self.answers: list[tuple[float, int]] = []
        self.t, self.number, self.untold_s = 100.0, 0, 0.0
        self._begin(LiveTracker(Tracker(CONFIG), policy), None)

    def _begin(self, live, more):
        ends = Ends(tracks=lambda t, table, *_: self.answers.append((t, len(table))), warn=self.said.append)
        self.session = Session(live, ends, self.file, math.inf, more)

    def restart(self):
        self.session.save()
        self._begin(*LiveTracker.load(self.file))

    def send(self, t, joint=True):
        """Send the scans of a moment; `joint` as one message."""
        self.number += 1
        names = ("evt", "rgb") if self.form == "two" else ("rgb",)
        groups = [names] if joint else [(name,) for name in names]
        answers, said = len(self.answers), len(self.said)
        for group in groups:
            scans = [
                {
                    "t": t,
                    "sensor": name,
                    "boxes": scan_at(t, since=self.t - 20.0, number=self.number).boxes.tolist(),
                    "scores": [0.9, 0.05],
                }
                for name in group
            ]
            self.session.accept(decode_scans(json.dumps(scans).encode(), "x", self.number))
        self.untold_s = 0.0 if len(self.answers) > answers or len(self.said) > said else self.untold_s + 1.0 / RATE_HZ

    def go_on(self, seconds, joint=True):
        """Send scans in order; nothing may be passed over for long without a word."""
        for _ in range(round(RATE_HZ * seconds)):
            self.t += 1.0 / RATE_HZ
            self.send(self.t, joint)
            assert self.untold_s <= TOLD_S, self.said


JUMPS_S = [1e-3, 0.2, 1.0, 4.0, 4.9, 5.1, 8.0, 19.0, 70.0, 290.0, 310.0, 3600.0, 1e6, 1e9, 1.7e18, 1e300]
JUMP = st.builds(lambda s, sign: sign * s, st.sampled_from(JUMPS_S), st.sampled_from([1.0, -1.0]))
EVENT = st.one_of(
    st.tuples(st.just("wrong"), JUMP, st.integers(1, 30), st.booleans()),  # messages with a wrong time
    st.tuples(st.just("scattered"), JUMP, st.integers(1, 12), st.booleans()),  # each with another one
    st.tuples(st.just("clock"), st.sampled_from([s for s in JUMPS_S if s < 1e7]), st.booleans(), st.none()),
    st.tuples(st.just("restart"), st.none(), st.none(), st.none()),
    st.tuples(st.just("order"), st.floats(0.05, 4.0), st.booleans(), st.none()),
    st.tuples(st.just("late"), st.floats(0.01, 30.0), st.integers(1, 20), st.none()),
    st.tuples(st.just("none"), st.sampled_from([math.nan, math.inf, -math.inf]), st.none(), st.none()),
)


def happen(world, kind, first, second, third):
    if kind == "wrong":
        for k in range(second):
            world.send(world.t + first + k / RATE_HZ, third)
    elif kind == "scattered":
        for k in range(second):
            world.send(world.t + first * (k + 1.0), third)
    elif kind == "clock":
        world.t += first if second else -first
    elif kind == "restart":
        world.restart()
    elif kind == "order":
        world.go_on(first, second)
    elif kind == "late":
        for k in range(second):
            world.send(world.t - first + 0.01 * k)
    else:
        with pytest.raises(DataError, match="finite"):
            world.session.accept(decode_scans(f'{{"t": {json.dumps(first)}, "sensor": "rgb", "boxes": [], "scores": []}}'.encode(), "x", 1))


@settings(max_examples=400)
@given(
    events=st.lists(EVENT, min_size=1, max_size=12),
    form=st.sampled_from(["one", "two"]),
    policy=st.sampled_from(["rewind", "skip"]),
    joint=st.booleans(),
)
def test_after_any_history_the_vehicle_is_found_again_within_some_seconds_of_order(events, form, policy, joint):
    with TemporaryDirectory() as folder:
        world = World(Path(folder), form, policy)
        for event in events:
            happen(world, *event)
        world.untold_s = 0.0
        world.go_on(RECOVERED_S, joint)
        answers = len(world.answers)
        world.go_on(1.0, joint)
        assert len(world.answers) - answers >= RATE_HZ
        t, count = world.answers[-1]
        assert t == world.t
        assert count >= 1
