"""Smoothing in a process of its own gives the same bytes, bounded, and its failures are told."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from jeat_graph import load_config
from jeat_graph.errors import JeatGraphError
from jeat_graph.smoothing.behind import SmoothingHere
from jeat_graph.smoothing.recorder import StepRecorder
from jeat_graph.smoothing.worker import SmoothingWorker
from jeat_graph.trajectories import Trajectories

from .conftest import make_tracker, recording, run

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


def test_smoothed_in_between_is_that_of_smoothing_here():
    here, there = make_tracker(), make_tracker("smoother.worker=true")
    steps = zip(here.run(DETECTIONS), there.run(DETECTIONS), strict=True)
    for k, _ in enumerate(steps):
        if k == 200:
            assert same_bytes(there.smoothed(), here.smoothed())
    assert same_bytes(there.finish(), here.finish())


def test_with_a_queue_of_one_the_tracker_waits_and_nothing_is_lost():
    here, there = make_tracker("smoother.chunk=1"), make_tracker("smoother.chunk=1")
    there._smoothers = SmoothingWorker(there.config, most_waiting=1)
    with pytest.warns(UserWarning, match="falls behind"):
        run(there, DETECTIONS)
    run(here, DETECTIONS)
    assert same_bytes(there.finish(), here.finish())


def test_a_worker_that_dies_is_reported():
    tracker = make_tracker("smoother.worker=true")
    steps = tracker.run(DETECTIONS)
    next(steps)
    tracker._smoothers._process.kill()
    tracker._smoothers._process.join()
    with pytest.raises(JeatGraphError, match="has died"):
        tracker.finish()


def test_an_error_in_the_worker_reaches_the_caller():
    worker = SmoothingWorker(load_config("default"))
    worker._send("consume", "no packet")
    worker._answers.poll(30.0)
    with pytest.raises(AttributeError):
        worker.drain()


def test_the_histories_are_not_here():
    tracker = make_tracker("smoother.worker=true")
    with pytest.raises(JeatGraphError, match=r"smoother\.worker"):
        tracker.confirmed_histories()
    tracker.finish()


def test_the_work_of_a_packet_is_spread_over_the_steps_that_follow():
    """No step feeds more than its share of the tracks."""
    cars = [(0.0, 9.0, {"start": (100.0 + 90.0 * k, 100.0 + 40.0 * k)}) for k in range(8)]
    tracker = make_tracker("smoother.chunk=48")
    behind = tracker._smoothers
    assert isinstance(behind, SmoothingHere)
    fed = []
    for _ in tracker.run(recording(duration=2.0, cars=cars)):
        fed.append(behind._smoothers.waiting)
    after = np.array(fed)
    peaks = np.flatnonzero(np.diff(after) > 0) + 1
    assert len(peaks) >= 3
    for peak in peaks[:-1]:
        assert np.all(np.diff(after[peak : peak + 24]) >= -1)
        assert after[peak + 24] == 0


def test_packets_depend_on_the_steps_alone():
    recorder = StepRecorder(load_config("default", ["smoother.chunk=5"]))
    tracker = make_tracker("smoother.engine=none")
    sizes = []
    for table in tracker.run(recording(duration=0.5)):
        state = (tracker._tracks, tracker.num_tracks, 0, tracker._log, table.track_id)
        if recorder.record(tracker.time, *state):
            packet = recorder.take()
            sizes.append(len(packet.t))
            assert packet.counts.sum() == len(packet.ids)
    assert sizes == [5] * len(sizes)
    assert len(sizes) == 10
    assert recorder.take() is None
