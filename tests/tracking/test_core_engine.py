"""The core's step against the reference in NumPy: the same tracks, step by step, over drawn streams."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph import Tracker, Trajectories, load_config
from jeat_graph.cli.main import main
from jeat_graph.config.sensors import SensorConfig
from jeat_graph.core import tracking as compiled
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.smoothers.histories import Existence, Histories
from jeat_graph.smoothers.rows import Called, in_order
from jeat_graph.tracking.core_model import CoreModel
from jeat_graph.tracking.engine import StepInput
from jeat_graph.tracking.model_tracker import ModelTracker
from jeat_graph.tracking.one_model import row_output
from jeat_graph.tracking.reference_model import ReferenceModel

#: Where doubles of one order of operations differ from those of another, by condition.
_RELATIVE = 1e-8


def drawn_stream(seed, sensors, times, motions=False):
    """Scans of any sensors: objects that move, clutter, second boxes, empty scans, a camera that shakes."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(0, 25))
    place, speed = rng.uniform(0, 1500, (count, 2)), rng.normal(0, 120, (count, 2))
    size = rng.uniform(10, 150, (count, 2))
    rate, noise, p_detect = rng.uniform(5, 60), rng.uniform(0, 0.08, sensors), rng.uniform(0.3, 1, sensors)
    clutter, shift = (
        rng.uniform(0, 4, sensors),
        rng.normal(0, rng.choice([0.0, 6.0]), (times, 2)).cumsum(axis=0),
    )
    t = rng.uniform(-5, 1e4)
    for k in range(times):
        t += rng.choice(
            [0.0, 1.0 / rate, 1.0 / rate, 3.0 / rate, 40.0 / rate], p=[0.05, 0.4, 0.4, 0.13, 0.02]
        )
        looks = rng.random(sensors) < 0.7
        looks[rng.integers(sensors)] = True
        looking = np.flatnonzero(looks)
        boxes, numbers = [], []
        for s in looking:
            seen = rng.random(count) < p_detect[s]
            wide = size[seen] * np.exp(rng.normal(0, noise[s], (seen.sum(), 2)))
            corner = (place + speed * k / rate + shift[k])[seen] - wide / 2
            corner += rng.normal(0, noise[s], corner.shape) * size[seen]
            stray = rng.uniform(0, 1500, (rng.poisson(clutter[s]), 2))
            one = np.concatenate([corner, corner + wide], axis=1)
            # Each is apart by an offset of its own: with one for all, the best assignment may be a tie.
            second = one[: count // 4] + rng.uniform(5.0, 7.0, (len(one[: count // 4]), 1))
            one = np.concatenate([one, np.concatenate([stray, stray + 40], axis=1), second])
            boxes.append(one)
            numbers.append(len(one))
        together = np.concatenate([*boxes, np.zeros((0, 4))])
        logits = rng.normal(1, 2, len(together))
        scan = float(t), looking.astype(np.int64), np.array(numbers, dtype=np.int64), together, logits
        if not motions:
            yield scan
            continue
        motion = np.concatenate(
            [[1.5 / rate], rng.uniform(0, 1500, 2), rng.normal(0, 6, 2), rng.normal(0, 0.01, 2)]
        )
        motion = np.concatenate([motion, rng.uniform(0, 1, 2), rng.uniform(0, 1e-5, 2)])
        yield *scan, None, motion if rng.random() < 0.6 else None


def models(smoother, known, **changes):
    settings = [f"smoother.{one}" for one in smoother.split()]
    config = load_config("default", [*settings, "image={width: 1600, height: 1200}"] if known else settings)
    return [make(ModelConstants(**changes), config) for make in (CoreModel, ReferenceModel)]


def step_input(t, sensors, numbers, sides, logits, similarity=None, motion=None, box_std=None):
    """Return a drawn scan as engines take it."""
    boxes = np.concatenate([sides[:, :2], sides[:, 2:] - sides[:, :2]], axis=1)
    scores = 1.0 / (1.0 + np.exp(-logits))
    return StepInput(t, sensors, numbers, boxes, scores, similarity, motion, box_std=box_std)


def drawn_std(rng, sides):
    """Standard deviations of sides: from exact to useless, some unknown; or None, as of a scan without."""
    if rng.random() < 0.2:
        return None
    size = np.tile(sides[:, 2:] - sides[:, :2], 2)
    found = size * np.exp(rng.normal(np.log(0.06), 1.2, size.shape))
    return np.where(rng.random(size.shape) < 0.15, np.nan, found)


def declare(model, kind=None):
    model.declare_sensor("any", SensorConfig(kind=kind))


def assert_alike(one, other, what, atol=_RELATIVE):
    """Assert that two tables (t, id, mean, variance, posterior, sensors) have the same rows."""
    for k in (0, 1, 5):
        np.testing.assert_array_equal(one[k], other[k], err_msg=what)
    scale = np.sqrt(other[3])
    np.testing.assert_allclose((one[2] - other[2]) / scale, 0.0, atol=atol, err_msg=what)
    np.testing.assert_allclose(one[3], other[3], rtol=atol, err_msg=what)
    np.testing.assert_allclose(one[4], other[4], atol=_RELATIVE, err_msg=what)


@given(
    seed=st.integers(0, 10**6),
    sensors=st.integers(1, 4),
    known=st.booleans(),
    motions=st.booleans(),
    spreads=st.booleans(),
)
def test_every_step_is_the_references(seed, sensors, known, motions, spreads):
    core, reference = models("engine=none", known)
    rng = np.random.default_rng(seed)
    for number in range(sensors):
        kind = (None, "event", "camera", "other")[(seed + number) % 4]
        declare(core, kind)
        declare(reference, kind)
    for k, scans in enumerate(drawn_stream(seed, sensors, 25, motions)):
        inputs = step_input(*scans, box_std=drawn_std(rng, scans[3]) if spreads else None)
        core.take(inputs)
        core.hand_over()
        reference.take(inputs)
        reference.hand_over()
        assert_alike(core.rows(), reference.rows(), f"step {k}")
        np.testing.assert_array_equal(core.assigned(), reference.assigned())
        np.testing.assert_array_equal(core.living(), reference.living())
        assert core.size() == reference.size()
        np.testing.assert_allclose(core.fit()[1], reference.fit()[1], rtol=_RELATIVE, err_msg=f"step {k}")
    ours, theirs = core.learnt(), reference.learnt()
    ours, theirs = ({**one.belief._asdict(), **one._asdict()} for one in (ours, theirs))
    for name in theirs.keys() - {"belief"}:
        value = theirs[name]
        np.testing.assert_allclose(ours[name], value, rtol=_RELATIVE, atol=_RELATIVE, err_msg=name)


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10**6), motions=st.booleans())
def test_whole_tracks_are_smoothed_as_by_the_reference(seed, motions):
    core, reference = models("engine=full", True)
    for model in (core, reference):
        declare(model)
        declare(model)
        for scans in drawn_stream(seed, 2, 40, motions):
            model.take(step_input(*scans))
            model.hand_over()
    ours, theirs = sorted_rows(core.finish()), sorted_rows(reference.finish())
    # A pass backwards solves with covariances whose condition is 1e10 and more after long gaps, and each
    # subtracts what is nearly equal in an order of its own: of a variance three digits are sure.
    assert_alike(ours, theirs, "smoothed", atol=1e-3)


@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 10**6), motions=st.booleans(), lag=st.sampled_from([math.inf, 0.4, 2.0]))
def test_the_cores_smoother_is_the_one_in_numpy_over_its_records(seed, motions, lag):
    smoother = "engine=full" if math.isinf(lag) else f"engine=fixed-lag lag_s={lag}"
    core, recorder = models(smoother, True)[0], models(smoother, True)[0]
    ours = Histories(lag, Existence(ModelConstants()), row_output(ModelConstants()))
    for _ in range(2):
        declare(core)
        declare(recorder)
    for scan in drawn_stream(seed, 2, 30, motions):
        core.take(step_input(*scan))
        core.hand_over()
        recorder.take(step_input(*scan))
        record = recorder.step_record(recorder.record())
        ours.take(record, [Called(track) for track in record.track_id.tolist()])
    found, wanted = in_order(ours.finish()), in_order(core.finish())
    for k in (0, 1, 5, 6, 7):
        np.testing.assert_array_equal(found[k], wanted[k])
    np.testing.assert_allclose((found[2] - wanted[2]) / np.sqrt(wanted[3]), 0.0, atol=1e-9)
    np.testing.assert_allclose(found[3], wanted[3], rtol=1e-9)
    np.testing.assert_allclose(found[4], wanted[4], rtol=1e-12)


@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 10**6), lag=st.sampled_from([math.inf, 0.4]))
def test_states_that_are_forgotten_change_no_row_behind_them(seed, lag):
    """In the core and in NumPy."""
    rng, c = np.random.default_rng(seed), ModelConstants()
    smoother = "engine=full" if math.isinf(lag) else f"engine=fixed-lag lag_s={lag}"
    core, whole = models(smoother, True)[0], models(smoother, True)[0]
    ours, until, told = Histories(lag, Existence(c), row_output(c)), {}, []
    for _ in range(2):
        declare(core)
        declare(whole)
    for scan in drawn_stream(seed, 2, 40):
        for model in (core, whole):
            model.take(step_input(*scan))
        record = core.record()
        step = core.step_record(record)
        ours.take(step, [Called(track) for track in step.track_id.tolist()])
        core.hand_over(record)
        whole.hand_over()
        if rng.random() < 0.3:
            some = [k for k in core.identities().tolist() if rng.random() < 0.4 and k not in until]
            t = step.t - rng.uniform(0.0, 0.5)
            until |= dict.fromkeys(some, t)
            told.append(len(some))
            core.forget(np.array(some, dtype=np.int64), np.full(len(some), t))
            ours.forget(dict.fromkeys(some, t))
    found, numpy, wanted = (in_order(one.finish()) for one in (core, ours, whole))
    assert sum(told) > 3
    for k in (0, 1, 5, 6, 7):
        np.testing.assert_array_equal(numpy[k], found[k])
    np.testing.assert_allclose((numpy[2] - found[2]) / np.sqrt(found[3]), 0.0, atol=1e-9)
    if math.isinf(lag):  # else a window begins where its track's states do, and so ends later
        limit = np.array([until.get(track, -math.inf) for track in wanted[1].tolist()])
        for one, other in zip(found, wanted, strict=True):
            np.testing.assert_array_equal(one, other[wanted[0] > limit])


def sorted_rows(rows):
    order = np.lexsort((rows[1], rows[0]))
    return [column[order] for column in rows]


def test_a_sensor_may_come_later():
    core, reference = models("engine=none", True)
    for model in (core, reference):
        declare(model)
    scans = list(drawn_stream(3, 1, 10))
    for k, scan in enumerate(scans):
        if k == 5:
            declare(core)
            declare(reference)
        core.take(step_input(*scan))
        reference.take(step_input(*scan))
        assert_alike(core.rows(), reference.rows(), f"step {k}")


def test_what_does_not_fit_is_refused_and_not_read():
    core = compiled.Model(ModelConstants(), 1600.0, 1200.0, True, -1.0)
    core.declare_sensor()
    none, one = np.zeros(0, np.int64), np.ones(1, np.int64)
    with pytest.raises(ValueError, match="no such sensor"):
        core.take(0.0, one, one, np.zeros((1, 4)), np.zeros(1))
    with pytest.raises(ValueError, match="different lengths"):
        core.take(0.0, none, one, np.zeros((1, 4)), np.zeros(1))
    with pytest.raises(ValueError, match="fewer boxes"):
        core.take(0.0, 0 * one, 5 * one, np.zeros((1, 4)), np.zeros(1))
    with pytest.raises(ValueError, match="more boxes"):
        core.take(0.0, 0 * one, 0 * one, np.zeros((1, 4)), np.zeros(1))
    with pytest.raises(TypeError):
        core.take(0.0, 0 * one, one, np.zeros((1, 4), np.float32), np.zeros(1))


# As a tracker.


def moving(times=200, period=0.05):
    rng = np.random.default_rng(2)
    for k in range(times):
        t = k * period
        boxes = [[100 + 80 * t, 200, 60, 40], [900 - 50 * t, 500, 90, 60], [400, 300 + 20 * t, 50, 50]]
        yield t, "cam", np.array(boxes) + rng.normal(0, 1, (3, 4)), [0.9, 0.8, 0.85]


def test_rows_with_a_lag_are_final_when_they_are_given_and_near_those_of_whole_tracks():
    config = load_config("default", ["smoother.lag_s=1"])
    whole = Tracker(load_config("default", ["smoother.engine=full"]), image=(1280, 720))
    live, parts = Tracker(config, image=(1280, 720)), []
    for scan in moving():
        live.step(scan)
        whole.step(scan)
        parts.append(live.drain_smoothed())
        if len(parts[-1]):
            assert parts[-1].t.max() <= scan[0] - 1.0
    assert sum(map(len, parts)) > 400
    lagged = Trajectories.concatenate([*parts, live.finish()])
    full = whole.finish()
    order = np.lexsort((lagged.track_id, lagged.t))
    lagged = lagged.take(order)
    np.testing.assert_array_equal(lagged.t, full.t)
    np.testing.assert_array_equal(lagged.track_id, full.track_id)
    assert np.abs(lagged.boxes - full.boxes).max() < 1.0


def test_memory_of_a_fixed_lag_does_not_grow_with_time():
    live = Tracker(load_config("default", ["smoother.lag_s=.5"]), image=(1280, 720))
    sizes = []
    for scan in moving(600):
        live.step(scan)
        live.drain_smoothed()
        sizes.append(len(live.smoothed()))  # what is not final yet: two lags of three tracks at 20 Hz
    assert max(sizes[100:]) <= 3 * (2 * 0.5 * 20 + 2)


def test_the_configuration_chooses_the_engine_and_whoever_makes_the_tracker_has_the_last_word():
    assert isinstance(Tracker(), ModelTracker)
    assert Tracker(load_config("default", ["tracker.engine=reference"])).config.tracker.engine == "reference"
    assert Tracker("default", engine="reference").config.tracker.engine == "reference"
    assert Tracker("paper").config.tracker.engine == "paper"


def test_constants_are_taken_by_name():
    doubled = replace(ModelConstants(), report=0.999)
    careful = ModelTracker("default", constants=doubled, image=(1280, 720))
    usual = ModelTracker("default", image=(1280, 720))
    rows = [sum(len(made.step(scan)) for scan in moving(10)) for made in (careful, usual)]
    assert rows[0] < rows[1]


def test_commands_track_with_it(tmp_path):
    rows = [f"{t},{s},{x},{y},{w},{h},.9" for t, s, boxes, _ in moving(40) for x, y, w, h in boxes]
    source = tmp_path / "detections.csv"
    source.write_text("t,sensor,left,top,width,height,score\n" + "\n".join(rows) + "\n")
    out = tmp_path / "run"
    assert main(["track", str(source), "--image", "1280x720", "--out", str(out)]) == 0
    learnt = json.loads((out / "run.json").read_text())["learnt"]["cam"]
    assert learnt["p_detect"] > 0.9
    assert {path.name for path in out.iterdir()} >= {"causal.csv", "smoothed.csv"}


def test_the_reference_is_not_saved_and_says_so_in_one_line(tmp_path, capsys):
    source = tmp_path / "detections.csv"
    source.write_text("t,sensor,left,top,width,height,score\n0,cam,1,2,30,40,.9\n.1,cam,1,2,30,40,.9\n")
    how = ["--set", "tracker.engine=reference", "--image", "1280x720"]
    assert main(["track", str(source), *how, "--out", str(tmp_path / "run"), "--resume"]) == 2
    assert "tracker.engine" in capsys.readouterr().err.splitlines()[-1]


def test_batch_tracks_with_it(tmp_path):
    rows = [f"{t},{s},{x},{y},{w},{h},.9" for t, s, boxes, _ in moving(20) for x, y, w, h in boxes]
    source = tmp_path / "detections.csv"
    source.write_text("t,sensor,left,top,width,height,score\n" + "\n".join(rows) + "\n")
    manifest = tmp_path / "manifest.csv"
    manifest.write_text(f"name,detections\none,{source}\n")
    how = ["--image", "1280x720"]
    assert main(["batch", str(manifest), *how, "--out", str(tmp_path / "runs")]) == 0
    assert (tmp_path / "runs" / "runs" / "one" / "causal.csv").is_file()
