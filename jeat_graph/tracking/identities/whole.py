"""The smoothed table of a recording whose identities are decided with all of it in view."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.identity_links import IdentityLinks
from jeat_graph.data.progress import pieces_in_span, progress_span
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.filters import box_sides, box_spread, sensor_offsets
from jeat_graph.smoothers.joining import LearntScene, MeasuredBoxes
from jeat_graph.tracking.engine import lacking
from jeat_graph.tracking.identities.deciding import IdentityDecision, Recording, decide
from jeat_graph.tracking.identities.log import IdentityLog
from jeat_graph.tracking.identities.passes import one_pass
from jeat_graph.tracking.identities.retracking import retrack
from jeat_graph.tracking.one_model import OneModel

if TYPE_CHECKING:
    from jeat_graph.tracking.model_tracker import ModelTracker

# When the pass backward, and the decision, are done: shares of the time that all takes, for progress.
_BACKWARD, _DECIDED = 0.25, 0.5


def decided(tracker: ModelTracker, log: IdentityLog) -> tuple[IdentityLinks, Iterator[Trajectories]]:
    """Decide who is who in what a tracker was given, and smooth along that.

    Args:
        tracker: that made the causal pass.
        log: what it was given.

    Returns:
        What was joined, and the smoothed rows as they become final.
    """
    detections, causal = log.recording()
    with progress_span(0.0, _BACKWARD):
        backward = one_pass(detections, tracker, tracker.constants, backward=True)
    recording = _recording(tracker, detections, log.camera())
    decision = decide(recording, [causal, backward], backward, tracker.constants)
    rows = retrack(detections, decision, backward.real, tracker)
    return _links(decision, recording.measured.t), pieces_in_span(_DECIDED, 1.0, rows)


def _links(decision: IdentityDecision, t: FloatArray) -> IdentityLinks:
    order = np.lexsort((decision.tail, t[decision.tail]))
    tail, head = decision.tail[order], decision.head[order]
    return IdentityLinks(
        decision.owner[tail],
        decision.causal[tail],
        decision.causal[head],
        t[tail],
        t[head],
        decision.log_ratio[order],
        decision.joined[order],
        decision.terms[order],
    )


def _recording(tracker: ModelTracker, detections: Detections, camera: FloatArray) -> Recording:
    """Return what is known of detections at the end of the causal pass, in the model's own numbers.

    Args:
        tracker: of that pass.
        detections: all scans.
        camera: (T, 2) how far the camera had moved at each of their times (px).
    """
    count = np.diff(detections.scan_start)
    numbers = np.array([tracker.engine_sensors.index(name) for name in detections.sensors], dtype=np.int64)
    sensor = numbers[detections.box_sensor]
    boxes = np.concatenate(
        [detections.boxes[:, :2], detections.boxes[:, :2] + detections.boxes[:, 2:]], axis=1
    )
    t = np.repeat(detections.scan_t, count)
    times, at = np.unique(detections.scan_t, return_inverse=True)
    of_row = camera[np.repeat(at, count)]
    measured, scene = measured_boxes(tracker, t, sensor, boxes, of_row, detections.box_std)
    return Recording(measured, times, scene, detections.embeddings)


def measured_boxes(
    tracker: ModelTracker,
    t: FloatArray,
    sensor: IntArray,
    boxes: FloatArray,
    camera: FloatArray,
    box_std: FloatArray | None,
) -> tuple[MeasuredBoxes, LearntScene]:
    """Return detections as the model sees them, by what it has learnt so far, and that.

    Args:
        tracker: of the model.
        t: (N,) times (s).
        sensor: (N,) as the tracker counts them.
        boxes: (N, 4) left, top, right, bottom in the common picture (px).
        camera: (N, 2) how far the camera's motion had taken what is at rest (px).
        box_std: (N, 4) standard deviations of these by the detector (px), NaN where unknown; or None.
    """
    model, c = tracker._model, tracker.constants
    if not isinstance(model, OneModel):
        raise lacking(model.name, "does not say what it has learnt of the scene")
    learnt, picture = model.learnt(), model.picture()
    assert picture is not None, "the model has one"
    ends = learnt.boxes_at_edge >= learnt.boxes_beyond
    known = tracker.config.input.picture == "given"
    edges = box_sides.at_edge(boxes, picture, c) & (ends & known)[sensor][:, None, None]
    spread = None
    if box_std is not None:
        size = boxes[:, 2:] - boxes[:, :2]
        own = box_spread.squares(box_std, size, c) * (box_spread.scale(size) ** 2)[..., None]
        spread = learnt.spread_gain[sensor][:, None, None] * own
    boxes = boxes.copy()
    for k in range(len(tracker.engine_sensors)):
        own = sensor == k
        boxes[own] = sensor_offsets.corrected(boxes[own], learnt.offsets[k])
    scene = LearntScene(
        learnt.process_noise,
        learnt.log_side_variance,
        learnt.log_scene_variance,
        picture,
        learnt.log_own_variance,
    )
    return MeasuredBoxes(t, sensor, boxes, edges, camera, spread), scene
