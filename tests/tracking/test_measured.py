"""What is kept of believed tracks is what their filter took in, and no more waits than must."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.tracking.measured import ConfirmedMeasurements
from jeat_graph.tracking.tracker import Tracker


def scans():
    """A car, and false boxes of low scores here and there."""
    rng = np.random.default_rng(0)
    for k in range(60):
        boxes = [[100.0 + 5 * k, 300.0, 80.0, 50.0], [*rng.uniform(0.0, 600.0, 2), 30.0, 30.0]]
        yield (k / 20, "rgb", boxes, [0.9, 0.1])


@pytest.mark.parametrize("every", [1, 7, 10**9])
def test_however_often_it_is_released_it_is_the_same(every):
    tracker = Tracker(image=(1280, 720), diagnostics=True)
    kept, parts = ConfirmedMeasurements(tracker), []
    for k, scan in enumerate(scans()):
        tracker.step(scan)
        kept.add_step()
        if k % every == 0:
            parts.append(kept.release())
    rows = np.concatenate([*parts, kept.release()])
    car = rows[rows["track_id"] == 1]
    assert len(car) == 60
    np.testing.assert_allclose(np.sort(car["z"][:, 0]), 140.0 + 5.0 * np.arange(60))
    assert car["birth"].sum() == 1
    assert (car["r"] > 0.0).all()


def test_only_living_doubtful_tracks_wait():
    tracker = Tracker(image=(1280, 720), diagnostics=True)
    kept = ConfirmedMeasurements(tracker)
    for scan in scans():
        tracker.step(scan)
        kept.add_step()
        kept.release()
        _, living, confirmed = tracker.last_measurements()
        assert np.isin(kept._waiting[0]["track_id"], living[~confirmed]).all()


def test_a_tracker_without_diagnostics_has_none():
    with pytest.raises(JeatGraphError, match="diagnostics"):
        ConfirmedMeasurements(Tracker()).add_step()
