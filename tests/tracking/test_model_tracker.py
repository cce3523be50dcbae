"""What the model's tracker returns beside its tables, and what is declared of its sensors."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.config.sensors import SensorConfig
from jeat_graph.core import tracking as compiled
from jeat_graph.data.errors import ConfigError, DataError, JeatGraphError, TimeOrderError
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.score_calibration import logit
from jeat_graph.tracking.core_model import CoreModel
from jeat_graph.tracking.engine import StepInput
from jeat_graph.tracking.model_tracker import ModelTracker
from jeat_graph.tracking.reference_model import ReferenceModel

_SIZE = (1280, 720)
ENGINES = ("core", "reference")


def made(engine="core", *overrides, **more):
    return Tracker(
        load_config("default", ["smoother.engine=none", *overrides]), image=_SIZE, engine=engine, **more
    )


def moving(times=40, speed=(80.0, -30.0), noise=0.5):
    rng = np.random.default_rng(3)
    for k in range(times):
        t = 0.05 * k
        boxes = [[200 + speed[0] * t, 300 + speed[1] * t, 60, 40], [700, 500, 50, 50]]
        yield t, "cam", np.array(boxes) + rng.normal(0, noise, (2, 4)), [0.9, 0.8]


# Predictions.


@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_predicted_is_what_the_filter_itself_predicts(engine):
    tracker = made(engine)
    for scan in moving():
        tracker.step(scan)
    now, soon = tracker.causal(), tracker.predict(2.03)
    tracker.step((2.03, "cam", [], []))  # it finds nothing: the states are the predicted ones
    then = tracker.causal()
    np.testing.assert_array_equal(now.track_id, soon.track_id)
    np.testing.assert_array_equal(soon.track_id, then.track_id)
    np.testing.assert_allclose(soon.mean, then.mean, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(soon.var, then.var, rtol=1e-9)
    np.testing.assert_allclose(soon.boxes, then.boxes, rtol=1e-9)
    assert (soon.t == 2.03).all()
    assert not soon.used.any()


def test_what_is_predicted_is_less_sure_the_farther_ahead_and_changes_nothing():
    tracker = made()
    for scan in moving():
        tracker.step(scan)
    before = tracker.causal()
    last = None
    for ahead in (0.0, 0.05, 0.2, 0.8):
        said = tracker.predict(tracker.time + ahead)
        np.testing.assert_allclose(np.diagonal(said.cov, axis1=1, axis2=2), said.var)
        np.testing.assert_allclose(said.cov, said.cov.transpose(0, 2, 1), rtol=1e-9, atol=1e-9)
        assert (np.linalg.eigvalsh(said.cov) > 0.0).all()
        if last is not None:
            assert (said.var[:, :2] > last.var[:, :2]).all()
        last = said
    at_once = tracker.predict(tracker.time)
    np.testing.assert_array_equal(at_once.mean, before.mean)
    assert tracker.causal() is before


def test_who_will_have_left_the_picture_is_not_predicted():
    tracker = made()
    for scan in moving(60, (400.0, 0.0)):
        tracker.step(scan)
    assert len(tracker.causal()) == 2
    assert len(tracker.predict(tracker.time + 0.5)) == 1


def test_the_past_is_not_predicted():
    tracker = made()
    assert not len(tracker.predict(5.0))
    tracker.step((1.0, "cam", [[1, 1, 20, 20]], [0.9]))
    with pytest.raises(TimeOrderError, match="past"):
        tracker.predict(0.5)
    with pytest.raises(DataError):
        tracker.predict(float("nan"))


# Diagnostics.


@pytest.mark.parametrize("engine", ENGINES)
def test_each_box_of_a_step_tells_how_well_it_fitted(engine):
    tracker = made(engine, diagnostics=True)
    assert tracker.has_diagnostics
    told = []
    for scan in moving(100, noise=3.0):
        tracker.step(scan)
        told.append(tracker.last_updates())
    assert np.isnan(told[0].nis).all()
    assert all(len(one) == 2 for one in told)
    nis = np.concatenate([one.nis for one in told[30:]])
    assert 0.3 < nis.mean() < 4.0  # χ² of two degrees of freedom has the mean 2
    assert (told[-1].existence > 0.8).all()
    np.testing.assert_array_equal(told[-1].track_id, tracker.causal().track_id)
    assert told[0].noise_scale.tolist() == pytest.approx([1.0, 1.0])
    rows, living, real = tracker.last_measurements()
    np.testing.assert_allclose(rows["z"][0], scan[2][0, :2] + scan[2][0, 2:] / 2.0)
    np.testing.assert_array_equal(rows["nis"], told[-1].nis)
    assert (rows["r"] > 0.0).all()
    assert (rows["jerk"] > 0.0).all()
    assert not rows["birth"].any()
    np.testing.assert_array_equal(rows["track_id"], living[real])


def test_the_core_and_the_reference_tell_the_same_of_the_same_boxes():
    told = []
    for engine in ENGINES:
        tracker = made(engine, diagnostics=True)
        parts = []
        for scan in moving(30):
            tracker.step(scan)
            one, rows = tracker.last_updates(), tracker.last_measurements()[0]
            parts.append((one.nis, one.noise_scale, one.existence, rows["r"], rows["size_var"], rows["jerk"]))
        told.append(parts)
    for one, other in zip(*told, strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-7)


def test_who_did_not_ask_for_diagnostics_is_told_so():
    tracker = made()
    assert not tracker.has_diagnostics
    for ask in (tracker.last_updates, tracker.last_measurements):
        with pytest.raises(JeatGraphError, match="diagnostics=True"):
            ask()


# What vehicles look like.


def crossing(looks, seed=0):
    """Two vehicles that meet, hide each other for half a second, and turn back or drive on: none can tell."""
    rng = np.random.default_rng(seed)
    own = rng.normal(size=(2, 16))
    for k in range(80):
        t = 0.05 * k
        x = np.array([200 + 100 * t, 600 - 100 * t]) if k < 40 else np.array([600 - 100 * t, 200 + 100 * t])
        boxes = np.column_stack([x, [300, 300], [40, 40], [30, 30]]) + rng.normal(0, 0.5, (2, 4))
        seen = np.array([0, 1]) if not 36 <= k < 44 else np.zeros(0, dtype=int)
        found = own + 0.2 * rng.normal(size=(2, 16))
        more = [None, found[seen] / np.linalg.norm(found[seen], axis=1, keepdims=True)] if looks else []
        yield (t, "cam", boxes[seen], np.full(len(seen), 0.9), *more), x


@pytest.mark.parametrize("engine", ENGINES)
def test_vehicles_that_turn_back_behind_each_other_are_told_apart_by_their_looks(engine):
    kept = {}
    for looks in (True, False):
        tracker = made(engine)
        for k, (scan, x) in enumerate(crossing(looks)):
            table = tracker.step(scan)
            if k == 30:
                first = table.track_id[np.abs(table.boxes[:, 0] - x[0]).argmin()]
        kept[looks] = first == table.track_id[np.abs(table.boxes[:, 0] - x[0]).argmin()]
    assert kept == {True: True, False: False}


def test_embeddings_of_another_length_are_refused_and_change_nothing():
    tracker = made()
    for scan, _ in crossing(True):
        tracker.step(scan)
    before = tracker.causal()
    with pytest.raises(DataError, match="16 numbers as those before, not 3"):
        tracker.step((9.0, "cam", [[1, 2, 30, 40]], [0.9], None, np.ones((1, 3))))
    assert tracker.causal() is before


def test_looks_decide_who_takes_a_box_and_not_whether_there_is_an_object():
    answers = []
    for make in (CoreModel, ReferenceModel):
        settings = ["smoother.engine=none", "image={width: 1280, height: 720}"]
        model = make(ModelConstants(), load_config("default", settings))
        model.declare_sensor("cam", SensorConfig())
        one = np.ones(1, np.int64)
        for k in range(30):
            boxes = np.array([[100.0 + k, 100.0, 40.0, 30.0], [400.0, 400.0, 40.0, 40.0]])
            alike = np.full((model.size(), 2), -5.0)  # nobody looks like himself, nor like the other
            model.take(StepInput(0.05 * k, 0 * one, 2 * one, boxes, np.full(2, 0.88), alike))
        answers.append((model.rows()[1].tolist(), model.born(), model.rows()[4]))
    assert answers[0][0] == answers[1][0] == [1, 2]
    assert answers[0][1] == answers[1][1] == 2
    np.testing.assert_allclose(answers[0][2], answers[1][2], rtol=1e-9)


def test_what_is_compared_must_be_of_the_tracks_and_the_boxes():
    model = compiled.Model(ModelConstants(), 1280.0, 720.0, True, -1.0)
    model.declare_sensor()
    none, one = np.zeros(1, np.int64), np.ones(1, np.int64)
    box = np.array([[0.0, 0.0, 10.0, 10.0]])
    with pytest.raises(ValueError, match="number of tracks"):
        model.take(0.0, none, one, box, np.zeros(1), np.zeros((3, 1)))
    with pytest.raises(ValueError, match="different lengths"):
        model.take(0.0, none, one, box, np.zeros(1), np.zeros((0, 2)))


# What is said of a sensor.


@pytest.mark.parametrize("engine", ENGINES)
def test_the_score_at_which_a_box_is_as_likely_real_as_not_is_believed(engine):
    born = {}
    for even in ("null", ".2", ".95"):
        tracker = made(
            engine, f"sensors.cam={{rate_hz: 20, even_score: {'null' if even == 'none' else even}}}"
        )
        for t, sensor, boxes, _ in moving(20):
            table = tracker.step((t, sensor, boxes, [0.6, 0.6]))
        born[even] = float(tracker.step((1.0, "cam", [], [])).existence.sum()) if len(table) else 0.0
        learnt = tracker._model.learnt().belief.decision_threshold
        if even != "null":
            assert learnt[0] == pytest.approx(float(logit(np.array(float(even)))))
    assert born[".95"] < born[".2"]


@pytest.mark.parametrize("said", ["kind: radar", "even_score: 0", "even_score: 2", "even_score: high"])
def test_what_cannot_be_said_of_a_sensor_is_refused(said):
    with pytest.raises(ConfigError, match=said.split(":")[0]):
        load_config("default", [f"sensors.cam={{rate_hz: 20, {said}}}"])


# Sensors that see only what moves.


def stopping_traffic(seed, seconds=8.0):
    """Vehicles that stop for 4 s: an event camera sees nothing of them then, a camera two times in five."""
    rng = np.random.default_rng(seed)
    stops = 2.5 + rng.uniform(0, 1, 6)
    times = sorted(
        [(k / 100, "evt") for k in range(int(100 * seconds))]
        + [(k / 20 + 0.003, "rgb") for k in range(int(20 * seconds))]
    )
    for t, sensor in times:
        x = 50.0 + 100.0 * (np.minimum(t, stops) + np.maximum(0.0, t - stops - 4.0))
        standing = (t > stops) & (t < stops + 4.0)
        centres = np.column_stack([x, 60.0 + 100.0 * np.arange(6)])
        found = rng.random(6) < np.where(sensor == "rgb", 0.4, np.where(standing, 0.0, 0.9))
        boxes = np.column_stack([centres - (30.0, 20.0), np.tile((60.0, 40.0), (6, 1))])[found]
        boxes[:, :2] += rng.normal(0, 1.5, (len(boxes), 2))
        yield (t, sensor, boxes, rng.uniform(0.3, 0.9, len(boxes))), centres[standing & (t > stops + 0.3)]


def test_that_an_event_camera_sees_nothing_that_stands_is_learnt():
    reported = {}
    for name, constants in (
        ("learnt", ModelConstants()),
        ("not", ModelConstants(stationary_unseen_share=1e-9, stationary_unseen_bounds=(1e-9, 1e-9))),
    ):
        there = []
        for seed in range(3):
            tracker = ModelTracker("default", image=(1280, 720), constants=constants)
            for scan, standing in stopping_traffic(seed):
                table = tracker.step(scan)
                if len(standing):
                    centres = table.boxes[:, None, :2] + table.boxes[:, None, 2:] / 2.0
                    off = np.linalg.norm(centres - standing[None], axis=2)
                    there += (off.min(axis=0, initial=np.inf) < 20.0).tolist()
            blind = tracker._model.learnt().belief.stationary_unseen
        reported[name] = np.mean(there)
    assert blind[0] < 1e-6
    assert reported["learnt"] > 0.85
    assert reported["learnt"] > reported["not"] + 0.03


def parked(seed, seconds=4.0):
    """A vehicle that a camera finds at its place one look in three, an event camera never; one passes."""
    rng = np.random.default_rng(seed)
    times = sorted(
        [(k / 100, "evt") for k in range(int(100 * seconds))]
        + [(k / 20 + 0.003, "rgb") for k in range(int(20 * seconds))]
    )
    for t, sensor in times:
        there = np.array([[600.0, 300.0], [100.0 + 150.0 * t, 500.0]])
        found = rng.random(2) < ([0.35, 0.7] if sensor == "rgb" else [0.0, 0.9])
        boxes = np.column_stack([there, np.full((2, 2), 40.0)])[found] + rng.normal(0, 0.8, (found.sum(), 4))
        yield t, sensor, boxes, rng.uniform(0.45, 0.65, len(boxes))


def parked_odds(kind):
    """Log odds of the parked vehicle at the end, and what is believed of the event camera by then."""
    odds = []
    for seed in range(4):
        told = {} if kind is None else {"evt": {"kind": kind}}
        settings = [f"sensors.{name}={keys}" for name, keys in told.items()]
        tracker = ModelTracker(load_config("default", [*settings, "smoother.engine=none"]), image=(1280, 720))
        for scan in parked(seed):
            tracker.step(scan)
        found = tracker.hypotheses()
        at = np.abs(found.boxes[:, :2] - [600.0, 300.0]).max(axis=1) < 20.0
        odds.append(found.log_odds[at].max())
    return np.array(odds)


def test_the_silence_of_what_is_told_to_be_an_event_camera_says_little_about_what_stands():
    usual, event = parked_odds(None), parked_odds("event")
    assert (event > usual + 0.4).all()
    for kind in ("camera", "other"):  # nothing was measured to be better of them than what is usual
        np.testing.assert_array_equal(parked_odds(kind), usual)


# What a detector returns.


def test_a_detector_that_found_nothing_is_taken_as_such():
    tracker = made()
    for t, sensor, boxes, scores in moving(20):
        tracker.update(boxes, t=t, sensor=sensor, scores=scores)
    tracker.update(None, t=1.0, sensor="cam")
    assert tracker.time == 1.0
    assert tracker.num_tracks == 2


def test_corners_are_taken_where_they_are_named():
    one, other = made(), made()
    for t, sensor, boxes, scores in moving(20):
        corners = np.concatenate([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]], axis=1)
        ours = one.update(boxes, t=t, sensor=sensor, scores=scores)
        theirs = other.update(corners, t=t, sensor=sensor, scores=scores, format="xyxy")
        np.testing.assert_allclose(ours.boxes, theirs.boxes)


def test_tables_know_their_instant_where_they_have_no_row():
    table = made().step((3.0, "cam", [], []))
    assert table.instants.tolist() == [3.0]


def test_old_names_warn_and_do_the_same():
    tracker = Tracker("default", image=(1920, 1080))
    tracker.step((0.0, "rgb", [[100, 100, 40, 30]], [0.9]))
    with pytest.warns(DeprecationWarning, match="is now called assigned"):
        assert tracker.takers(1).tolist() == tracker.assigned(1).tolist() == [1]
    with pytest.warns(DeprecationWarning, match="is now called reset"):
        tracker.begin_anew(-5.0)
    assert tracker.num_tracks == 0
