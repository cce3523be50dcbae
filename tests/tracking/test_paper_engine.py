"""The engine `paper` is the paper's algorithm 1: the same tracks and states as a plain reading of it."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from jeat_graph import Tracker, load_config
from jeat_graph.config.paper import PaperConfig
from jeat_graph.data.errors import ConfigError, DataError, JeatGraphError, TimeOrderError, UnknownSensorError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.paper import kalman
from jeat_graph.tracking.paper.association import Pairs, match, second_views

# The scene's vehicles leave the picture whose size the recorded runs had.
pytestmark = pytest.mark.filterwarnings("ignore:.*box centres lie outside the picture")
GOLDEN = np.load(Path(__file__).parent / "paper_golden.npz")
#: What was recorded of the compiled engine that the paper's method had before: scene and every which step.
RECORDED = {"jitter": ({"seed": 11, "duration": 2.0, "jitter": 0.004}, 6)}
RECORDED["crowd"] = ({"seed": 5, "duration": 2.0, "vehicles": 12, "evt_hz": 20.0, "clutter": 2.0}, 3)


def run_both(oracle, batches):
    """Step both through the batches and compare after each; returns the number of rows compared."""
    config = load_config("paper", ["smoother.engine=none"])
    tracker = Tracker(config)
    reference = oracle.PaperTracker(
        sigma={name: sensor.sigma_px for name, sensor in config.sensors.items()},
        jerk=config.paper.jerk_px,
        velocity_std=config.paper.velocity_std_px,
        acceleration_std=config.paper.acceleration_std_px,
        gate_probability=config.paper.gate_probability,
    )
    identity, compared = {}, 0
    for t, scans in batches:
        table = tracker.step([(t, *scan) for scan in scans])
        reference.step(
            t,
            [
                (box[:2] + box[2:] / 2, score, sensor)
                for sensor, boxes, scores in scans
                for box, score in zip(boxes, scores, strict=True)
            ],
        )
        now = tracker.snapshot().moment.tracks
        assert tracker.num_tracks == len(reference.tracks), f"at t = {t}"
        for track in reference.tracks:  # births of one batch may be numbered in any order
            if id(track) not in identity:
                new = np.abs(now.mean[:, :, 0] - track.x[:2]).sum(axis=1) + 1e9 * (now.t_birth < t)
                identity[id(track)] = (now.track_id[np.argmin(new)], track)
        reference.tracks.sort(key=lambda track: identity[id(track)][0])
        assert [identity[id(track)][0] for track in reference.tracks] == now.track_id.tolist()
        compare(reference.tracks, now, tracker.engine_sensors)
        confirmed = [track for track in reference.tracks if track.confirmed]
        assert np.allclose(table.mean, np.array([r.x for r in confirmed]).reshape(-1, 6), atol=1e-6)
        assert table.track_id.tolist() == [identity[id(r)][0] for r in confirmed]
        compared += len(confirmed)
    return compared


def compare(expected, now, sensor_names):
    if not expected:
        return
    n = len(expected)
    x, P = np.array([track.x for track in expected]), np.array([track.P for track in expected])
    assert np.allclose(np.swapaxes(now.mean, 1, 2).reshape(n, 6), x, rtol=1e-9, atol=1e-6)
    full = np.zeros((n, 6, 6))
    for axis in range(2):
        full[:, axis::2, axis::2] = now.cov
    spread = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    assert np.abs((full - P) / (spread[:, :, None] * spread[:, None, :])).max() < 1e-6
    scale = [[track.scale[name] for name in sensor_names] for track in expected]
    assert np.allclose(now.scale, scale, rtol=1e-8)
    for name in ("hits", "confirmed", "t_update"):
        assert getattr(now, name).tolist() == [getattr(track, name) for track in expected]


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_same_tracks_as_the_paper_with_two_sensors_and_coincident_times(oracle, scene, seed):
    assert run_both(oracle, scene(seed, duration=1.5)) > 500


def test_same_tracks_as_the_paper_with_jittered_times(oracle, scene):
    assert run_both(oracle, scene(11, duration=1.5, jitter=0.004)) > 500


def test_same_tracks_as_the_paper_in_a_crowd_where_gates_overlap(oracle, scene):
    batches = scene(5, duration=1.0, vehicles=12, evt_hz=20.0, clutter=2.0)
    small = [
        (t, [(name, boxes * [0.25, 0.25, 1, 1], scores) for name, boxes, scores in scans])
        for t, scans in batches
    ]
    assert run_both(oracle, small) > 100


def test_same_tracks_as_the_paper_where_tracks_end_after_gaps(oracle, scene):
    batches = [(t, scans) for t, scans in scene(7, duration=2.5) if (t % 1.0) < 0.65 or t > 2.0]
    assert run_both(oracle, batches) > 500


def test_same_tracks_as_the_paper_with_one_sensor_only(oracle, scene):
    batches = [
        (t, [scan for scan in scans if scan[0] == "rgb"])
        for t, scans in scene(9, duration=2.0)
        if any(scan[0] == "rgb" for scan in scans)
    ]
    run_both(oracle, batches)


def recorded_run(scene, tag, engine="full"):
    """Run a recorded scene; returns the causal table at the recorded steps, the smoothed one, the births."""
    (arguments, every) = RECORDED[tag]
    tracker = Tracker(load_config("paper", [f"smoother.engine={engine}"]))
    tables = [tracker.step([(t, *scan) for scan in scans]) for t, scans in scene(**arguments)]
    return Trajectories.concatenate(tables[::every]), tracker.finish(), tracker.num_born


def same_rows(table, kind, relative):
    """Compare a table with the recorded rows, each with the nearest of its time; identities one to one."""
    names = ("t", "id", "boxes", "mean", "var", "used")
    t, identity, boxes, mean, var, used = (GOLDEN[f"{kind}_{name}"] for name in names)
    seen = {}
    for k in range(len(t)):
        rows = np.flatnonzero(table.t == t[k])
        row = rows[np.argmin(np.abs(table.mean[rows, :4] - mean[k]).sum(axis=1))]
        assert seen.setdefault(int(table.track_id[row]), int(identity[k])) == int(identity[k])
        assert table.used[row] == used[k]
        for found, expected in ((table.boxes, boxes), (table.mean[:, :4], mean), (table.var[:, ::2], var)):
            assert found[row] == pytest.approx(expected[k], rel=relative, abs=1e-4 * relative / 1e-6)
    assert len(set(seen.values())) == len(seen)


@pytest.mark.parametrize("tag", RECORDED)
def test_the_causal_table_is_that_of_the_compiled_engine_before(scene, tag):
    causal, _, born = recorded_run(scene, tag)
    assert len(causal) == len(GOLDEN[f"{tag}_causal_t"])
    assert born == int(GOLDEN[f"{tag}_born"])
    same_rows(causal, f"{tag}_causal", 1e-6)


@pytest.mark.parametrize("tag", RECORDED)
@pytest.mark.parametrize("engine", ["full"])
def test_the_table_of_whole_tracks_is_that_of_the_compiled_engine_before(scene, tag, engine):
    _, smoothed, _ = recorded_run(scene, tag, engine)
    assert (len(smoothed) + 7) // 8 == len(GOLDEN[f"{tag}_smoothed_t"])
    same_rows(smoothed, f"{tag}_smoothed", 1e-6)


# The parts, each beside a closed form or a search through everything.


@given(st.floats(1e-4, 2.0), st.floats(1e-4, 2.0), st.floats(0.1, 1e3))
def test_two_predictions_are_one_over_both_times(first, second, jerk):
    F1, Q1 = kalman.motion_model(first, jerk)
    F2, Q2 = kalman.motion_model(second, jerk)
    F, Q = kalman.motion_model(first + second, jerk)
    assert np.allclose(F2 @ F1, F, rtol=1e-12)
    assert np.allclose(F2 @ Q1 @ F2.T + Q2, Q, rtol=1e-9)
    G1, R1 = kalman.size_model(first, jerk)
    G2, R2 = kalman.size_model(second, jerk)
    assert np.allclose(G2 @ R1 @ G2.T + R2, kalman.size_model(first + second, jerk)[1], rtol=1e-9)
    assert G1[0, 1] == first


@given(st.integers(0, 10**6))
def test_an_update_is_the_joseph_form(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3))
    P, m, z, R = root @ root.T + np.eye(3), rng.normal(size=(2, 3)), rng.normal(size=2), rng.uniform(0.1, 9)
    mean, cov, nis = kalman.correct(m[None], P[None], z[None], np.array([R]))
    K = P[:, :1] / (P[0, 0] + R)
    left = np.eye(3) - K @ np.eye(3)[:1]
    assert np.allclose(cov[0], left @ P @ left.T + R * K @ K.T, rtol=1e-9, atol=1e-9)
    assert np.allclose(mean[0], m + (z - m[:, 0])[:, None] * K.T)
    assert nis[0] == pytest.approx(((z - m[:, 0]) ** 2).sum() / (P[0, 0] + R))
    assert (np.linalg.eigvalsh(cov[0]) > 0).all()


@pytest.mark.parametrize(
    ("scale", "nis", "after"), [(1.0, 2.0, 1.0), (1.0, 4.0, 1.1), (0.5, 0.0, 0.5), (4.9, 99.0, 5.0)]
)
def test_the_noise_follows_equation_6(scale, nis, after):
    found = kalman.adapted(np.array([scale]), np.array([nis]), PaperConfig())
    assert found[0] == pytest.approx(after)


def pairs_of(d2, gate):
    row, column = np.nonzero(d2 <= gate)
    return Pairs(row, column, d2[row, column])


@given(st.integers(0, 10**6), st.integers(1, 9), st.integers(1, 9))
def test_the_assignment_is_the_hungarian_algorithms_with_infinite_entries(seed, n, m):
    d2, gate = np.random.default_rng(seed).uniform(0, 40, (n, m)), 9.2
    row, column = match(pairs_of(d2, gate), gate)
    cost = np.where(d2 <= gate, d2, 1e6)
    i, j = linear_sum_assignment(cost)
    assert len(row) == (cost[i, j] < 1e6).sum()
    assert d2[row, column].sum() == pytest.approx(cost[i, j][cost[i, j] < 1e6].sum())
    assert (d2[row, column] <= gate).all()
    assert len(set(row)) == len(set(column)) == len(row)
    assert (np.diff(row) > 0).all()


@given(st.integers(0, 10**6), st.integers(1, 7), st.integers(1, 7))
def test_second_views_are_those_of_the_tracks_in_turn(seed, n, m):
    d2, gate = np.random.default_rng(seed).uniform(0, 20, (n, m)), 9.2
    expected, free = [], set(range(m))
    for i in range(n):
        inside = [(d2[i, j], j) for j in free if d2[i, j] <= gate]
        if inside:
            expected.append((i, min(inside)[1]))
            free.remove(min(inside)[1])
    row, column = second_views(pairs_of(d2, gate))
    assert list(zip(row.tolist(), column.tolist(), strict=True)) == expected


# The lifecycle.


def at(t, x, score=1.0, sensor="rgb"):
    return (t, sensor, [[x - 10.0, 90.0, 20.0, 20.0]], [score])


def test_confirmed_after_half_a_second_and_five_hits_not_before():
    tracker = Tracker("paper")
    reported = {k: len(tracker.step(at(k * 0.0625, 100.0))) for k in range(12)}
    assert [k for k, rows in reported.items() if rows] == [8, 9, 10, 11]  # 8 * 0.0625 = 0.5 s


def test_half_a_second_without_five_hits_does_not_confirm():
    tracker = Tracker("paper")
    assert [len(tracker.step(at(k * 0.1875, 100.0))) for k in range(6)] == [0, 0, 0, 0, 1, 1]


def test_deleted_only_later_than_the_longest_gap():
    for scans, gap in ((1, 0.2), (12, 0.5)):
        tracker = Tracker("paper")
        for k in range(scans):
            last = k * 0.0625
            tracker.step(at(last, 100.0))
        tracker.step((last + gap - 1e-6, "rgb", [], []))
        assert tracker.num_tracks == 1
        tracker.step((last + gap + 1e-6, "rgb", [], []))
        assert tracker.num_tracks == 0


def test_a_coasting_confirmed_track_is_reported_as_long_as_it_lives():
    tracker = Tracker("paper")
    for k in range(12):
        tracker.step(at(k * 0.0625, 100.0))
    assert len(tracker.step((0.0625 * 11 + 0.49, "evt", [], []))) == 1


def test_every_leftover_starts_a_track_even_on_top_of_another():
    tracker = Tracker("paper")
    tracker.step((0.0, "rgb", [[0, 0, 20, 20]] * 3, [1.0, 0.5, 0.0]))
    assert tracker.num_tracks == 3


def test_after_minutes_of_silence_all_tracks_are_over():
    tracker = Tracker("paper")
    for k in range(12):
        tracker.step(at(k * 0.0625, 100.0))
    tracker.step(at(1e6, 100.0))
    assert tracker.num_tracks == 1
    assert tracker.num_born == 2


# The interface.


def test_a_step_that_is_refused_leaves_everything_as_it_was(scene):
    tracker = Tracker(load_config("paper", ["input.undeclared=refuse"]))
    for t, scans in scene(0, duration=0.7):
        tracker.step([(t, *scan) for scan in scans])
    before, table = tracker.snapshot(), tracker.causal()
    with pytest.raises(TimeOrderError, match="older than the last"):
        tracker.step(at(0.1, 100.0))
    with pytest.raises(UnknownSensorError, match="radar"):
        tracker.step(at(9.0, 100.0, sensor="radar"))
    with pytest.raises(DataError):
        tracker.step((9.0, "rgb", [[0, 0, -1, 5]], [0.5]))
    with pytest.raises(DataError, match="embeddings"):
        tracker.step((9.0, "rgb", [[0, 0, 5, 5]], [0.5], None, [[1.0, 0.0]]))
    assert tracker.snapshot() == before
    assert np.array_equal(tracker.causal().boxes, table.boxes)


def test_going_back_to_a_snapshot_gives_the_same_again(scene):
    batches = [[(t, *scan) for scan in scans] for t, scans in scene(2, duration=1.6)]
    tracker = Tracker(load_config("paper", ["smoother.engine=none"]))
    for batch in batches[:80]:
        tracker.step(batch)
    before = tracker.snapshot()
    first = [tracker.step(batch) for batch in batches[80:]]
    tracker.restore(before)
    assert tracker.snapshot() == before
    for batch, expected in zip(batches[80:], first, strict=True):
        table = tracker.step(batch)
        assert np.array_equal(table.mean, expected.mean)
        assert np.array_equal(table.track_id, expected.track_id)


def test_a_prediction_is_the_step_that_finds_nothing(scene):
    tracker = Tracker("paper")
    for t, scans in scene(0, duration=0.9):
        tracker.step([(t, *scan) for scan in scans])
    said = tracker.predict(t + 0.1)
    assert len(said) > 0
    assert np.array_equal(np.diagonal(said.cov, axis1=1, axis2=2), said.var)
    seen = tracker.step((t + 0.1, "rgb", [], []))
    kept = np.isin(said.track_id, seen.track_id)
    assert np.allclose(said.mean[kept], seen.mean)
    assert np.allclose(said.var[kept], seen.var)
    with pytest.raises(TimeOrderError, match="past"):
        tracker.predict(t)


def test_a_sensor_that_is_met_is_declared_where_the_configuration_lets_it():
    tracker = Tracker(load_config("paper", ["input.undeclared=declare"]))
    for k in range(12):
        tracker.step(at(k * 0.0625, 100.0, sensor="rgb"))
    table = tracker.step(at(0.75, 100.0, sensor="lidar"))
    assert "lidar" in tracker.sensor_names
    assert table.sensor_text() == ["lidar"]
    assert tracker.sensor_states().keys() == {"rgb", "lidar"}


def test_classes_are_voted_for():
    tracker = Tracker("paper")
    for k in range(12):
        kind = "van" if k == 3 else "car"
        table = tracker.step((*at(k * 0.0625, 100.0), [kind]))
    assert table.classes.tolist() == ["car"]
    assert tracker.finish().classes.tolist() == ["car"] * 12


def test_boxes_are_clipped_where_that_is_asked_for():
    tracker = Tracker(load_config("paper", ["output.clip=true"]), image=(640, 480))
    for k in range(12):
        table = tracker.step(at(k * 0.0625, 0.0))
    left, _, width, _ = table.boxes[0]
    assert left == 0.0
    assert width == pytest.approx(10.0, abs=0.5)


def test_it_is_not_saved():
    tracker = Tracker("paper")
    assert not tracker.can_save
    with pytest.raises(JeatGraphError, match="not saved"):
        tracker.save("tracker.jeat")


def test_scales_that_exclude_each_other_are_an_error():
    with pytest.raises(ConfigError, match="scale_min"):
        load_config("paper", ["paper.scale_min=6"])
