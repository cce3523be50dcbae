"""All tracking scores of tracks against truth, pooled over sequences: CLEAR, identity and HOTA.

Each metric has a file of its own, `clear`, `identity` and `hota`; this one gathers what they say. The values
are those of TrackEval, which the MOTChallenge and KITTI servers use.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import progress_span, with_progress
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.clear import clear_counts, pooled_clear
from jeat_graph.eval.frames import Frames, Kind, build_frames
from jeat_graph.eval.hota import hota_counts, pooled_hota
from jeat_graph.eval.identity import identity_counts, pooled_identity
from jeat_graph.eval.overlapping import overlapping_pairs
from jeat_graph.eval.resampling import MAX_AGE_S

# Scores in per cent; the others are counts.
SHARES = ("MOTA", "MOTP", "HOTA", "DetA", "AssA", "LocA", "IDF1", "IDP", "IDR")
COUNTS = ("TP", "FP", "FN", "IDSW", "MT", "PT", "ML", "Frag")


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
    clear = pooled_clear([clear_counts(one, iou) for one in pairs])
    identity = pooled_identity([identity_counts(one, iou) for one in pairs])
    with progress_span(0.6, 1.0):
        hota = pooled_hota([hota_counts(one) for one in with_progress(pairs)])
    counts = {name: getattr(clear, name) for name in COUNTS}
    return Scores(
        MOTA=100.0 * clear.mota,
        MOTP=100.0 * clear.motp,
        HOTA=100.0 * float(hota.hota.mean()),
        DetA=100.0 * float(hota.deta.mean()),
        AssA=100.0 * float(hota.assa.mean()),
        LocA=100.0 * float(hota.loca.mean()),
        IDF1=100.0 * identity.idf1,
        IDP=100.0 * identity.idp,
        IDR=100.0 * identity.idr,
        **counts,
        truth_boxes=sum(int(one.truth_count.sum()) for one in pairs),
        truth_ids=sum(len(one.truth_boxes_of) for one in pairs),
        track_boxes=sum(int(one.track_count.sum()) for one in pairs),
        track_ids=sum(len(one.track_boxes_of) for one in pairs),
        frames=sum(len(one.truth_count) for one in pairs),
        sequences=len(pairs),
    )
