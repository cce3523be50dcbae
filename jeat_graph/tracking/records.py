"""What the filter did to the tracks of a recording, for whoever wants to smooth it in other ways."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, RecordArray
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.progress import with_progress
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.filters import singer
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.smoothers.filtered_track import FilteredTrack, Output, tracks_of
from jeat_graph.smoothers.state_rts import FilterRecord
from jeat_graph.tracking.measured import ConfirmedMeasurements
from jeat_graph.tracking.tracker import Tracker

_MOTION = [singer.POSITION, singer.VELOCITY, singer.ACCELERATION]


def record_tracks(
    config: Config, detections: Detections, *, progress: bool = False
) -> tuple[list[FilteredTrack], Trajectories]:
    """Track a recording and return the reported tracks as the filter went through them, and the causal table.

    Args:
        config: the configuration; its smoother is passed over.
        detections: the recording.
        progress: whether to show a progress bar on stderr.
    """
    smoother = replace(config.smoother, engine="full", identities="causal")
    tracker = Tracker(replace(config, smoother=smoother))
    tables = [Trajectories.empty(config.sensor_names)]
    records: list[FilterRecord] = []
    times: list[float] = []
    for batch in _batches(detections, progress):
        taken = tracker.take_in(batch)
        assert taken is not None, "there is a smoother"
        tables.append(tracker.causal())
        scans = tracker.step_record(taken).scans
        records += scans
        times += [taken.t] * len(scans)
    causal = Trajectories.concatenate(tables)
    # Sensors are numbered as in the configuration, in the order of their names.
    number = np.array(
        [*(tracker.sensor_names.index(name) for name in tracker.engine_sensors), -1], dtype=np.int64
    )
    reported = set(causal.track_id.tolist())
    whole = [one for one in tracks_of(records, times) if one.track_id in reported]
    output = None
    if tracker.config.tracker.engine != "paper":
        c = tracker.constants
        output = Output(partial(_reported, c=c), partial(_reported_covariance, c=c))
    return [replace(one, sensor=number[one.sensor], output=output) for one in whole], causal


def _reported(mean: FloatArray, c: ModelConstants) -> FloatArray:
    """Return place, velocity and acceleration (..., 2, 3) of states (..., 2, 7) as tables tell them."""
    return singer.reported_motion(mean, c)[..., _MOTION]


def _reported_covariance(mean: FloatArray, covariance: FloatArray, c: ModelConstants) -> FloatArray:
    return singer.reported_covariance(mean, covariance, c)[..., _MOTION, :][..., _MOTION]


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
