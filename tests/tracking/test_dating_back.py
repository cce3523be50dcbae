"""How far back the smoothed table goes before an object was first taken for one."""

import math

import numpy as np
import pytest

from jeat_graph import Scan, Tracker, load_config
from jeat_graph.filters.model_constants import ModelConstants

RATE_HZ, DOUBTFUL_S = 20.0, 2.0


def tracked(engine: str, smoother: str):
    """A box whose scores say little for two seconds, and then much; others are sure all the time."""
    tracker = Tracker(load_config("default", [f"tracker.engine={engine}", f"smoother.engine={smoother}"]))
    causal = []
    for k in range(round(6 * RATE_HZ)):
        t = k / RATE_HZ
        boxes = np.array([[400.0 + 60 * t, 200.0, 40.0, 30.0], [100.0 + 50 * t, 400.0, 60.0, 45.0]])
        scores = np.array([0.25 if t < DOUBTFUL_S else 0.95, 0.95])
        causal.append(tracker.step(Scan(t, "rgb", boxes, scores)))
    first = min(
        float(t) for table in causal for t, box in zip(table.t, table.boxes, strict=True) if box[1] < 300
    )
    smoothed = tracker.finish()
    return first, smoothed.take(smoothed.boxes[:, 1] < 300)


@pytest.mark.parametrize("smoother", ["full", "fixed-lag"])
def test_what_turns_out_real_is_dated_back_by_some_tenths_of_a_second(smoother):
    first, smoothed = tracked("core", smoother)
    assert first > DOUBTFUL_S - 1.0
    furthest = ModelConstants().turning_s * math.log(2.0)
    assert first - furthest - 1e-9 <= smoothed.t.min() < first
    before = smoothed.t < first - 1e-9
    growth = np.diff(np.log(smoothed.existence[before])) * ModelConstants().turning_s * RATE_HZ
    assert len(growth) > 2
    assert growth == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("smoother", ["full", "fixed-lag"])
def test_the_core_dates_back_as_the_reference_does(smoother):
    (_, core), (_, reference) = (tracked(engine, smoother) for engine in ("core", "reference"))
    assert np.array_equal(core.t, reference.t)
    assert core.existence == pytest.approx(reference.existence, abs=1e-8)


def test_nothing_is_dated_back_that_was_real_from_its_first_row(tmp_path):
    """A saved tracker remembers that rows of a track are out in which it was real."""
    tracker = Tracker(load_config("default", ["smoother.engine=fixed-lag", "smoother.lag_s=0.5"]))
    for k in range(100):
        box = np.array([[100.0 + 2 * k, 100.0, 40.0, 30.0]])
        tracker.step(Scan(k / RATE_HZ, "rgb", box, np.array([0.9])))
    assert tracker._model.state()["histories.was_real"].ravel().tolist() == [1]
    tracker.save(tmp_path / "state.npz")
    assert Tracker.load(tmp_path / "state.npz")._model.state()["histories.was_real"].ravel().tolist() == [1]
