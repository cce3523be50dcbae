"""The smoothed table of a recording along identities that a person has corrected."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.corrected_tracks import CorrectedTracks, Disagreements
from jeat_graph.data.detections import Detections
from jeat_graph.data.progress import pieces_in_span, progress_span
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.engine import lacking
from jeat_graph.tracking.identities.deciding import IdentityDecision
from jeat_graph.tracking.identities.disagreeing import Noise, compare, edited
from jeat_graph.tracking.identities.log import IdentityLog
from jeat_graph.tracking.identities.matching_rows import LEAST_IOU, owners_of
from jeat_graph.tracking.identities.retracking import retrack
from jeat_graph.tracking.one_model import OneModel

if TYPE_CHECKING:
    from jeat_graph.tracking.model_tracker import ModelTracker


def along_corrected(
    tracker: ModelTracker, log: IdentityLog, rows: CorrectedTracks
) -> tuple[Disagreements, Iterator[Trajectories]]:
    """Smooth what a tracker was given along corrected tracks: these, and no others.

    The model first goes along the detections that the rows lie on. Rows that it disagrees with, and that no
    detection is behind, become detections themselves, and it goes along all once more.

    Args:
        tracker: that made the causal pass.
        log: what it was given.
        rows: the tracks.

    Returns:
        Where the model disagreed before it took these rows for detections; the smoothed rows.

    Raises:
        DataError: no row lies on a detection.
    """
    detections, causal = log.recording()
    names, code, owner = match(detections, rows)
    with progress_span(0.0, 0.5):
        first = Trajectories.concatenate(list(_along(detections, owner, causal.assigned, _at_scans(tracker))))
    found = compare(rows, code, first, detections, owner, _noise(tracker))
    assigned = causal.assigned
    if len(found.moved) or len(found.added):
        detections, owner, origin = edited(detections, owner, rows, code, found)
        assigned = np.where(origin >= 0, np.append(assigned, 0)[origin], 0)
    smoothed = pieces_in_span(0.5, 1.0, _along(detections, owner, assigned, tracker))
    return found.disagreements, (replace(one, track_id=names[one.track_id - 1]) for one in smoothed)


def match(detections: Detections, rows: CorrectedTracks) -> tuple[IntArray, IntArray, IntArray]:
    """Find the detections of corrected tracks.

    Args:
        detections: all scans, with boxes in the common picture.
        rows: (R,) of K tracks.

    Returns:
        Identities (K,) of the tracks, ascending; number of each row's track (R,) among them, from 1; that of
        each detection's (N,), 0 for nobody's.

    Raises:
        DataError: no row lies on a detection.
    """
    names, code = np.unique(rows.track_id, return_inverse=True)
    code = code.reshape(-1).astype(np.int64) + 1
    owner = owners_of(detections, rows, code)
    if not owner.any():
        raise rows.error(
            0,
            f"no row of the file lies on a detection (at its time, with an IoU of {LEAST_IOU} or more); "
            "is it of this recording?",
        )
    return names, code, owner


def _along(
    detections: Detections, owner: IntArray, causal: IntArray, like: ModelTracker
) -> Iterator[Trajectories]:
    decision = IdentityDecision.without_links(owner, causal)
    # A person says that there is an object; of what is nobody's nothing later is known.
    return retrack(detections, decision, np.where(owner > 0, 1.0, -1.0), like, from_scratch=True)


def _at_scans(tracker: ModelTracker) -> ModelTracker:
    """Return a tracker like another one, whose smoothed rows are at the scans and not clipped."""
    smoother = replace(tracker.config.smoother, output_rate_hz=0.0)
    output = replace(tracker.config.output, clip=False, min_existence=0.0)
    made = tracker.fresh_copy()
    made.config = replace(tracker.config, smoother=smoother, output=output)
    return made


def _noise(tracker: ModelTracker) -> Noise:
    """Return how exact boxes are, as the model has learnt."""
    model, c = tracker._model, tracker.constants
    if not isinstance(model, OneModel):
        raise lacking(model.name, "does not say what it has learnt of the scene")
    learnt, picture = model.learnt(), model.picture()
    ends = tracker.config.input.picture == "given" and bool(
        (learnt.boxes_at_edge >= learnt.boxes_beyond).any()
    )
    least = math.exp(float(np.min(learnt.log_side_variance)))
    return Noise(least, c.pixel_std, picture if ends else None)
