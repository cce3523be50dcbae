"""What is kept of the confirmed tracks is what their smoothers are given, and no more waits than must."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.errors import JeatGraphError
from jeat_graph.tracking.measured import ConfirmedMeasurements, measured_tracks
from jeat_graph.tracking.smoothing.priors import ErrorStates, track_data
from jeat_graph.tracking.tracker import Tracker
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.simulate import record

CONFIG = load_config("highway", ["smoother.engine=rts", "smoother.stitch=true"])


@pytest.fixture(scope="module")
def recording():
    return record(load_scenario("night"), 5, 2.0).detections


@pytest.mark.parametrize("every", [1, 7, 10**9])
def test_it_is_what_the_smoothers_were_given(recording, every):
    tracker = Tracker(CONFIG, diagnostics=True)
    kept, parts = ConfirmedMeasurements(tracker), []
    for k, batch in enumerate(recording.batches()):
        tracker.step(batch)
        kept.add_step()
        if k % every == 0:
            parts.append(kept.release())
    parts.append(kept.release())
    tracks = measured_tracks(np.concatenate(parts), CONFIG)

    inner = tracker._smoothers
    inner._consume()
    inner._smoothers.work()
    known = [*inner._smoothers._done, *inner._smoothers._histories.values()]
    histories = {history.track_id: history for history in known if history.confirmed}
    assert [one.track_id for one in tracks] == sorted(histories)
    assert len(tracks) > 5
    errors = ErrorStates.of(CONFIG)
    for one in tracks:
        rows = histories[one.track_id].whole()
        expected = track_data(rows, errors)
        for name in ("prior_mean", "prior_cov", "t", "jerk", "z", "r", "coloured_std", "error", "key"):
            np.testing.assert_array_equal(getattr(one.data, name), getattr(expected, name))
        assert one.birth_sensor == rows["sensor"][0]
        np.testing.assert_array_equal(one.sensor, rows["sensor"][1:])


def test_only_living_tentative_tracks_wait(recording):
    tracker = Tracker(CONFIG, diagnostics=True)
    kept = ConfirmedMeasurements(tracker)
    for batch in recording.batches():
        tracker.step(batch)
        kept.add_step()
        kept.release()
        _, living, confirmed = tracker.last_measurements()
        assert np.isin(kept._waiting[0]["track_id"], living[~confirmed]).all()


def test_a_tracker_without_diagnostics_has_none(recording):
    tracker = Tracker(CONFIG)
    with pytest.raises(JeatGraphError, match="diagnostics"):
        ConfirmedMeasurements(tracker).add_step()
