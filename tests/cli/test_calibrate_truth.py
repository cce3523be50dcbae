"""`calibrate --gt`: truth that is not of the recording's clock."""

from __future__ import annotations

import pandas as pd
import pytest


@pytest.mark.parametrize(
    ("times", "words"),
    [(lambda t: 1e3 * t, "different units of time"), (lambda t: 1e5 + t, "no common timestamps")],
    ids=["ms", "another clock"],
)
def test_truth_of_another_clock_is_named_as_eval_names_it(recording, tmp_path, fails, times, words):
    truth = pd.read_csv(recording / "gt.csv")
    truth.assign(t=times(truth.t)).to_csv(tmp_path / "gt.csv", index=False)
    command = ["calibrate", recording / "detections.csv", "--gt", tmp_path / "gt.csv", "--image", "1280x720"]
    line = fails(*command, "--no-tune", "--out", tmp_path / "found.yaml")
    assert f"gt.csv: {words}" in line
    assert "detections" in line
