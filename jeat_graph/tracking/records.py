"""All that the confirmed tracks of a recording took in, for whoever wants to smooth it in other ways."""

from __future__ import annotations

from dataclasses import replace

from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections
from jeat_graph.data.measured_track import MeasuredTrack
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.smoothing.priors import ErrorStates, track_data
from jeat_graph.tracking.tracker import Tracker


def record_tracks(
    config: Config, detections: Detections, *, progress: bool = False
) -> tuple[list[MeasuredTrack], Trajectories]:
    """Track a recording and return the confirmed tracks with their measurements, and the smoothed table.

    Fragments of one vehicle stay apart here: each is compared for itself.

    Args:
        config: the configuration; its smoother is passed over.
        detections: the recording.
        progress: whether to show a progress bar on stderr.
    """
    from tqdm import tqdm

    # No joints are wanted, but the histories have to be kept.
    smoother = replace(
        config.smoother, engine="rts", stitch=True, stitch_max_gap_s=0.0, output_rate_hz=0.0, robust="none"
    )
    tracker = Tracker(replace(config, smoother=smoother))
    with tqdm(
        total=detections.num_scans, desc="track", unit="scan", disable=not progress, leave=False
    ) as bar:
        for batch in detections.batches():
            tracker.step(batch)
            bar.update(len(batch))
    errors = ErrorStates.of(config)
    records = []
    for history in tracker.confirmed_histories():
        rows = history.whole()
        sensor = rows["sensor"].copy()
        records.append(MeasuredTrack(history.track_id, track_data(rows, errors), sensor[1:], int(sensor[0])))
    return records, tracker.finish()
