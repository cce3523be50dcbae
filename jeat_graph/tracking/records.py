"""What the filter did to the tracks of a recording, for whoever wants to smooth it in other ways."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.progress import with_progress
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.filters import singer
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.smoothers.filtered_track import FilteredTrack, Output, tracks_of
from jeat_graph.smoothers.state_rts import FilterRecord
from jeat_graph.tracking.measured import ConfirmedMeasurements
from jeat_graph.tracking.model_tracker import PendingStep
from jeat_graph.tracking.tracker import Tracker

_MOTION = [singer.POSITION, singer.VELOCITY, singer.ACCELERATION]


def record_tracks(
    config: Config, detections: Detections, *, progress: bool = False
) -> tuple[list[FilteredTrack], Trajectories]:
    """Track a recording and return the reported tracks as the filter went through them, and the causal table.

    Args:
        config: the configuration; its smoother is passed over. Its engine must be the core.
        detections: the recording.
        progress: whether to show a progress bar on stderr.

    Raises:
        ConfigError: another engine.
    """
    if config.tracker.engine != "core":
        raise ConfigError(f"tracker.engine={config.tracker.engine} keeps no records of its filter: core does")
    tracker = Tracker(replace(config, smoother=replace(config.smoother, engine="rts")))
    tables = [Trajectories.empty(config.sensor_names)]
    records: list[FilterRecord] = []
    times: list[float] = []
    sensors: list[IntArray] = []
    for batch in _batches(detections, progress):
        born = tracker.num_born
        taken = tracker.take_in(batch)
        assert taken is not None, "there is a smoother"
        tables.append(tracker.causal())
        for record, sensor in _records(taken, born):
            records.append(record)
            times.append(batch[0].t)
            sensors.append(sensor)
    causal = Trajectories.concatenate(tables)
    # Sensors are numbered as in the configuration, in the order of their names.
    number = np.array([config.sensor_names.index(name) for name in tracker.sensor_names] + [-1])
    found = tracks_of(records, times, [number[sensor] for sensor in sensors])
    reported = set(causal.track_id.tolist())
    whole = [one for one in found if one.track_id in reported]
    F = [_transitions(one, tracker.constants) for one in whole]
    output = Output(partial(_told, c=tracker.constants), partial(_told_covariance, c=tracker.constants))
    return [replace(one, F=steps, output=output) for one, steps in zip(whole, F, strict=True)], causal


def _told(mean: FloatArray, c: ModelConstants) -> FloatArray:
    """Return place, velocity and acceleration (..., 2, 3) of states (..., 2, 7) as tables tell them."""
    return singer.told_motion(mean, c)[..., _MOTION]


def _told_covariance(mean: FloatArray, covariance: FloatArray, c: ModelConstants) -> FloatArray:
    return singer.told_covariance(mean, covariance, c)[..., _MOTION, :][..., _MOTION]


def record_measurements(
    config: Config, detections: Detections, *, progress: bool = False
) -> tuple[RecordArray, Trajectories]:
    """Track a recording and return what its believed tracks took in (M,), and the causal table.

    Args:
        config: the configuration; its smoother does not matter.
        detections: the recording.
        progress: whether to show a progress bar on stderr.
    """
    tracker = Tracker(replace(config, smoother=replace(config.smoother, engine="none")), diagnostics=True)
    measured = ConfirmedMeasurements(tracker)
    tables = [Trajectories.empty(config.sensor_names)]
    for batch in _batches(detections, progress):
        tables.append(tracker.step(batch))
        measured.add_step()
    return measured.release(), Trajectories.concatenate(tables)


def _batches(detections: Detections, progress: bool) -> Iterator[list[Scan]]:
    """Yield the scans of each time, with a progress bar."""
    from tqdm import tqdm

    hidden = not progress
    with tqdm(total=detections.num_scans, desc="track", unit="scan", disable=hidden, leave=False) as bar:
        for batch in with_progress(detections.batches(), len(np.unique(detections.scan_t))):
            yield batch
            bar.update(len(batch))


def _records(taken: PendingStep, born: int) -> Iterator[tuple[FilterRecord, IntArray]]:
    """Yield the records of a step's scans, each with the index (N,) of the sensor whose box each track took.

    Their transitions are still to be filled in. `born` tracks had been born before the step.
    """
    codes, counts, *states = taken.record.scans()
    starts = np.concatenate([[0], np.cumsum(counts)])
    known = int((taken.ids <= born).sum())
    for code, first, last in zip(codes, starts[:-1], starts[1:], strict=True):
        before, before_cov, after, after_cov = (column[first:last] for column in states)
        shape = (len(before), 2, singer.STATES)
        square = (*shape, singer.STATES)
        took = (before != after).any(axis=1) | (before_cov != after_cov).any(axis=1)
        # What begins with a box has no prediction.
        took |= np.arange(len(took)) >= known
        known = len(took)
        states_then = before.reshape(shape), before_cov.reshape(square)
        states_now = after.reshape(shape), after_cov.reshape(square)
        F = np.broadcast_to(np.eye(singer.STATES), (len(before), 1, singer.STATES, singer.STATES))
        yield FilterRecord(taken.ids[: len(before)], F, *states_then, *states_now), np.where(took, code, -1)


def _transitions(track: FilteredTrack, c: ModelConstants) -> FloatArray:
    """Return the transitions (K, 2, 5, 5) of a track from the record before, as the filter took them."""
    F = np.broadcast_to(np.eye(singer.STATES), (len(track), 2, singer.STATES, singer.STATES)).copy()
    steps = np.diff(track.t)
    for dt in np.unique(steps):
        rows = np.flatnonzero(steps == dt)
        F[rows + 1] = singer.in_perspective(singer.discretise(float(dt), c).F, track.mean[rows], float(dt), c)
    return F
