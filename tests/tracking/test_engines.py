"""What every engine has, and how it says what it has not: the contract of `engine.TrackEngine`."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.data.errors import ConfigError, DataError, JeatGraphError
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.smoothers.histories import StepRecord
from jeat_graph.tracking.engine import TrackEngine
from jeat_graph.tracking.engines import make_engine
from jeat_graph.tracking.model_tracker import ModelTracker

ENGINES = ("core", "reference", "paper")
#: What an engine has beside its tracks.
SAVES, FITS, WEIGHS, BY_CONTENT = (
    {"core"},
    {"core", "reference"},
    {"core", "reference"},
    {"core", "reference"},
)

every_engine = pytest.mark.parametrize("engine", ENGINES)


def configured(engine, *settings):
    preset = "paper" if engine == "paper" else "default"
    return load_config(preset, [f"tracker.engine={engine}", "image={width: 1280, height: 720}", *settings])


def vehicles(times=30):
    for k in range(times):
        boxes = np.array([[100.0 + 4 * k, 200, 60, 40], [900.0 - 3 * k, 400, 80, 60]])
        yield 0.05 * k, "rgb", boxes, [0.9, 0.8]


def tracked(engine, *settings, **options):
    tracker = Tracker(configured(engine, *settings), **options)
    for scan in vehicles():
        tracker.step(scan)
    return tracker


@every_engine
def test_an_engine_has_all_methods_of_the_contract_with_their_arguments(engine):
    made = make_engine(configured(engine))
    for name, wanted in inspect.getmembers(TrackEngine):
        if name.startswith("_"):
            continue
        assert hasattr(made, name), f"{engine} lacks {name}"
        if inspect.isfunction(wanted):
            found = inspect.signature(getattr(type(made), name)).parameters
            assert list(found) == list(inspect.signature(wanted).parameters), name


@every_engine
def test_every_tracker_is_a_tracker(engine):
    tracker = tracked(engine)
    assert type(tracker) is Tracker
    assert isinstance(tracker, ModelTracker)
    assert tracker.config.tracker.engine == engine
    assert tracker.num_tracks == tracker.num_born == 2
    assert tracker.time == pytest.approx(1.45)
    assert tracker.causal().track_id.tolist() == [1, 2]
    assert tracker.assigned(2).tolist() == [1, 2]
    assert tracker.last_scans()["rgb"] == tracker.time
    assert tracker.sensor_states().keys() == tracker.learnt().keys() == {"rgb"}
    assert tracker.predict(1.5).track_id.tolist() == [1, 2]


@every_engine
@pytest.mark.parametrize("smoother", ["fixed-lag", "full", "gtsam", "gtsam-full"])
def test_every_engine_smooths_by_every_smoother(engine, smoother):
    rows = tracked(engine, f"smoother.engine={smoother}", "smoother.lag_s=.3").finish()
    assert len(rows) == 60
    assert np.isfinite(rows.mean).all()
    assert (rows.var > 0.0).all()


@every_engine
def test_every_engine_hands_over_the_same_records(engine):
    tracker = Tracker(configured(engine))
    for scan in vehicles(5):
        (taken,) = [tracker.take_in([_scan(scan)])]
        record = tracker.step_record(taken)
        tracker.hand_over(taken)
    assert isinstance(record, StepRecord)
    assert record.track_ids().tolist() == [1, 2]
    assert record.kept.all()
    assert record.confirmed.all()
    (one,) = record.scans
    count, axes, size = one.mean.shape
    assert (count, axes) == (2, 2)
    assert one.F.shape == (2, 1, size, size)
    assert one.covariance.shape == one.predicted_covariance.shape == (2, 2, size, size)
    assert one.sensor.tolist() == [0, 0]
    # A measurement tells something: what it measures is known better afterwards.
    assert (one.covariance[..., 0, 0] < one.predicted_covariance[..., 0, 0]).all()


@every_engine
def test_records_and_snapshots_of_another_engine_are_refused(engine):
    other = {"core": "paper", "reference": "core", "paper": "reference"}[engine]
    mine, theirs = tracked(engine)._model, tracked(other)._model
    with pytest.raises(TypeError, match="another engine"):
        mine.restore(theirs.snapshot())
    if engine != "paper":  # its record is the one that all have
        with pytest.raises(TypeError, match="another engine"):
            mine.step_record(theirs.record())


@every_engine
def test_it_is_saved_or_says_that_it_is_not(engine, tmp_path):
    tracker = tracked(engine)
    assert tracker.can_save == (engine in SAVES)
    if tracker.can_save:
        tracker.save(tmp_path / "state.npz")
        loaded = Tracker.load(tmp_path / "state.npz")
        assert loaded.finish().mean.tobytes() == tracker.finish().mean.tobytes()
        return
    for ask in (tracker.state, lambda: tracker.save(tmp_path / "state.npz")):
        with pytest.raises(JeatGraphError, match=f"engine {engine} is not saved"):
            ask()
    assert not (tmp_path / "state.npz").exists()


@every_engine
def test_it_has_diagnostics_or_says_that_it_has_none(engine):
    if engine in FITS:
        tracker = tracked(engine, diagnostics=True)
        assert tracker.has_diagnostics
        assert len(tracker.last_updates()) == len(tracker.last_measurements()[0]) == 2
    else:
        with pytest.raises(JeatGraphError, match=f"engine {engine} has no diagnostics"):
            tracked(engine, diagnostics=True)
    with pytest.raises(JeatGraphError, match="diagnostics"):
        tracked(engine).last_updates()


@every_engine
def test_it_weighs_hypotheses_or_says_that_it_has_none(engine):
    tracker = tracked(engine)
    assert tracker.can_explain == (engine in WEIGHS)
    if tracker.can_explain:
        assert tracker.hypotheses().track_id.tolist() == [1, 2]
    else:
        with pytest.raises(JeatGraphError, match=f"engine {engine} weighs no hypotheses"):
            tracker.hypotheses()


@every_engine
def test_it_compares_looks_or_says_that_it_does_not(engine):
    tracker = tracked(engine)
    scan = (2.0, "rgb", [[0, 0, 5, 5]], [0.5], None, [[1.0, 0.0]])
    if engine in BY_CONTENT:
        tracker.step(scan)
    else:
        with pytest.raises(DataError, match="no embeddings"):
            tracker.step(scan)
    assert tracker.time == (2.0 if engine in BY_CONTENT else pytest.approx(1.45))


def test_constants_of_the_model_are_none_of_the_papers():
    with pytest.raises(ConfigError, match="section paper"):
        Tracker("paper", constants=ModelConstants())


@every_engine
def test_a_rate_of_the_output_thins_the_smoothed_table(engine):
    every = tracked(engine).finish()
    some = tracked(engine, "smoother.output_rate_hz=4").finish()
    assert sorted(set(some.t.tolist())) == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0, 1.25])
    kept = every.take(np.isin(every.t, some.t))
    assert kept.mean.tobytes() == some.mean.tobytes()


def _scan(scan):
    from jeat_graph.data.detections import Scan

    return Scan(*scan)
