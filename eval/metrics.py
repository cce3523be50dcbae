"""CLEAR, identity and HOTA metrics of tracks against truth, pooled over sequences.

The arithmetic is that of the PyPI package `trackeval` (the reference implementation of HOTA, which the
MOTChallenge and KITTI servers use); this module feeds its metric classes and reads their results.

Sources: CLEAR: Bernardin and Stiefelhagen 2008; identity: Ristani et al. 2016; HOTA: Luiten et al. 2021.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.frames import Frames, Kind, build_frames

# Scores in per cent; the others are counts.
SHARES = ("MOTA", "MOTP", "HOTA", "DetA", "AssA", "LocA", "IDF1", "IDP", "IDR")


@dataclass(frozen=True)
class Scores:
    """Tracking scores, pooled over all sequences that were judged. Shares are in per cent.

    Attributes:
        MOTA: 1 - (FP + FN + IDSW) / truth boxes.
        MOTP: mean IoU of the matches.
        HOTA: geometric mean of DetA and AssA, averaged over the IoU thresholds 0.05, 0.10 … 0.95.
        DetA: detection accuracy, averaged likewise.
        AssA: association accuracy, averaged likewise.
        LocA: localisation accuracy, averaged likewise.
        IDF1: F1 score of the best one-to-one map of identities.
        IDP: precision of that map.
        IDR: recall of that map.
        TP: matched boxes.
        FP: track boxes without a truth box.
        FN: truth boxes without a track.
        IDSW: identity switches.
        MT: objects tracked in more than 80 % of their frames.
        PT: objects tracked in 20 to 80 %.
        ML: objects tracked in less than 20 %.
        Frag: interruptions of a tracked object.
        truth_boxes: boxes to be found.
        truth_ids: objects.
        track_boxes: boxes reported.
        track_ids: tracks reported.
        frames: frames judged.
        sequences: sequences judged.
    """

    MOTA: float
    MOTP: float
    HOTA: float
    DetA: float
    AssA: float
    LocA: float
    IDF1: float
    IDP: float
    IDR: float
    TP: int
    FP: int
    FN: int
    IDSW: int
    MT: int
    PT: int
    ML: int
    Frag: int
    truth_boxes: int
    truth_ids: int
    track_boxes: int
    track_ids: int
    frames: int
    sequences: int

    def as_dict(self) -> dict[str, float | int]:
        """Return the scores by name, in the order of the attributes."""
        return asdict(self)


def evaluate(
    pairs: Sequence[tuple[GroundTruth, Trajectories]],
    *,
    kind: Kind = "causal",
    iou: float = 0.5,
    max_age_s: float = 0.15,
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
    return pooled_scores([trackeval_input(frames) for frames in sequences], iou=iou)


def trackeval_input(frames: Frames) -> dict[str, Any]:
    """Lay one sequence out as `trackeval` wants it: identities numbered from 0, lists by frame."""
    truth_ids, truth_code = np.unique(frames.truth_id, return_inverse=True)
    track_ids, track_code = np.unique(frames.tracks.track_id, return_inverse=True)
    return {
        "num_timesteps": len(frames),
        "num_gt_ids": len(truth_ids),
        "num_tracker_ids": len(track_ids),
        "num_gt_dets": len(truth_code),
        "num_tracker_dets": len(track_code),
        "gt_ids": np.split(truth_code.reshape(-1), frames.truth_start[1:-1]),
        "tracker_ids": np.split(track_code.reshape(-1), frames.track_start[1:-1]),
        "similarity_scores": list(frames.iou),
    }


def pooled_scores(data: Sequence[dict[str, Any]], *, iou: float = 0.5) -> Scores:
    """Score sequences given as `trackeval` dictionaries, and pool them as the benchmarks do.

    Args:
        data: one dictionary a sequence (see `trackeval_input`).
        iou: smallest IoU of a match in CLEAR and identity metrics.
    """
    from trackeval.metrics import CLEAR, HOTA, Identity

    # PRINT_CONFIG: stdout belongs to our results.
    config = {"THRESHOLD": iou, "PRINT_CONFIG": False}
    results: dict[str, Any] = {}
    for metric in (CLEAR(dict(config)), Identity(dict(config)), HOTA()):
        one_by_one = {str(k): metric.eval_sequence(d) for k, d in enumerate(data)}
        results |= metric.combine_sequences(one_by_one)

    def percent(name: str) -> float:
        return 100.0 * float(np.mean(results[name]))

    def total(name: str) -> int:
        return int(sum(d[name] for d in data))

    values: dict[str, Any] = {name: percent(name) for name in SHARES}
    values |= {name: int(results[f"CLR_{name}"]) for name in ("TP", "FP", "FN")}
    values |= {name: int(results[name]) for name in ("IDSW", "MT", "PT", "ML", "Frag")}
    return Scores(
        **values,
        truth_boxes=total("num_gt_dets"),
        truth_ids=total("num_gt_ids"),
        track_boxes=total("num_tracker_dets"),
        track_ids=total("num_tracker_ids"),
        frames=total("num_timesteps"),
        sequences=len(data),
    )
