"""Published scores of a known tracker's output on the two TUD sequences."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.eval.matching import match
from jeat_graph.eval.metrics import evaluate

from .data import make_tracks, make_truth, tud_pair

KNOWN = {
    "TUD-Campus": {"IDF1": 0.557659, "MOTA": 0.526462, "FP": 13, "FN": 150, "IDSW": 7},
    "TUD-Stadtmitte": {"IDF1": 0.644619, "MOTA": 0.564014, "FP": 45, "FN": 452, "IDSW": 7},
}


@pytest.mark.parametrize("kind", ["causal", "smoothed"])
@pytest.mark.parametrize("name", sorted(KNOWN))
def test_scores_of_the_tud_results_are_the_published_ones(name, kind):
    # The rows stand at the truth's own times, where predicting and interpolating both return them.
    scores = evaluate([tud_pair(name)], kind=kind)
    known = KNOWN[name]
    assert pytest.approx(known["MOTA"], abs=5e-7) == scores.MOTA / 100
    assert pytest.approx(known["IDF1"], abs=5e-7) == scores.IDF1 / 100
    assert (known["FP"], known["FN"], known["IDSW"]) == (scores.FP, scores.FN, scores.IDSW)


def test_sequences_are_pooled_by_summing_their_counts():
    scores = evaluate([tud_pair(name) for name in sorted(KNOWN)])
    errors = sum(known["FP"] + known["FN"] + known["IDSW"] for known in KNOWN.values())
    assert pytest.approx(100 * (1 - errors / scores.truth_boxes), abs=1e-9) == scores.MOTA
    assert scores.sequences == 2


def test_identities_of_different_sequences_are_different():
    t, box = [0.0, 0.1], [[0, 0, 10, 10]] * 2
    first = (make_truth(t, [1, 1], box), make_tracks(t, [7, 7], box))
    second = (make_truth(t, [1, 1], box), make_tracks(t, [8, 8], box))
    scores = evaluate([first, second])
    assert (scores.truth_ids, scores.IDSW, scores.IDF1) == (2, 0, 100.0)


def test_nothing_is_printed(capsys):
    box = [[0, 0, 10, 10]]
    evaluate([(make_truth([0.0], [1], box), make_tracks([0.0], [1], box))])
    out = capsys.readouterr()
    assert (out.out, out.err) == ("", "")


@pytest.mark.parametrize(("iou", "threshold"), [(0.5, 0.5), (0.3 - 5e-17, 0.3), (1.0, 1.0)])
def test_an_overlap_of_just_the_threshold_is_a_match(iou, threshold):
    assert match(np.array([[iou]]), threshold).tolist() == [0]
    assert match(np.array([[iou - 1e-9]]), threshold).tolist() == [-1]
