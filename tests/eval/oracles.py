"""The inputs of other packages' metrics, and their results under our names."""

from __future__ import annotations

import numpy as np


def trackeval_input(frames):
    """One sequence as TrackEval wants it: identities numbered from 0, lists by frame."""
    truth_ids, truth = np.unique(frames.truth_id, return_inverse=True)
    track_ids, track = np.unique(frames.tracks.track_id, return_inverse=True)
    return {
        "num_timesteps": len(frames),
        "num_gt_ids": len(truth_ids),
        "num_tracker_ids": len(track_ids),
        "num_gt_dets": len(truth),
        "num_tracker_dets": len(track),
        "gt_ids": np.split(truth, frames.truth_start[1:-1]),
        "tracker_ids": np.split(track, frames.track_start[1:-1]),
        "similarity_scores": list(frames.iou),
    }


def trackeval_scores(sequences, iou=0.5):
    """Scores of TrackEval, in per cent where ours are."""
    from trackeval.metrics import CLEAR, HOTA, Identity

    config = {"THRESHOLD": iou, "PRINT_CONFIG": False}
    found = {}
    for metric in (CLEAR(dict(config)), Identity(dict(config)), HOTA()):
        found |= metric.combine_sequences(
            {str(k): metric.eval_sequence(trackeval_input(one)) for k, one in enumerate(sequences)}
        )
    shares = ("MOTA", "MOTP", "HOTA", "DetA", "AssA", "LocA", "IDF1", "IDP", "IDR")
    scores = {name: 100.0 * float(np.mean(found[name])) for name in shares}
    scores |= {name: int(found[f"CLR_{name}"]) for name in ("TP", "FP", "FN")}
    return scores | {name: int(found[name]) for name in ("IDSW", "MT", "PT", "ML", "Frag")}


def roboflow_scores(sequences, iou=0.5):
    """Scores of the package `trackers`, in per cent where ours are."""
    from trackers import eval as oracle

    lists = [trackeval_input(one) for one in sequences]
    inputs = [(d["gt_ids"], d["tracker_ids"], d["similarity_scores"]) for d in lists]
    clear = oracle.aggregate_clear_metrics([oracle.compute_clear_metrics(*i, threshold=iou) for i in inputs])
    identity = oracle.aggregate_identity_metrics(
        [oracle.compute_identity_metrics(*i, threshold=iou) for i in inputs]
    )
    hota = oracle.aggregate_hota_metrics([oracle.compute_hota_metrics(*i) for i in inputs])
    scores = {name: 100.0 * clear[name] for name in ("MOTA", "MOTP")}
    scores |= {name: 100.0 * identity[name] for name in ("IDF1", "IDP", "IDR")}
    scores |= {name: 100.0 * hota[name] for name in ("HOTA", "DetA", "AssA", "LocA")}
    scores |= {name: clear[f"CLR_{name}"] for name in ("TP", "FP", "FN")}
    return scores | {name: clear[name] for name in ("IDSW", "MT", "PT", "ML", "Frag")}
