"""One tracker in several threads, in copies, in a forked process, and under signals."""

from __future__ import annotations

import copy
import os
import signal
import sys
import threading
import time

import numpy as np
import pytest

from jeat_graph import Tracker
from jeat_graph.core import tracking as core
from jeat_graph.data.errors import JeatGraphError, TimeOrderError
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.one_at_a_time import ThreadLock

SIZE = (1280, 720)
COLUMNS = ("t", "track_id", "boxes", "existence", "mean", "var", "used")


def boxes_at(t, count=30, seed=1):
    rng = np.random.default_rng(seed)
    place, speed = rng.uniform(0, 1000, (count, 2)) * [1.0, 0.6], rng.normal(0, 50, (count, 2))
    return np.concatenate([place + speed * t, np.full((count, 2), 50.0)], axis=1)


def assert_same(one, other):
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


@pytest.mark.parametrize("engine", ["core", "reference", "paper"])
def test_threads_that_share_a_tracker_wait_for_each_other(engine):
    count = 60 if engine == "core" else 8
    tracker = Tracker("paper" if engine == "paper" else "default", image=SIZE, engine=engine)
    taken, clock, lock = [], [0.0], threading.Lock()

    def camera(name):
        for _ in range(count):
            with lock:
                clock[0] += 0.05
                t = clock[0]
            try:
                tracker.update(boxes_at(t), t=t, sensor=name, scores=np.full(30, 0.9))
                taken.append((t, name))
            except TimeOrderError:
                pass
            tracker.causal()

    threads = [threading.Thread(target=camera, args=(name,)) for name in ("rgb", "evt")]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    sys.setswitchinterval(interval)
    # What one thread alone does with the same scans, in the order in which they were taken in.
    alone = Tracker("paper" if engine == "paper" else "default", image=SIZE, engine=engine)
    for t, name in sorted(taken):
        alone.update(boxes_at(t), t=t, sensor=name, scores=np.full(30, 0.9))
    assert len(taken) >= count
    assert_same(tracker.finish(), alone.finish())


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
@pytest.mark.parametrize("engine", ["core", "reference", "paper"])
def test_a_copy_goes_on_as_the_first_one_and_shares_nothing_with_it(engine, copied):
    tracker = Tracker("paper" if engine == "paper" else "default", image=SIZE, engine=engine)
    for k in range(6):
        tracker.step((0.05 * k, "rgb", boxes_at(0.05 * k, 3), [0.9] * 3, ["car", "bus", "car"]))
    other = copied(tracker)
    before = tracker.causal()
    other.step((0.5, "evt", boxes_at(0.5, 2), [0.9] * 2))
    assert tracker.time == 0.25
    assert_same(tracker.causal(), before)
    tracker.step((0.5, "evt", boxes_at(0.5, 2), [0.9] * 2))
    assert_same(other.causal(), tracker.causal())
    assert_same(other.finish(), tracker.finish())


def test_a_copy_of_a_live_tracker_goes_back_by_itself():
    live = LiveTracker(Tracker(image=SIZE))
    for k in range(6):
        live.step((0.05 * k, "rgb", boxes_at(0.05 * k, 3), [0.9] * 3))
    other = copy.copy(live)
    late = (0.12, "evt", boxes_at(0.12, 3), [0.9] * 3)
    assert_same(other.step(late).table, live.step(late).table)
    other.step((0.3, "rgb", boxes_at(0.3, 3), [0.9] * 3))
    assert (live.time, other.time) == (0.25, 0.3)


# Of the core alone: calls that take a second.


def scattered(model, t, seed):
    """Boxes all over the picture, so many that a step takes long."""
    rng = np.random.default_rng(seed)
    corner, count = rng.uniform(0, 1000, (2500, 2)), np.array([2500])
    boxes = np.concatenate([corner, corner + 100.0], axis=1)
    model.take(t, np.zeros(1, dtype=np.int64), count, boxes, np.full(2500, 2.0))


@pytest.fixture
def model():
    """A model in whose next step with `scattered` boxes hundreds of thousands of pairs are compared."""
    made = core.Model(ModelConstants(), 1280.0, 720.0, True, 1.0)
    made.declare_sensor()
    scattered(made, 0.0, 1)
    return made


def state_bytes(model):
    return {name: column.tobytes() for name, column in model.state().items()}


@pytest.fixture
def alarm():
    """Have a function called in this thread, as a signal's handler, after some seconds of its own."""
    before = signal.getsignal(signal.SIGVTALRM)

    def ring(handler, after_s):
        signal.signal(signal.SIGVTALRM, lambda *_: handler())
        signal.setitimer(signal.ITIMER_VIRTUAL, after_s)

    yield ring
    signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    signal.signal(signal.SIGVTALRM, before)


def test_a_signal_ends_a_long_step_which_has_not_been_then(model, alarm):
    before, rung = state_bytes(model), []

    def handler():
        rung.append(time.monotonic())
        with pytest.raises(RuntimeError, match="this very thread"):
            model.size()  # the step is in the middle
        raise KeyboardInterrupt

    begun = time.process_time()
    alarm(handler, 0.02)
    with pytest.raises(KeyboardInterrupt):
        scattered(model, 0.05, 2)
    assert len(rung) == 1
    assert time.process_time() - begun < 1.0
    assert state_bytes(model) == before
    scattered(model, 0.05, 2)
    assert model.time() == 0.05


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks of POSIX")
def test_a_process_that_is_forked_while_a_thread_steps_does_not_wait_for_it(model):
    inside = threading.Event()

    def step():
        inside.set()
        scattered(model, 0.05, 2)

    thread = threading.Thread(target=step)
    thread.start()
    inside.wait()
    time.sleep(0.05)
    child = os.fork()
    if child == 0:
        code = 1
        try:
            model.size()
        except RuntimeError as error:
            code = 0 if "forked" in str(error) else 2
        finally:
            os._exit(code)
    thread.join()
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert model.time() == 0.05


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks of POSIX")
def test_a_lock_that_a_thread_of_the_process_before_had_is_refused_and_a_free_one_is_taken():
    held, free, inside, leave = ThreadLock(), ThreadLock(), threading.Event(), threading.Event()

    def hold():
        with held:
            inside.set()
            leave.wait()

    thread = threading.Thread(target=hold)
    thread.start()
    inside.wait()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            with free, held:
                code = 3
        except JeatGraphError as error:
            code = 0 if "forked" in str(error) else 2
        finally:
            os._exit(code)
    leave.set()
    thread.join()
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    with held:
        pass


@pytest.mark.parametrize("t", [np.nan, np.inf, -np.inf, -1.0])
def test_a_step_at_no_time_or_before_the_last_one_is_refused(t):
    model = core.Model(ModelConstants(), 1280.0, 720.0, True, 1.0)
    model.declare_sensor()
    one = np.zeros(1, dtype=np.int64), np.ones(1, dtype=np.int64), np.array([[1.0, 2, 30, 40]]), np.ones(1)
    model.take(0.0, *one)
    before = state_bytes(model)
    with pytest.raises(ValueError, match="time"):
        model.take(t, *one)
    assert state_bytes(model) == before
    for later in (0.0, 1e-300, 299.9, 1e9, 1e17, 1e300, 1.7e308):
        model.take(later, *one)
    assert np.isfinite(model.finish()[2]).all()


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
@pytest.mark.parametrize("part", [2, 3])
def test_what_is_no_box_is_refused(part, wrong):
    model = core.Model(ModelConstants(), 1280.0, 720.0, True, 1.0)
    model.declare_sensor()
    scan = [np.zeros(1, dtype=np.int64), np.ones(1, dtype=np.int64), np.array([[1.0, 2, 30, 40]]), np.ones(1)]
    scan[part].reshape(-1)[0] = wrong
    with pytest.raises(ValueError, match="finite"):
        model.take(0.0, *scan)
