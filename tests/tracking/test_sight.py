"""Sensors that find nothing at all: blind from the start, or for a while; a good one beside them goes on."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.eval.metrics import evaluate
from jeat_graph.tracking.tracker import Tracker
from jeat_graph.tracking.whole import track
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.simulate import simulate

RATE_HZ = 20.0
WITHOUT = "lifecycle.sight_scans=0"
NOTHING = (np.zeros((0, 4)), np.zeros(0))
NEARLY = (np.array([[0.0, 1.0, 1280.0, 690.0]]), np.ones(1))
WHOLE_PICTURE = (np.array([[0.0, 0.0, 1280.0, 720.0]]), np.ones(1))


def follow(blind, vehicles=6, seconds=12.0, shows=NOTHING, overrides=()):
    """Two sensors on cars that drive side by side; `other` shows only `shows` where `blind(t)`."""
    rng = np.random.default_rng(5)
    declared = [f"sensors.{name}={{rate_hz: {RATE_HZ}}}" for name in ("good", "other")]
    config = load_config("default", [*declared, "smoother.engine=none", *overrides])
    tracker = Tracker(config, image=(1280, 720))
    tables, states = [], []
    for k in range(int(seconds * RATE_HZ)):
        t = k / RATE_HZ
        cars = np.array([[50.0 + 60.0 * t, 40.0 + 100.0 * i, 70.0, 45.0] for i in range(vehicles)])
        for name, late in (("other", 0.0), ("good", 0.01)):
            seen = cars[rng.random(vehicles) < 0.9]
            boxes, scores = seen + rng.normal(0.0, 1.0, seen.shape), np.full(len(seen), 0.9)
            if name == "other" and blind(t):
                boxes, scores = shows
            table = tracker.step((t + late, name, boxes, scores))
        tables.append(table)
        states.append(tracker.sensor_states())
    return tables, states


@pytest.mark.parametrize(
    "shows", [NOTHING, WHOLE_PICTURE, NEARLY], ids=["nothing", "the whole picture", "nearly all of it"]
)
def test_a_sensor_that_never_finds_anything_takes_no_track(shows):
    tables, states = follow(lambda t: True, shows=shows)
    assert np.mean([len(table) for table in tables[20:]]) > 5.0
    assert states[-1]["other"].blind > 0.99
    assert states[-1]["good"].blind < 0.01


def test_without_a_common_cause_of_misses_it_takes_them_all():
    """What the chain is for: the same recording, misses taken as independent."""
    tables, states = follow(lambda t: True, overrides=[WITHOUT])
    assert np.mean([len(table) for table in tables[20:]]) < 3.0
    assert states[-1]["other"].blind == 0.0


def test_one_that_goes_blind_for_five_seconds_costs_no_identity_and_is_back_at_once():
    tables, states = follow(lambda t: 4.0 <= t < 9.0)
    ids = [set(table.track_id.tolist()) for table in tables]
    assert np.mean([len(one) for one in ids[80:180]]) > 5.0
    assert set().union(*ids[20:]) == set().union(*ids[20:80])
    assert all(one["other"].blind > 0.99 for one in states[85:120])
    # The cars drive on beyond where it has ever found one: it may also not look there.
    assert all(one["other"].blind > 0.8 for one in states[120:180])
    assert all(one["other"].blind < 0.01 for one in states[182:])
    before, after = states[78]["other"], states[181]["other"]
    assert after.p_detect == pytest.approx(before.p_detect, abs=0.05)
    assert after.trust == pytest.approx(before.trust, abs=0.2)


def test_where_every_sensor_sees_none_is_held_to_be_blind():
    _, states = follow(lambda t: False)
    assert all(one[name].blind < 0.02 for one in states[3:] for name in ("good", "other"))


def test_a_sensor_that_looks_alone_is_taken_to_see_and_its_misses_count():
    """Nobody could tell; what it has ever seen may have been nothing."""
    tracker = Tracker(load_config("default", ["smoother.engine=none"]), image=(1280, 720))
    boxes = np.array([[200.0 * i + 100.0, 300.0, 60.0, 40.0] for i in range(5)])
    for k in range(40):
        seen = (boxes, np.full(5, 0.9)) if k < 20 else NOTHING
        tracker.step((k / 20.0, "rgb", *seen))
    assert tracker.sensor_states()["rgb"].blind == 0.0
    assert (tracker.snapshot().tracks.existence < 0.5).all()


def test_false_tracks_of_one_sensor_still_die_by_its_own_misses():
    """Nothing is there any more: that both find nothing does not keep tracks alive."""
    config = load_config("default", ["smoother.engine=none"])
    tracker = Tracker(config, image=(1280, 720))
    box = np.array([[400.0, 300.0, 60.0, 40.0]])
    for k in range(200):
        seen = (box, np.array([0.9])) if k < 20 else NOTHING
        tracker.step((k / 20.0, "rgb", *seen))
        tracker.step((k / 20.0 + 0.01, "evt", *NOTHING))
    assert tracker.num_tracks == 0


def with_empty_scans(seen: Detections, rate_hz: float) -> Detections:
    """The same with a second sensor that looks and finds nothing."""
    times = np.arange(0.003, float(seen.scan_t[-1]), 1.0 / rate_hz)
    empty = [Scan(float(t), "evt", *NOTHING) for t in times]
    return Detections.from_scans(sorted([*seen.scans(), *empty], key=lambda scan: scan.t))


def mota(config, seen, truth, instants):
    return evaluate([(truth, track(config, seen))], kind="causal", instants=[instants]).as_dict()["MOTA"]


@pytest.mark.parametrize("preset", ["default", "highway"])
def test_empty_scans_beside_a_good_sensor_cost_less_than_half_a_point(preset, full):
    """Three seeds (five in the long form), the mean over them and each by itself."""
    config = load_config(preset, ["smoother.engine=none"])
    alone, beside = [], []
    for seed in range(5 if full else 3):
        detections, truth = simulate(load_scenario("day"), seed=seed, duration_s=30.0 if full else 3.0)
        seen = detections.select(["rgb"])
        # What the other sensor reports in between is not judged: the question is what the tracks suffer.
        instants = np.unique(seen.scan_t)
        alone.append(mota(config, seen, truth, instants))
        beside.append(mota(config, with_empty_scans(seen, 100.0), truth, instants))
    assert np.mean(beside) >= np.mean(alone) - 0.5
    assert min(np.subtract(beside, alone)) >= -0.5


def test_the_chain_goes_on_after_a_checkpoint(tmp_path):
    tracker = Tracker(load_config("default", ["smoother.engine=none"]), image=(1280, 720))
    rng = np.random.default_rng(0)
    boxes = np.column_stack([rng.uniform(100, 600, (5, 2)), np.full((5, 2), 50.0)])
    for k in range(20):
        tracker.step((k / 20.0, "rgb", boxes + 2.0 * k, np.full(5, 0.9)))
        tracker.step((k / 20.0 + 0.01, "evt", *NOTHING))
    tracker.save(tmp_path / "state.npz")
    again = Tracker.load(tmp_path / "state.npz")
    assert again.sensor_states() == tracker.sensor_states()
    assert again.sensor_states()["evt"].blind > 0.5


@pytest.mark.parametrize("preset", ["default", "highway", "sehn"])
@pytest.mark.parametrize(("rate_hz", "speed"), [(10.0, 60.0), (20.0, 30.0), (100.0, 60.0)])
@pytest.mark.parametrize("dark", [False, True])
def test_events_alone_make_tracks_of_what_moves(preset, rate_hz, speed, dark):
    """A new track's speed is not known, which is not to stand still; a camera in the dark does not help."""
    tracker = Tracker(
        load_config(preset, ["smoother.engine=none", f"sensors.evt.rate_hz={rate_hz}"]), image=(640, 480)
    )
    rng, rows = np.random.default_rng(2), 0
    for k in range(100):
        boxes = np.array([[20.0 + speed * k / rate_hz, 20.0 + 60.0 * v, 60.0, 40.0] for v in range(2)])
        boxes[:, :2] += rng.standard_normal((2, 2))
        if dark:
            tracker.update(np.zeros((0, 4)), t=k / rate_hz, sensor="rgb")
        rows += len(tracker.update(boxes, t=k / rate_hz, sensor="evt", scores=[0.9, 0.9]))
    assert rows > (120 if dark else 160)
    assert tracker.num_born <= 3 or dark
