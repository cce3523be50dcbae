"""A side that shows again: to graph and smoother it is part of the prediction."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.reading import as_config
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.filters.singer import LOG_SIZE
from jeat_graph.runs.declaring import fit_input
from jeat_graph.smoothers.gtsam.filter_graph import filter_graph
from jeat_graph.tracking.records import record_tracks

PERIOD_S, HALVES = 0.05, 40


@pytest.fixture(scope="module")
def track():
    """A still box of 40 px whose right side lies 40 px further out from the middle on, and its records."""
    scans = [
        Scan(
            k * PERIOD_S,
            "rgb",
            np.array([[300.0, 200.0, 40.0 if k < HALVES else 80.0, 60.0]]),
            np.array([0.9]),
        )
        for k in range(2 * HALVES)
    ]
    detections = Detections.from_scans(scans)
    config, _ = fit_input(as_config("default", (1280, 720)), detections)
    tracks, _ = record_tracks(config, detections)
    return max(tracks, key=len)


def test_the_side_is_taken_and_the_identity_stays(track):
    assert len(track) == 2 * HALVES
    assert np.exp(track.mean[-1, 0, LOG_SIZE]) == pytest.approx(80.0, rel=0.02)


def test_smoothing_knows_no_less_than_the_filter(track):
    _, covariance = track.smoothed()
    ratio = np.diagonal(covariance, axis1=2, axis2=3) / np.diagonal(track.covariance, axis1=2, axis2=3)
    assert ratio.max() < 1.0 + 1e-6


def test_the_graph_gives_what_the_smoother_gives(track):
    graph = filter_graph([track])
    motion = graph.motion(graph.solve(), track.track_id)
    states, covariances = track.smoothed()
    mean, covariance = track.motion(states), track.motion_covariance(states, covariances)
    std = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    np.testing.assert_allclose((motion - mean) / std, 0.0, atol=1e-3)
