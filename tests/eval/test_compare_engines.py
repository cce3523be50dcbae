"""Comparing filter and smoothers works for every engine, and GTSAM stands beside our own pass."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from jeat_graph import load_config
from jeat_graph.api.sources import recording_of, truth_of
from jeat_graph.runs.declaring import fit_input
from jeat_graph.runs.measured import compare_run, track_measured

IMAGE = (1280, 720)


@pytest.mark.parametrize("engine", ["core", "reference", "paper"])
def test_every_engine_is_compared_and_gtsam_has_the_same_errors(engine):
    rng, times = np.random.default_rng(1), 0.05 * np.arange(24)
    boxes = np.column_stack([100.0 + 80.0 * times, 200.0 + 0 * times, 60.0 + 0 * times, 40.0 + 0 * times])
    columns = ["left", "top", "width", "height"]
    seen = pd.DataFrame(boxes + rng.normal(0.0, 1.0, boxes.shape), columns=columns)
    seen = seen.assign(t=times, sensor="cam", score=0.9)
    true = pd.DataFrame(boxes, columns=columns).assign(t=times, object_id=1)
    recording = recording_of(seen, {"image": IMAGE})
    preset = "paper" if engine == "paper" else "default"
    given = load_config(preset, [f"tracker.engine={engine}", "image={width: 1280, height: 720}"])
    run = track_measured(fit_input(given, recording)[0], recording)
    found = compare_run(run, truth_of(true, {"image": IMAGE}), [0.0, 0.2], gtsam=True).values
    errors = found["errors"]
    assert list(errors) == ["filter", "lag 0 s", "lag 0.2 s", "full", "gtsam-full"]
    assert errors["full"]["count"] == errors["filter"]["count"] > 8
    assert errors["full"]["position_rmse"] < errors["filter"]["position_rmse"]
    for name in ("position_rmse", "anees_position"):
        assert errors["gtsam-full"][name] == pytest.approx(errors["full"][name], rel=1e-6)
    assert found["consistency"]["innovations"] > 20
