"""All that the confirmed tracks of a recording took in, for whoever wants to smooth it in other ways."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import RecordArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.measured_track import MeasuredTrack
from jeat_graph.data.progress import with_progress
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.measured import ConfirmedMeasurements, measured_tracks
from jeat_graph.tracking.tracker import Tracker


def record_tracks(
    config: Config, detections: Detections, *, progress: bool = False
) -> tuple[list[MeasuredTrack], Trajectories]:
    """Track a recording and return the confirmed tracks with their measurements, and the causal table.

    Fragments of one vehicle stay apart here: each is compared for itself.

    Args:
        config: the configuration; its smoother is passed over.
        detections: the recording.
        progress: whether to show a progress bar on stderr.
    """
    rows, causal = record_measurements(config, detections, progress=progress)
    return measured_tracks(rows, config), causal


def record_measurements(
    config: Config, detections: Detections, *, progress: bool = False
) -> tuple[RecordArray, Trajectories]:
    """Track a recording and return what its confirmed tracks took in (M,), and the causal table.

    Args:
        config: the configuration; its smoother does not matter.
        detections: the recording.
        progress: whether to show a progress bar on stderr.
    """
    from tqdm import tqdm

    config = replace(config, smoother=replace(config.smoother, engine="none"))
    tracker = Tracker(config, diagnostics=True)
    measured = ConfirmedMeasurements(tracker)
    tables = [Trajectories.empty(config.sensor_names)]
    with tqdm(
        total=detections.num_scans, desc="track", unit="scan", disable=not progress, leave=False
    ) as bar:
        for batch in with_progress(detections.batches(), len(np.unique(detections.scan_t))):
            tables.append(tracker.step(batch))
            measured.add_step()
            bar.update(len(batch))
    return measured.release(), Trajectories.concatenate(tables)
