"""A clock that steps in a live stream is known from a pause, taken off and named; a drift is followed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph import load_config
from jeat_graph.data.detections import Scan
from jeat_graph.live import clock_watch
from jeat_graph.live.clock_steps import ClockSteps
from jeat_graph.live.clock_watch import ClockWatch
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.tracker import Tracker

RATES = {"rgb": 20.0, "evt": 100.0}
LATE_S = 0.3


def scan(t, sensor, x=100.0):
    return Scan(t, sensor, np.array([[x, 100.0, 80.0, 60.0]]), np.array([0.9]))


def arrivals(seconds, jitter=0.02, seed=0):
    """(true time, sensor) of two regular sensors in order of arrival; intervals vary by a share."""
    rng = np.random.default_rng(seed)
    found = [
        (round((k + jitter * rng.uniform(-1, 1)) / rate, 6), name)
        for name, rate in RATES.items()
        for k in range(1, round(seconds * rate))
    ]
    return sorted(found)


def judge(steps, times):
    """Give scans to a judge: what it takes (true time, its time), and the steps."""
    taken, found, refuted, together = [], [], [], []
    of = {}
    for true, name, t in times:
        one = scan(t - sum(s.step_s for s in found if s.sensor == name), name)
        of[id(one.boxes)] = true
        judged = steps.saw([one])
        taken += [(of[id(a.boxes)], a) for a in (*judged.released, *judged.take)]
        found += judged.steps
        refuted += judged.refuted
        together += [judged.together] if judged.together else []
    return taken, found, refuted, together


@pytest.mark.parametrize("sensor", ["rgb", "evt"])
@pytest.mark.parametrize("step_s", [0.3, 1.0, 8.0, 3600.0, -0.29, -1.0, -8.0, -3600.0])
def test_the_sensor_whose_intervals_jump_while_the_others_go_on_is_corrected(sensor, step_s):
    """All scans but the few of a clock that went back have their true times again."""
    times = [(t, s, t + step_s * (s == sensor and t > 3.0)) for t, s in arrivals(6.0)]
    taken, [found], refuted, together = judge(ClockSteps(LATE_S), times)
    assert (found.sensor, refuted, together) == (sensor, [], [])
    assert found.step_s == pytest.approx(step_s, abs=0.1 / RATES[sensor])
    assert len(taken) == len(times)
    wrong = [true for true, one in taken if abs(one.t - true) > 0.1 / RATES[sensor]]
    assert len(wrong) <= (0 if step_s > 0 else 25 if step_s > -LATE_S else max(5, 0.12 * RATES[sensor]))


@pytest.mark.parametrize("who", [("rgb",), ("evt",), ("rgb", "evt")])
@pytest.mark.parametrize("gap_s", [0.3, 2.0, 20.0])
def test_a_pause_of_one_sensor_or_of_all_is_no_step(who, gap_s):
    """The pauses are in the true times too: whoever pauses gives nothing meanwhile."""
    times = [(t, s, t) for t, s in arrivals(6.0 + gap_s) if s not in who or not 3.0 < t < 3.0 + gap_s]
    taken, found, refuted, together = judge(ClockSteps(LATE_S), times)
    assert (found, refuted, together) == ([], [], [])
    assert sorted(true for true, _ in taken) == [true for true, _, _ in times]
    assert all(one.t == true for true, one in taken)


@pytest.mark.parametrize("seed", range(8))
def test_a_backlog_that_is_caught_up_is_no_step(seed):
    """The pictures of a failure are lost; the events wait in the broker and come faster than in time."""
    rng = np.random.default_rng(seed)
    begin, gap_s, faster = 3.0, rng.uniform(0.15, 2.0), rng.uniform(1.5, 50.0)
    again = begin + gap_s + rng.uniform(0.0, 0.3)  # when the broker's client is connected again
    rates = {"rgb": rng.choice([10.0, 20.0, 30.0]), "evt": rng.choice([20.0, 50.0, 100.0])}
    came = []
    for name, rate in rates.items():
        for t in np.arange(1, round(7.0 * rate)) / rate:
            if name == "rgb":
                # Some pictures wait in the camera's own queue and come at once.
                lost = begin < t < begin + gap_s - rng.integers(4) / rate
                came += [] if lost else [(max(t, begin + gap_s) if t > begin else t, t, name)]
            else:
                came.append((t if t <= begin else max(t, again + (t - begin) / faster), t, name))
    times = [(t, name, t) for _, t, name in sorted(came)]
    _, found, _, together = judge(ClockSteps(LATE_S), times)
    assert (found, together) == ([], [])


@pytest.mark.parametrize("count", [1, 2, 3, 6, 11])
def test_a_sensor_that_says_no_more_after_a_jump_is_not_held(count):
    """Its last scans go on when the others have gone on for a second."""
    times = [(t, s, t) for t, s in arrivals(6.0) if s == "rgb" or t < 3.0]
    last = [(3.7 + 0.01 * k, "evt", 4.7 + 0.01 * k) for k in range(count)]
    steps = ClockSteps(LATE_S)
    taken, *_ = judge(steps, sorted(times + last))
    assert len(taken) == len(times) + count
    assert steps.clear() == []


def test_a_sensor_that_was_silent_before_the_other_began_comes_back_without_a_step():
    times = [
        (t, s, t) for t, s in arrivals(5.0) if (s == "evt") == (1.0 < t < 4.0) or (s == "rgb" and t > 4.0)
    ]
    taken, found, refuted, together = judge(ClockSteps(LATE_S), times)
    assert (found, refuted, together) == ([], [], [])
    assert all(one.t == true for true, one in taken)


def test_one_wrong_time_ahead_is_passed_over():
    times = [(t, s, t + 1.0 * (s == "evt" and 3.0 <= t < 3.012)) for t, s in arrivals(4.0, 0.0)]
    assert sum(t != true for true, _, t in times) in (1, 2)
    taken, found, refuted, _ = judge(ClockSteps(LATE_S), times)
    assert found == []
    assert len(refuted) + len(taken) == len(times)
    assert all(one.t == true for true, one in taken)


@pytest.mark.parametrize("back_s", [2.0, 60.0, 3600.0])
def test_all_clocks_set_back_at_once_are_said(back_s):
    times = [(t, s, t - back_s * (t > 3.0)) for t, s in arrivals(5.0)]
    _, found, _, [together] = judge(ClockSteps(LATE_S), times)
    assert found == []
    assert together == pytest.approx(back_s, abs=0.06)


def test_late_scans_of_any_order_are_no_step():
    """Delays of the network up to what may be late, each scan its own."""
    rng = np.random.default_rng(2)
    times = sorted(arrivals(20.0), key=lambda one: one[0] + rng.uniform(0, LATE_S))
    taken, found, refuted, together = judge(ClockSteps(LATE_S), [(t, s, t) for t, s in times])
    assert (found, refuted, together) == ([], [], [])
    assert all(one.t == true for true, one in taken)
    assert len(taken) == len(times)


@pytest.mark.parametrize("when", [2.0, 3.03])
def test_what_was_found_of_a_clock_by_other_means_is_no_step(when):
    """From some time on a lag is taken off, be it just when the clock has stepped, too."""
    steps, found, lag_s = ClockSteps(LATE_S), [], 0.0
    for (
        true,
        name,
    ) in arrivals(5.0):
        if true > when and not lag_s:
            lag_s = 1.5
            steps.corrected("evt", lag_s)
        t = true + (1.5 + 1.0 * (true > 3.0) - lag_s) * (name == "evt")
        found += steps.saw([scan(t - sum(s.step_s for s in found if s.sensor == name), name)]).steps
    [step] = found
    assert (step.sensor, step.step_s) == ("evt", pytest.approx(1.0, abs=1e-3))


def test_its_state_survives_at_any_scan():
    times = [(t, s, t + 1.0 * (s == "evt" and t > 1.0)) for t, s in arrivals(1.3)]
    whole = judge(ClockSteps(LATE_S), times)[1]
    steps, found = ClockSteps(LATE_S), []
    for _, name, t in times:
        again = ClockSteps(LATE_S)
        again.set_state(steps.state())
        steps = again
        found += steps.saw([scan(t - sum(s.step_s for s in found if s.sensor == name), name)]).steps
    assert found == whole


RIG = ["image.width=1920", "image.height=1080", "smoother.engine=none"]
RIG += ["sensors.rgb.rate_hz=10", "sensors.evt.rate_hz=25"]
RIG += ["sensors.evt.clock.offset_s=7.3"]


def driving(t, rng):
    """Boxes (N, 4) of vehicles that drive by, seen with a pixel of noise."""
    speed = 200.0 + 37.0 * (np.arange(6) % 5)
    x = (speed * t + 1150.0 * np.arange(6)) % 1900.0
    y = 100.0 + 150.0 * np.arange(6)
    boxes = np.column_stack([x, y, np.full(6, 90.0), np.full(6, 50.0)])
    boxes[:, :2] += rng.normal(0, 1, (6, 2))
    return boxes


def two_sensors(seconds, ahead):
    """Scans of a rig in order of arrival, `evt` ahead by what its offset and a function of time say."""
    rng, found = np.random.default_rng(4), []
    for name, rate in (("rgb", 10.0), ("evt", 25.0)):
        for k in range(round(seconds * rate)):
            t = k / rate + 0.004 * (name == "evt")
            boxes = driving(t, rng)
            late_s = 7.3 + ahead(t) if name == "evt" else 0.0
            found.append((t, Scan(round(t + late_s, 6), name, boxes, np.full(len(boxes), 0.9))))
    return [one for _, one in sorted(found, key=lambda pair: pair[0])]


def test_with_a_rig_a_clock_that_steps_is_admitted_again_and_named():
    live = LiveTracker(Tracker(load_config("default", RIG)))
    said = []
    for one in two_sensors(12.0, lambda t: 1.0 * (t > 6.0)):
        arrival = live.step(one)
        said += [] if arrival.clocks is None else arrival.clocks.lines
    [line] = said
    assert line.startswith("warning: sensor 'evt': its clock has leapt by +1.000 s while the others went on")
    assert live.lateness.dropped == 0
    assert live.clocks["evt"]["lag_s"] == pytest.approx(1.0, abs=1e-3)
    assert live.time == pytest.approx(12.0, abs=0.1)


def test_a_clock_that_drifts_is_followed(monkeypatch):
    """Since the rig was made, by more than any box shows alone: found when the clocks are compared again."""
    monkeypatch.setattr(clock_watch, "AGAIN_S", 10.0)
    watch = ClockWatch(load_config("default", RIG))
    for one in two_sensors(46.0, lambda t: 0.04 + 1e-4 * t):
        lag_s = 7.3 * (one.sensor == "evt") + watch.lag_s(one.sensor)
        watch.saw([replace(one, t=one.t - lag_s)])
    found = watch.clocks["evt"]
    assert found["lag_s"] == pytest.approx(0.04 + 1e-4 * found["at_s"], abs=0.004)
