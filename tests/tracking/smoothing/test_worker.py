"""Smoothing in a process of its own gives the same bytes, bounded, and its failures are told."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from jeat_graph import load_config
from jeat_graph.data.errors import JeatGraphError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.smoothing.behind import InProcessSmoothing
from jeat_graph.tracking.smoothing.recorder import StepRecorder
from jeat_graph.tracking.smoothing.shares import HANDING, SOLVING
from jeat_graph.tracking.smoothing.worker import SmoothingWorker, _portable
from jeat_graph.tracking.step_record import record_step

from .conftest import make_tracker, recording, run

# The programs below start their workers as a user's do, the commands' tests too.
pytestmark = pytest.mark.usefixtures("forked_workers")

CARS = ((0.0, 1.6, {}), (0.5, 9.0, {"start": (900.0, 500.0), "velocity": (-100.0, 0.0)}))
DETECTIONS = recording(duration=3.0, cars=CARS, blind=((1.9, 2.2),))


def same_bytes(a, b):
    return all(
        np.asarray(getattr(a, f.name)).tobytes() == np.asarray(getattr(b, f.name)).tobytes()
        for f in fields(Trajectories)
        if f.name != "sensors"
    )


@pytest.mark.parametrize("engine", ["fixed-lag", "full"])
def test_the_worker_gives_the_bytes_of_smoothing_here(engine):
    here, there = (
        make_tracker(f"smoother.engine={engine}"),
        make_tracker(f"smoother.engine={engine}", "smoother.worker=true"),
    )
    run(here, DETECTIONS)
    parts = [there.drain_smoothed() for _ in there.run(DETECTIONS)]
    whole = Trajectories.concatenate([*parts, there.finish()])
    assert len(whole) > 300
    assert same_bytes(whole, here.finish())
    assert there.smoother_counts == here.smoother_counts
    assert there.smoother_counts["tracks"] == 2
    # After the end there is nothing more, and no error.
    for call in (there.finish, there.smoothed, there.drain_smoothed):
        assert len(call()) == 0
    assert there.smoother_counts["tracks"] == 2


def test_smoothed_in_between_is_that_of_smoothing_here():
    here, there = make_tracker(), make_tracker("smoother.worker=true")
    steps = zip(here.run(DETECTIONS), there.run(DETECTIONS), strict=True)
    for k, _ in enumerate(steps):
        if k == 200:
            assert same_bytes(there.smoothed(), here.smoothed())
    assert same_bytes(there.finish(), here.finish())


def test_with_a_queue_of_one_the_tracker_waits_and_nothing_is_lost(monkeypatch):
    """The worker stands still until the warning comes, or for 20 s, after which the test fails."""
    here, there = make_tracker("smoother.chunk=1"), make_tracker("smoother.chunk=1")
    there._smoothers = SmoothingWorker(there.config, most_waiting=1)
    pid, warn = there._smoothers._process.pid, warnings.warn
    os.kill(pid, signal.SIGSTOP)
    at_last = threading.Timer(20.0, os.kill, (pid, signal.SIGCONT))
    at_last.start()

    def warn_and_go_on(*arguments, **options):
        os.kill(pid, signal.SIGCONT)
        warn(*arguments, **options)

    monkeypatch.setattr(warnings, "warn", warn_and_go_on)
    with pytest.warns(UserWarning, match="falls behind"):
        run(there, DETECTIONS)
    monkeypatch.undo()
    at_last.cancel()
    run(here, DETECTIONS)
    assert same_bytes(there.finish(), here.finish())


@pytest.mark.parametrize("engine", ["fixed-lag", "rts"])
def test_a_worker_that_dies_is_replaced_and_nothing_is_lost(engine, monkeypatch):
    """Killed in the first packet, and when states have been sent: all rows are there, each once."""
    options = ("smoother.chunk=2", "smoother.lag_s=0.2", f"smoother.engine={engine}")
    tracker, here = make_tracker("smoother.worker=true", *options), make_tracker(*options)
    rows = []
    for k, _ in enumerate(tracker.run(DETECTIONS)):
        if k in (1, 220):
            # That a state has come by then is part of what is tested.
            while k == 220 and engine == "fixed-lag" and tracker._smoothers._journal.state is None:
                tracker._smoothers._answers.poll(30.0)
                tracker._smoothers._receive()
            tracker._smoothers._process.kill()
            tracker._smoothers._process.join()
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "the smoothing worker has died")
            rows.append(tracker.drain_smoothed())
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "the smoothing worker has died")
        rows.append(tracker.finish())
    run(here, DETECTIONS)
    expected, found = here.finish(), Trajectories.concatenate(rows)
    np.testing.assert_array_equal(found.t, expected.t)
    np.testing.assert_array_equal(found.track_id, expected.track_id)
    np.testing.assert_allclose(found.mean, expected.mean, rtol=0, atol=1e-6)


def test_work_that_kills_every_worker_ends_with_an_error():
    worker = SmoothingWorker(load_config("default"))
    for _ in range(3):
        worker._process.kill()
        worker._process.join()
        with pytest.warns(UserWarning, match="another one goes on in its place"):
            worker._receive()
    worker._process.kill()
    worker._process.join()
    with pytest.raises(JeatGraphError, match="4 times at one place"):
        worker._receive()


@pytest.mark.parametrize("call", ["smoothed", "finish"])
def test_an_error_in_the_worker_reaches_whoever_waits_for_it_and_all_who_ask_later(call):
    worker = SmoothingWorker(load_config("highway"))
    worker._send("consume", "no packet")
    with pytest.raises(AttributeError) as error:
        getattr(worker, call)()
    assert "_serve" in error.value.__notes__[0]
    for name in ("drain", "smoothed", "finish", "counts"):
        with pytest.raises(JeatGraphError, match="failed"):
            getattr(worker, name)()


def test_an_error_in_the_worker_ends_the_run_of_a_tracker_that_never_asks():
    tracker = make_tracker("smoother.worker=true", "smoother.chunk=1")
    tracker._smoothers._send("consume", "no packet")
    tracker._smoothers._answers.poll(30.0)
    with pytest.raises(AttributeError):
        run(tracker, DETECTIONS)


def test_an_error_that_cannot_be_sent_is_told_in_words():
    class LocalError(Exception):
        pass

    error = _portable(LocalError("no way"))
    assert isinstance(error, JeatGraphError)
    assert "LocalError" in str(error)
    assert "no way" in str(error)
    assert isinstance(_portable(ValueError("as it is")), ValueError)


def test_a_tracker_that_never_saw_a_scan_has_no_rows():
    tracker = make_tracker("smoother.worker=true")
    for table in (tracker.smoothed(), tracker.drain_smoothed(), tracker.finish()):
        assert len(table) == 0
        assert table.sensors == tracker.sensor_names
    assert tracker.smoother_counts == dict.fromkeys(tracker.smoother_counts, 0)


def test_two_trackers_with_workers_do_not_meddle():
    one, two = make_tracker("smoother.worker=true"), make_tracker("smoother.worker=true")
    other = recording(duration=1.0, seed=5)
    run(one, DETECTIONS)
    run(two, other)
    tables = one.finish(), two.finish()
    for table, detections in zip(tables, (DETECTIONS, other), strict=True):
        alone = make_tracker()
        run(alone, detections)
        assert same_bytes(table, alone.finish())


def test_an_answer_that_nobody_waited_for_is_not_taken_for_the_next():
    """An interrupt may end the waiting, not the worker."""
    tracker, here = make_tracker("smoother.worker=true"), make_tracker()
    steps = zip(tracker.run(DETECTIONS), here.run(DETECTIONS), strict=True)
    for _ in range(100):
        next(steps)
    worker = tracker._smoothers
    worker._asked += 1
    worker._send("consume", worker._recorder.drain())
    worker._send("smoothed", worker._asked)
    here.smoothed()
    for _ in range(100):
        next(steps)
    assert same_bytes(tracker.smoothed(), here.smoothed())


def ends(pid: int, within_s: float = 100.0) -> bool:
    """Whether a process ends within some time, be it that nobody has asked yet how."""
    for _ in range(int(within_s / 0.05)):
        try:
            os.kill(pid, 0)
            if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except ProcessLookupError:
            return True
        except FileNotFoundError:
            if Path("/proc/self/stat").exists():
                return True
        time.sleep(0.05)
    return False


def test_a_tracker_that_is_dropped_takes_its_worker_along():
    tracker = make_tracker("smoother.worker=true")
    tracker.smoothed()
    pid = tracker._smoothers._process.pid
    del tracker
    gc.collect()
    assert ends(pid)


SCRIPT = """
import os, signal, sys
sys.path.insert(0, {folder!r})
from conftest import make_tracker, recording, run

if __name__ == "__main__":
    cars = tuple((0.0, 9.0, {{"start": (100.0 + 90.0 * k, 100.0 + 40.0 * k)}}) for k in range(6))
    tracker = make_tracker("smoother.worker=true")
    print(tracker._smoothers._process.pid, flush=True)
    if {started}:
        tracker.smoothed()
    run(tracker, recording(duration=2.0, cars=cars))
    if {killed}:
        os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.slow
@pytest.mark.parametrize(("started", "killed"), [(True, False), (False, False), (True, True)])
def test_a_program_that_ends_without_finish_ends_and_so_does_its_worker(tmp_path, started, killed):
    """Though all waits to be sent, as the worker has not begun yet; and though nobody can tell it."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(folder=os.path.dirname(__file__), started=started, killed=killed))
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=300, check=False)
    assert (done.returncode == 0) != killed, done.stderr
    assert "Traceback" not in done.stderr
    assert ends(int(done.stdout))


#: What one track costs at most: a solve, two chunks of measurements, and the handing over of a share.
ONE_TRACK = SOLVING + 2 * 48 + HANDING


def test_the_work_of_a_packet_is_spread_over_the_steps_that_follow():
    """Steps do no more than their shares, and one track's solve at most beyond that in all."""
    cars = [(0.0, 9.0, {"start": (100.0 + 90.0 * k, 100.0 + 40.0 * k)}) for k in range(8)]
    tracker = make_tracker("smoother.chunk=48")
    behind = tracker._smoothers
    assert isinstance(behind, InProcessSmoothing)
    backlog, shares = [], []
    for _ in tracker.run(recording(duration=2.0, cars=cars)):
        backlog.append(behind._smoothers.backlog)
        shares.append(behind._share)
    after = np.array(backlog)
    peaks = np.flatnonzero(np.diff(after) > 0) + 1
    assert len(peaks) >= 3
    for peak in peaks[:-1]:
        # All that comes in with a packet is a solve for each of the eight, at most.
        assert shares[peak] * 48 <= 8 * ONE_TRACK
        done = after[peak] - after[peak : peak + 47]
        assert np.all(done <= np.arange(47) * shares[peak] + ONE_TRACK)
        assert done[-1] > 0
    # What waits is bounded: two packets of all tracks and what is on its way to the next.
    assert after.max() <= 3 * len(cars) * ONE_TRACK


def test_packets_depend_on_the_steps_alone():
    recorder = StepRecorder(load_config("highway", ["smoother.chunk=5"]))
    tracker = make_tracker("smoother.engine=none")
    sizes = []
    for table in tracker.run(recording(duration=0.5)):
        state = (tracker._tracks, tracker.num_tracks, 0, tracker._log, table.track_id)
        if recorder.record(record_step(tracker.time, *state)):
            packet = recorder.drain()
            sizes.append(len(packet.t))
            assert packet.counts.sum() == len(packet.ids)
    assert sizes == [5] * len(sizes)
    assert len(sizes) == 10
    assert recorder.drain() is None


def test_a_track_that_ends_does_not_hurry_the_work_on_the_others():
    """It hands over its packet early; what waits of the others goes on little by little."""
    cars = [(0.0, 9.0, {"start": (100.0 + 90.0 * k, 100.0 + 40.0 * k)}) for k in range(8)]
    cars.append((0.0, 1.0, {"start": (1000.0, 80.0)}))
    tracker = make_tracker("smoother.chunk=48", "lifecycle.max_gap_confirmed_s=0.2")
    waiting, ended = [0], []
    for _ in tracker.run(recording(duration=2.0, cars=cars)):
        waiting.append(tracker._smoothers._smoothers.backlog)
        ended.append(tracker.smoother_counts["tracks"])
    steps = np.diff(waiting)
    # One track or two are solved for in a step, though ten wait for it.
    assert ended[-1] == 1
    assert steps.min() >= -2 * ONE_TRACK
    assert max(waiting) > 8 * 48
