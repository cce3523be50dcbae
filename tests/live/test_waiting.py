"""Scans that wait for a slow sensor come out in the order of their times, and not later than they must."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.detections import Scan
from jeat_graph.live.waiting import WaitingRoom

FAR_S = 5.0


def scan(t: float, sensor: str) -> Scan:
    return Scan(t, sensor, np.array([[100.0, 100.0, 40.0, 30.0]]), np.array([0.9]))


def arrivals(delay_s: list[float]) -> list[Scan]:
    """`rgb` at once and `evt` later, each ten times a second, in the order in which they come."""
    coming = [(0.1 * k, scan(0.1 * k, "rgb")) for k in range(60)]
    coming += [(0.1 * k + 0.05 + delay_s[k % len(delay_s)], scan(0.1 * k + 0.05, "evt")) for k in range(60)]
    return [one for _, one in sorted(coming, key=lambda pair: pair[0])]


@given(st.lists(st.floats(1.0, 1.9), min_size=1, max_size=20))
def test_all_come_out_once_and_in_order_however_the_slow_one_varies(delay_s):
    room = WaitingRoom({"evt": 0.0}, 2.0, 0.0, 0.0)
    out = [batch for one in arrivals(delay_s) for batch in room.enter([one], FAR_S).batches]
    left = room.clear()
    times = [batch[0].t for batch in out]
    # What comes later than one of its own sensor is out of order by no fault of the room.
    fast = [batch[0].t for batch in out if batch[0].sensor == "rgb"]
    assert fast == sorted(fast)
    assert sorted([*times, *(one.t for one in left)]) == sorted(one.t for one in arrivals(delay_s))
    if len(set(delay_s)) == 1:
        assert times == sorted(times)


def test_nobody_waits_longer_than_the_bound():
    room = WaitingRoom({"evt": 0.0}, 2.0, 0.0, 0.0)
    waits = []
    for k in range(100):  # the slow one never comes
        for batch in room.enter([scan(0.1 * k, "rgb")], FAR_S).batches:
            waits.append(0.1 * k - batch[0].t)
    assert max(waits) == pytest.approx(2.0, abs=0.11)


def test_scans_of_one_time_come_out_together():
    room = WaitingRoom({"evt": 0.0}, 2.0, 0.0, 0.0)
    assert room.enter([scan(1.0, "rgb")], FAR_S).batches == []
    ((one, other),) = room.enter([scan(1.0, "evt")], FAR_S).batches
    assert {one.sensor, other.sensor} == {"rgb", "evt"}


def test_what_had_been_reached_before_is_missed_but_for_what_one_can_go_back():
    room = WaitingRoom({"evt": 8.0}, 3.0, 10.0, 0.3)
    assert [one.t for one in room.enter([scan(9.0, "evt")], FAR_S).missed] == [9.0]
    assert room.enter([scan(9.8, "evt")], FAR_S).batches[0][0].t == 9.8


def test_a_time_that_is_far_away_does_not_wait():
    room = WaitingRoom({"evt": 0.0}, 2.0, 0.0, 0.0)
    room.enter([scan(0.5, "rgb")], FAR_S)
    ((wild,),) = room.enter([scan(1e6, "rgb")], FAR_S).batches
    assert wild.t == 1e6
    assert room.holds(scan(0.5, "rgb"))
    assert room.newest_s == 0.5
    room.clear()
    room.jumped(1e6)
    assert room.enter([scan(1e6 + 0.1, "rgb")], FAR_S).batches == []


def test_one_room_takes_over_another():
    old = WaitingRoom({"evt": 1.0}, 2.0, 0.0, 0.0)
    old.enter([scan(1.5, "rgb")], FAR_S)
    room = WaitingRoom({"lidar": 0.2}, 4.0, 1.0, 0.0).beside(old)
    assert room.enter([scan(1.6, "lidar")], FAR_S).batches == []  # the room also waits for evt
    batches = room.enter([scan(1.7, "evt")], FAR_S).batches
    assert [batch[0].t for batch in batches] == [1.5, 1.6]


def test_its_state_survives():
    room = WaitingRoom({"evt": 0.0}, 2.0, 0.0, 0.0)
    scans = arrivals([1.5])
    for one in scans[:50]:
        room.enter([one], FAR_S)
    again = WaitingRoom.of_state(room.state())
    for one in scans[50:]:
        ours, theirs = room.enter([one], FAR_S), again.enter([one], FAR_S)
        assert [[s.t for s in batch] for batch in ours.batches] == [[s.t for s in b] for b in theirs.batches]
