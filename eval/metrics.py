"""All tracking scores of tracks against truth, pooled over sequences, from every metric that there is.

A metric is a module of `eval.scores` with a record `METRIC`; this is the only place that looks for them. The
values of those that come along are those of TrackEval, which the MOTChallenge and KITTI servers use; what is
ignored before they count is the business of `eval.protocols`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import progress_span, with_progress
from jeat_graph.data.records import records_in
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.frames import Frames, Kind, build_frames
from jeat_graph.eval.overlapping import OverlappingPairs, overlapping_pairs
from jeat_graph.eval.resampling import MAX_AGE_S
from jeat_graph.eval.scores.record import Metric

_PACKAGE = "jeat_graph.eval.scores"


@cache
def metrics() -> tuple[Metric[Any], ...]:
    """Return the records of all metrics, by name."""
    found: list[Metric[Any]] = records_in(_PACKAGE, "METRIC")
    return tuple(sorted(found, key=lambda one: one.name))


def share_names() -> tuple[str, ...]:
    """Return the names of the scores in per cent, in the order of tables."""
    return tuple(name for one in metrics() for name in one.shares)


def number_names(*, shown: bool = False) -> tuple[str, ...]:
    """Return the names of the other scores; with `shown` those alone that tables have."""
    return tuple(name for one in metrics() for name in one.numbers if not (shown and name in one.hidden))


@dataclass(frozen=True)
class Scores:
    """Tracking scores, pooled over all sequences that were judged: attributes by name, such as `MOTA`.

    Attributes:
        values: every score by name: shares in per cent, then numbers (`Metric.shares`, `Metric.numbers`).
        truth_boxes: boxes to be found.
        truth_ids: objects.
        track_boxes: boxes reported.
        track_ids: tracks reported.
        frames: frames judged.
        sequences: sequences judged.
    """

    values: dict[str, float | int]
    truth_boxes: int
    truth_ids: int
    track_boxes: int
    track_ids: int
    frames: int
    sequences: int

    def __getattr__(self, name: str) -> float | int:
        """Return a score by its name."""
        try:
            values: dict[str, float | int] = self.__dict__["values"]
            return values[name]
        except KeyError:
            raise AttributeError(f"there is no score {name}") from None

    def as_dict(self) -> dict[str, float | int]:
        """Return the scores by name, shares first, then numbers, then what was judged."""
        judged = ("truth_boxes", "truth_ids", "track_boxes", "track_ids", "frames", "sequences")
        return self.values | {name: getattr(self, name) for name in judged}


def evaluate(
    pairs: Sequence[tuple[GroundTruth, Trajectories]],
    *,
    kind: Kind = "causal",
    iou: float = 0.5,
    max_age_s: float = MAX_AGE_S,
    max_gap_s: float | None = None,
    instants: Sequence[FloatArray | None] | None = None,
) -> Scores:
    """Judge tracks against truth at the truth's times, pooled over sequences.

    Args:
        pairs: truth and tracks of each sequence; identities of different sequences are different.
        kind: `causal` tables are predicted forward from the last instant before a frame, `smoothed` ones
            interpolated.
        iou: smallest IoU of a match (CLEAR and identity; HOTA has thresholds of its own).
        max_age_s: for `causal`, how far to predict (s).
        max_gap_s: for `smoothed`, how far apart joined rows may be (s); no bound by default.
        instants: for `causal`, for each sequence the times at which the tracker gave output (say, the scan
            times); then an instant without rows means no tracks. None where not known.

    Raises:
        DataError: no pair, or truth and tracks that do not fit together.
    """
    known = [None] * len(pairs) if instants is None else list(instants)
    return score_frames(
        [
            build_frames(truth, table, kind=kind, max_age_s=max_age_s, max_gap_s=max_gap_s, instants=at)
            for (truth, table), at in zip(pairs, known, strict=True)
        ],
        iou=iou,
    )


def score_frames(sequences: Sequence[Frames], *, iou: float = 0.5) -> Scores:
    """Score sequences that are laid out frame by frame already.

    Args:
        sequences: one entry a sequence.
        iou: smallest IoU of a match in CLEAR and identity metrics, in (0, 1].

    Raises:
        DataError: no sequence, or a threshold out of range.
    """
    if not sequences:
        raise DataError("there is no sequence to judge")
    if not 0.0 < iou <= 1.0:
        raise DataError(f"the IoU threshold must be in (0, 1], not {iou:g}")
    with progress_span(0.0, 0.4):
        pairs = [overlapping_pairs(frames) for frames in with_progress(sequences)]
    with progress_span(0.4, 1.0):
        return scores_of_pairs(pairs, iou)


def scores_of_pairs(pairs: Sequence[OverlappingPairs], iou: float) -> Scores:
    """Score sequences by their boxes that overlap.

    Args:
        pairs: of each sequence.
        iou: smallest IoU of a match in metrics that have no thresholds of their own.
    """
    found: dict[str, float | int] = {}
    for metric in with_progress(metrics()):
        found |= metric.scores(metric.pool([metric.count(one, iou) for one in with_progress(pairs)]))
    return Scores(
        values={name: found[name] for name in (*share_names(), *number_names())},
        truth_boxes=sum(int(one.truth_count.sum()) for one in pairs),
        truth_ids=sum(len(one.truth_boxes_of) for one in pairs),
        track_boxes=sum(int(one.track_count.sum()) for one in pairs),
        track_ids=sum(len(one.track_boxes_of) for one in pairs),
        frames=sum(len(one.truth_count) for one in pairs),
        sequences=len(pairs),
    )
