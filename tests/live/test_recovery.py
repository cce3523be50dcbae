"""After any wrong times, restarts and saved states the vehicle is found again, and silence is reported."""

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
#: The clock of one sensor is known to be behind, and its scans come late.
APART_S = 0.4
APART = load_config(
    "default", ["smoother.engine=none", f"sensors.evt.latency_s={APART_S}", "live.late_s=0.5"]
)
RATE_HZ = 20.0
#: Scans in a row, in order and without a pause, after which the vehicle must be there (s).
RECOVERED_S = 12.0
#: After so many seconds of which nothing is taken somebody must have been told.
TOLD_S = 6.0


def scan_at(t, sensor="rgb", since=0.0, number=0):
    """A vehicle that crosses the picture again and again; `number` makes each scan's boxes its own."""
    left = 100.0 + 20.0 * ((t - since) % 40.0)
    boxes = [[left, 100.0, 40.0, 30.0], [577 * number % 1100, 211 * number % 600, 20.0, 20.0]]
    return Scan(t, sensor, boxes, [0.9, 0.05])


class World:
    """A session with what it said, a clock that can be wrong, and messages of two sensors."""

    def __init__(self, folder: Path, form: str, policy: str = "rewind") -> None:
        self.file, self.form = folder / "state.npz", form
        self.said: list[str] = []
        self.answers: list[tuple[float, int]] = []
        self.t, self.number, self.untold_s = 100.0, 0, 0.0
        self._begin(LiveTracker(Tracker(APART if form == "apart" else CONFIG), policy), None)

    def _begin(self, live, more):
        ends = Ends(tracks=lambda t, table, *_: self.answers.append((t, len(table))), warn=self.said.append)
        self.session = Session(live, ends, self.file, math.inf, more)

    def restart(self):
        self.session.save()
        self._begin(*LiveTracker.load(self.file))

    def send(self, t, joint=True):
        """Send the scans of a moment; `joint` as one message."""
        self.number += 1
        names = ("rgb",) if self.form == "one" else ("evt", "rgb")
        groups = [names] if joint and self.form != "apart" else [(name,) for name in names]
        answers, said = len(self.answers), len(self.said)
        for group in groups:
            scans = [
                {
                    "t": t + APART_S if self.form == "apart" and name == "evt" else t,
                    "sensor": name,
                    "boxes": scan_at(t, since=self.t - 20.0, number=self.number).boxes.tolist(),
                    "scores": [0.9, 0.05],
                }
                for name in group
            ]
            self.session.accept(decode_scans(json.dumps(scans).encode(), "x", self.number))
        if len(self.answers) > answers or len(self.said) > said:
            self.untold_s = 0.0
        else:
            self.untold_s += 1.0 / RATE_HZ

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
        refused = {"t": first, "sensor": "rgb", "boxes": [], "scores": []}
        with pytest.raises(DataError, match="finite"):
            world.session.accept(decode_scans(json.dumps(refused).encode(), "x", 1))


@settings(max_examples=10)
@given(
    events=st.lists(EVENT, min_size=1, max_size=12),
    form=st.sampled_from(["one", "two", "apart"]),
    policy=st.sampled_from(["rewind", "skip"]),
    joint=st.booleans(),
)
def test_after_any_history_the_vehicle_is_found_again_within_some_seconds_of_order(
    events, form, policy, joint
):
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


def live_of(policy="rewind"):
    return LiveTracker(Tracker(CONFIG), policy)


def both(t, since=0.0, number=0):
    return [scan_at(t, "evt", since, number), scan_at(t, "rgb", since, number)]


def in_order(begin, seconds):
    """Messages of two sensors."""
    return [both(begin + k / RATE_HZ, number=k) for k in range(round(RATE_HZ * seconds))]


def steps(live, messages):
    """The arrivals of messages, and how many of them had something taken."""
    said = [live.step(message) for message in messages]
    return said, sum(bool(one.taken) for one in said)


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("jump_s", [6.0, 290.0, 1e9, 1e300])
@pytest.mark.parametrize("policy", ["rewind", "skip", "refuse"])
def test_messages_of_two_sensors_with_a_wrong_time_are_witnesses_and_no_proof(count, jump_s, policy):
    live = live_of(policy)
    wrong = [both(2.0 + jump_s + k / RATE_HZ) for k in range(count)]
    said, taken = steps(live, [*in_order(0.0, 2.0), *wrong, *in_order(2.0, 3.0)])
    assert taken == RATE_HZ * 5.0
    assert sum(len(one.refuted) for one in said) == (2 if jump_s == 1e300 else 2 * count)
    assert said[-1].t == pytest.approx(5.0 - 1 / RATE_HZ)
    assert 1 in said[-1].table.track_id  # the track of before


@pytest.mark.parametrize(("count", "lost"), [(3, 3), (8, 8), (40, 100)])
@pytest.mark.parametrize("policy", ["rewind", "skip"])
def test_wrong_messages_that_were_believed_cost_as_many_or_five_seconds(count, lost, policy):
    """What waited is taken as well, so that only answers are lost: 3 to 100 of 160."""
    wrong = [both(1e9 + k / RATE_HZ) for k in range(count)]
    said, taken = steps(live_of(policy), [*in_order(0.0, 2.0), *wrong, *in_order(2.0, 8.0)])
    assert [one.leapt for one in said].count(True) == [one.reset for one in said].count(True) == 1
    assert taken == 40 + count - 2 + 160 - lost
    assert said[-1].t == pytest.approx(10.0 - 1 / RATE_HZ)
    assert len(said[-1].table) == 1


def test_a_jump_that_is_believed_never_widens_the_bound():
    base, now = TimeBase(5.0), None
    times = (
        [0.05 * k for k in range(100)] + [1e6 * (k + 1) for k in range(9)] + [0.05 * k for k in range(2000)]
    )
    for t in times:
        decision = base.decide(
            [scan_at(t)], now, now is not None and t < now - 0.3, {"rgb": now or 0.0, "evt": -math.inf}
        )
        if decision.take and not decision.leapt and not decision.reset and t >= (now or t):
            base.took(now, t)
        if decision.take:
            now = decision.take[-1].t
        assert base.bound_s <= 60.0
    assert base.bound_s == 5.0
    assert now == times[-1]


def test_slow_sensors_are_near_themselves():
    base = TimeBase(5.0)
    for k in range(8):
        base.took(12.0 * k, 12.0 * (k + 1))
    assert base.bound_s == 48.0
    base.took(96.0, 96.0 + 47.0)
    assert base.bound_s == 48.0, "one long pause is not usual"


@pytest.mark.parametrize("policy", ["rewind", "skip"])
def test_a_recording_of_three_seconds_in_a_loop_starts_anew_again_and_again(policy):
    """No time of it is ever as late as `live.jump_s`."""
    said, _ = steps(live_of(policy), [both(3.0 * (k % 60) / 60, number=k) for k in range(60 * 9)])
    gaps = [k for k, one in enumerate(said) if one.taken]
    assert max(b - a for a, b in pairwise(gaps)) <= 5.2 * RATE_HZ
    assert sum(one.reset for one in said) > 2


@pytest.mark.parametrize("step_s", [1e-6, 0.0])
def test_a_clock_that_hardly_moves_is_believed_after_a_thousand_messages(step_s):
    live = live_of()
    steps(live, in_order(500.0, 1.0))
    said, _ = steps(live, [both(100.0 + step_s * k, number=k) for k in range(1050)])
    assert sum(one.reset for one in said) == (step_s > 0.0)  # of one that stands, all is the same scan
    assert len(live._base.row) <= 1000


@pytest.mark.parametrize("wrong", [1, 3])
@pytest.mark.parametrize("policy", ["rewind", "skip"])
def test_a_state_with_a_wrong_time_heals_when_it_is_loaded(wrong, policy, tmp_path):
    live = live_of(policy)
    steps(live, [*in_order(0.0, 2.0), *[both(1e9 + k / RATE_HZ) for k in range(wrong)]])
    live.save(tmp_path / "state.npz")
    again, _ = LiveTracker.load(tmp_path / "state.npz")
    said, taken = steps(again, in_order(2.0, 4.0))
    assert not any(one.repeated for one in said)
    assert taken >= 80 - 3
    assert said[-1].t == pytest.approx(6.0 - 1 / RATE_HZ)


@pytest.mark.parametrize("policy", ["rewind", "skip"])
def test_a_clock_that_was_set_back_while_nobody_ran_is_no_repetition(policy, tmp_path):
    """After a power cut the sensors count from 0 again; the same input given once more is known as such."""
    live = live_of(policy)
    messages = in_order(0.0, 20.0)
    steps(live, messages)
    live.save(tmp_path / "state.npz")
    again, _ = LiveTracker.load(tmp_path / "state.npz")
    said, taken = steps(again, messages)
    assert taken == 0
    assert all(len(one.repeated) == 2 for one in said)
    rebooted = [both(k / RATE_HZ, -7.0, k + 13) for k in range(200)]
    said, taken = steps(again, rebooted)
    assert sum(one.reset for one in said) == 1
    assert taken >= 200 - 110
    assert said[-1].t == pytest.approx(10.0 - 1 / RATE_HZ)


@given(st.integers(0, 2**32), st.integers(1, 6 * CAPACITY))
@settings(max_examples=10)
def test_memory_is_bounded_and_never_wrong(seed, count):
    random = np.random.default_rng(seed)
    prints = [fingerprint(str(one).encode()) for one in random.permutation(2 * count).tolist()]
    memory, again = Memory(), Memory()
    for one in prints[:count]:
        memory.note(one)
    again.set_state(memory.state())
    for one in (memory, again):
        assert False not in {one.knows(known) for known in prints[:count]}
        assert True not in {one.knows(known) for known in prints[count:]}
        sure = [one.knows(known) is not None for known in prints]
        assert sum(sure) >= min(2 * count, CAPACITY // 4)
    assert len(memory.state()["kept"]) <= CAPACITY
    assert Memory(whole=False).knows(prints[0]) is None


def message(seq, t, sensor="rgb", source="g7"):
    scan = {"t": t, "sensor": sensor, "boxes": [[100 + 5 * (t % 60.0), 100, 40, 30]], "scores": [0.9]}
    return decode_scans(json.dumps({"v": 1, "source": source, "seq": seq, "scans": [scan]}).encode(), "x", 1)


@pytest.mark.parametrize("taken", [100, 1300])
def test_a_source_that_counts_anew_with_its_clock_set_back_was_started_again(taken):
    duplicates = Duplicates()
    assert all(duplicates.is_new(message(k, 5000.0 + 0.05 * k)) for k in range(taken))
    assert all(duplicates.is_new(message(k, 0.031 + 0.05 * k)) for k in range(taken))
    assert duplicates.restarts == {"g7": 1}
    assert not any(duplicates.is_new(message(k, 5000.0 + 0.05 * k)) for k in range(taken))
    assert not any(duplicates.is_new(message(k, 0.031 + 0.05 * k)) for k in range(taken))
    assert duplicates.restarts == {"g7": 1}


def test_a_message_with_a_wrong_time_does_not_hide_that_its_source_is_started_again():
    duplicates = Duplicates()
    times = [0.05 * k for k in range(100)] + [1e9] + [0.05 * k for k in range(100, 200)]
    assert all(duplicates.is_new(message(k, t)) for k, t in enumerate(times))
    assert all(duplicates.is_new(message(k, 20.0 + 0.05 * k)) for k in range(200))
    assert duplicates.restarts == {"g7": 1}


def test_sources_are_forgotten_when_there_are_too_many():
    duplicates = Duplicates()
    for k in range(3 * Duplicates.SOURCES):
        assert duplicates.is_new(message(0, 0.01 * k, source=f"s{k}"))
    assert len(duplicates.seen) == Duplicates.SOURCES


def session_of(live=None, file=None, more=None):
    answered, said = [], []
    ends = Ends(tracks=lambda t, *_: answered.append(t), warn=said.append)
    return Session(live_of() if live is None else live, ends, file, more=more), answered, said


def test_a_sensor_of_which_nothing_is_taken_is_named_again_and_again():
    session, answered, said = session_of()
    for k in range(20 * 30):
        session.accept(message(None, k / 20, "rgb"))
        session.accept(message(None, k / 20 + 3600.0, "evt"))
    assert len(answered) == 20 * 30
    told = [text for text in said if "none of the last" in text]
    assert told[0] == (
        "warning: none of the last 100 scans of sensor 'evt' has been taken: the time 3604.950 s is "
        "3600.000 s after the newest, 4.950 s"
    )
    assert len(told) == 3
    for k in range(20 * 30, 20 * 31):
        session.accept(message(None, k / 20, "evt"))
    assert any("scans of sensor 'evt' are taken again, after 600" in text for text in said)


def test_messages_that_were_all_taken_before_are_told_of():
    session, answered, said = session_of()
    for _ in range(2):
        for k in range(1000):
            session.accept(message(k, k / 20))
    assert len(answered) == 1000
    told = [text for text in said if "had been taken before" in text]
    assert told[0].startswith(
        "warning: the last 100 messages had been taken before and are passed over, up to t = 4.950 s"
    )
    assert 3 <= len(told) <= 5
    assert session.duplicates == 1000


def test_no_sensor_is_called_silent_because_time_has_leapt():
    events = []
    session, _, said = session_of()
    session.ends.event = events.append
    for begin in (0.0, 3600.0, 50.0):
        for k in range(200):
            session.accept(message(None, begin + k / 20, "rgb"))
            session.accept(message(None, begin + k / 20, "evt"))
    assert events == []
    assert [text.split(":")[1].split(",")[0] for text in said if " time goes on " in text] == [
        " after a pause",
        " scans have been too late for long",
    ]


def test_names_of_what_is_not_taken_are_bounded():
    untaken = Untaken(5.0)
    for k in range(5000):
        untaken.untaken(f"s{k}", 0.0)
    assert len(untaken._runs) == Untaken.MOST


def test_time_begins_anew_from_the_end_of_the_numbers():
    tracker = Tracker(CONFIG)
    tracker.step(scan_at(0.0))
    tracker.step(scan_at(1.7e308))
    tracker.reset(-1.7e308)
    tracker.step(scan_at(-1.7e308))
    assert tracker.last_scans() == {"rgb": -1.7e308}
    for _ in range(5):  # the next later time is 2e292 s away
        now = tracker.step(scan_at(-1.7e308))
    assert len(now) == 1
    assert np.isfinite(now.mean).all()
    assert np.isfinite(now.var).all()
