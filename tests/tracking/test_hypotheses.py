"""Why a track is taken for what it is: terms whose sum is its log odds, in both engines."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Tracker


def street(engine: str, scans: int = 12):
    """A car that both cameras see, a window that one repeats at a low score, and single false boxes."""
    rng = np.random.default_rng(3)
    tracker = Tracker(engine=engine, image=(1280, 720))
    for k in range(scans):
        t = 0.1 * k
        car = [100.0 + 8.0 * k, 300.0, 80.0, 50.0]
        window = [900.0, 200.0, 40.0, 60.0]
        noise = [*rng.uniform(0.0, 600.0, 2), 30.0, 30.0]
        tracker.step((t, "a", [car, window, noise], [0.9, 0.15, 0.1]))
        tracker.step((t + 0.05, "b", [[100.0 + 8.0 * (k + 0.5), 300.0, 80.0, 50.0]], [0.8]))
    return tracker


@pytest.mark.parametrize("engine", ["core", "reference"])
def test_the_terms_sum_to_the_log_odds(engine):
    found = street(engine).hypotheses()
    assert len(found.track_id) >= 3
    # What is learnt of the sensors at the end of a step changes the next one's.
    np.testing.assert_allclose(found.terms.total(), found.log_odds, atol=0.05)


def test_the_same_from_both_engines():
    core, reference = street("core").hypotheses(), street("reference").hypotheses()
    np.testing.assert_array_equal(core.track_id, reference.track_id)
    np.testing.assert_allclose(core.log_odds, reference.log_odds, atol=1e-6)
    for one, other in zip(core.terms, reference.terms, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)


def test_what_speaks_for_a_car_and_against_a_window():
    found = street("core").hypotheses()
    car, window = (int(np.abs(found.boxes[:, 0] - left).argmin()) for left in (188.0, 900.0))
    assert found.reported[car]
    assert not found.reported[window]
    assert (found.terms.scores[car] > 0.0).all()
    assert found.terms.scores[window, 0] < 0.0, "low scores speak against it"
    detected = found.terms.hits_and_misses[:, 1]
    assert detected[window] < detected[car], "and that the other camera sees nothing"
