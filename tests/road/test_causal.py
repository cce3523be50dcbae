"""The filter on the road: its arithmetic against dense matrices, and vehicles without their future."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from road_scenes import HEIGHT, WIDTH, camera
from scipy.linalg import expm

from jeat_graph.cli.main import main
from jeat_graph.core import road as core
from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.road.box_rows import LASTING_SHARE
from jeat_graph.road.causal import CalibrationShare, RoadFilter, RoadFilterConfig
from jeat_graph.road.cuboid import sides
from jeat_graph.road.road_state import AY, STATES, VX, VY, X, Y

SIZE = np.array([4.4, 1.8, 1.5])


def _covariance(rng: np.random.Generator) -> np.ndarray:
    A = rng.standard_normal((STATES, STATES))
    return A @ A.T + np.eye(STATES)


def test_prediction_is_the_linear_model() -> None:
    """Against the matrix exponential of the model, over a step so short that its second order tells."""
    rng, config, dt = np.random.default_rng(0), RoadFilterConfig(), 0.02
    A = np.zeros((STATES, STATES))
    A[X, VX] = A[Y, VY] = A[VY, AY] = 1.0
    A[VX, VX], A[AY, AY] = -1.0 / config.lateral_s, -1.0 / config.acceleration_s
    F = expm(A * dt)
    m, P = rng.standard_normal(STATES), _covariance(rng)
    got_m, got_P = m.copy(), P.copy()
    core.predict(got_m, got_P, dt, config)
    np.testing.assert_allclose(got_m, F @ m, atol=1e-9)
    noise = got_P - F @ P @ F.T
    spectral = np.zeros((STATES, STATES))
    spectral[AY, AY] = 2.0 * config.acceleration_std**2 / config.acceleration_s
    spectral[VX, VX] = 2.0 * config.lateral_std**2 / config.lateral_s
    block = np.block([[-A, spectral], [np.zeros_like(A), A.T]])
    lifted = expm(block * dt)
    Q = lifted[STATES:, STATES:].T @ lifted[:STATES, STATES:]
    np.testing.assert_allclose(noise, Q, atol=2e-4)
    assert np.linalg.eigvalsh(got_P).min() > 0


def test_a_box_updates_as_the_dense_formula() -> None:
    rng, cam = np.random.default_rng(1), camera()
    m = np.array([3.0, 0.2, 32.0, -20.0, 0.1, *SIZE])
    P = 0.01 * _covariance(rng)
    box, slope = sides(cam, m[[X, Y]][None], np.array([np.arctan2(0.2, -20.0)]), SIZE)
    left, top, right, bottom = box[0]
    expected = np.array([(left + right) / 2, (top + bottom) / 2, np.log(right - left), np.log(bottom - top)])
    J = slope[0]
    H5 = np.stack(
        [(J[0] + J[2]) / 2, (J[1] + J[3]) / 2, (J[2] - J[0]) / (right - left), (J[3] - J[1]) / (bottom - top)]
    )
    H = np.zeros((4, STATES))
    H[:, [X, Y, 5, 6, 7]] = H5
    R = np.array([1.0, 1.5, 4e-4, 5e-4])
    z = expected + 0.3 * np.sqrt(R) * rng.standard_normal(4)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.diag(R))
    got_m, got_P = m.copy(), P.copy()
    mode = np.zeros(2, dtype=np.int64)
    assert core.update(got_m, got_P, z, R, mode, RoadFilterConfig().gate, cam.compiled())
    np.testing.assert_allclose(got_m, m + K @ (z - expected), rtol=1e-8)
    np.testing.assert_allclose(got_P, P - K @ H @ P, rtol=1e-7, atol=1e-12)


def _log(rng: np.random.Generator, noise: float, number: int = 1, speed: float = -22.0) -> np.ndarray:
    t = np.arange(0.0, 1.6, 0.02)
    xy = np.c_[np.full(len(t), 3.0), 60.0 + speed * t]
    box, _ = sides(camera(), xy, np.zeros(len(t)), SIZE)
    box = box + noise * rng.standard_normal(box.shape)
    rows = np.zeros(len(t), dtype=MEASUREMENT)
    rows["t"], rows["track_id"], rows["sensor"] = t, number, 1
    rows["z"] = (box[:, :2] + box[:, 2:]) / 2.0
    extent = box[:, 2:] - box[:, :2]
    rows["log_size"] = np.log(extent)
    rows["r"] = max(noise, 0.3) ** 2 / 2.0
    rows["size_var"] = 2.0 * max(noise, 0.3) ** 2 / extent**2
    rows["scale"] = 1.0
    return rows


def _follow(rows: np.ndarray) -> list[tuple[float, float, float, float]]:
    road, found = RoadFilter(camera()), []
    for k in range(len(rows)):
        states = road.step(float(rows["t"][k]), rows[k : k + 1], np.array([rows["track_id"][k]]))
        columns = road.columns([states])
        if len(states):
            found.append(
                tuple(float(columns[name][0]) for name in ("y", "speed_kmh", "var_speed_kmh", "var_y"))
            )
    return found


def test_a_vehicle_is_where_it_is_and_as_fast_as_it_drives() -> None:
    found = _follow(_log(np.random.default_rng(2), 0.7))
    y, kmh, var, var_y = found[-1]
    assert y == pytest.approx(60.0 - 22.0 * 1.58, abs=4.0 * np.sqrt(var_y))
    assert kmh == pytest.approx(79.2, abs=4.0 * np.sqrt(var))
    assert np.sqrt(var) < 5.0


def test_a_speed_is_stated_once_it_is_known() -> None:
    """Before, the row has the place alone; from then on, a speed that is as good as it has to be."""
    found = np.array(_follow(_log(np.random.default_rng(5), 0.7)))
    known = np.isfinite(found[:, 1])
    assert np.isfinite(found[:, 0]).all()
    assert not known[0]
    assert known[-1]
    assert (np.diff(known.astype(int)) >= 0).all()
    assert np.isnan(found[~known, 2]).all()
    assert np.sqrt(found[known, 2].max()) <= RoadFilterConfig().known_kmh
    assert np.abs(found[known, 1] - 79.2).max() < 3.0 * RoadFilterConfig().known_kmh


def test_sensors_need_not_be_known_beforehand_and_their_noise_is_taken_as_it_is_recorded() -> None:
    """The number of a sensor is nothing to the road, and `scale` is in the variances already."""
    rows = _log(np.random.default_rng(5), 0.7)
    last, scaled = rows.copy(), rows.copy()
    last["sensor"], scaled["scale"] = 62, 0.2
    for other in (last, scaled):
        np.testing.assert_array_equal(_follow(rows), _follow(other))


def test_what_the_table_says_of_a_state_is_its_transform() -> None:
    """Speed, heading and their variances against derivatives by central differences of the whole state."""
    rng = np.random.default_rng(6)
    m, P = np.array([3.0, 1.2, 32.0, -20.0, 0.7, *SIZE]), 0.01 * _covariance(rng)

    def terms(state: np.ndarray) -> np.ndarray:
        vx, vy = state[VX], state[VY]
        speed = np.hypot(vx, vy)
        return np.array([state[X], state[Y], speed, np.arctan2(vx, vy), state[AY] * vy / speed, *state[5:]])

    slope = np.stack([(terms(m + e) - terms(m - e)) / 2e-5 for e in 1e-5 * np.eye(STATES)], axis=1)
    slope[4, [VX, VY]] = 0.0  # an acceleration's direction counts as known
    mean, var = core.road_terms(m[None], P[None])
    np.testing.assert_allclose(mean[0], terms(m), rtol=1e-12)
    np.testing.assert_allclose(var[0], np.diag(slope @ P @ slope.T), rtol=1e-6)


@given(
    st.floats(-60.0, 60.0).filter(lambda v: v == 0.0 or abs(v) > 1e-100),
    st.floats(-60.0, 60.0).filter(lambda v: v == 0.0 or abs(v) > 1e-100),
)
def test_a_heading_is_the_angle_of_the_velocity(vx: float, vy: float) -> None:
    state = np.zeros((1, STATES))
    state[0, [VX, VY]] = vx, vy
    heading = core.road_terms(state, np.zeros((1, STATES, STATES)))[0][0, 3]
    assert heading == pytest.approx(np.arctan2(vx, vy), rel=8e-16, abs=1e-300)
    assert np.signbit(heading) == np.signbit(vx)


def test_no_time_changes_nothing() -> None:
    m, P = np.arange(8.0), _covariance(np.random.default_rng(8))
    for dt in (0.0, -1.0):
        got_m, got_P = m.copy(), P.copy()
        core.predict(got_m, got_P, dt, RoadFilterConfig())
        np.testing.assert_array_equal(got_m, m)
        np.testing.assert_array_equal(got_P, P)


def test_a_box_behind_the_camera_leaves_the_state_as_it_was() -> None:
    m, P = np.array([3.0, 0.2, -32.0, -20.0, 0.1, *SIZE]), _covariance(np.random.default_rng(9))
    got_m, got_P = m.copy(), P.copy()
    mode = np.zeros(2, dtype=np.int64)
    assert not core.update(got_m, got_P, np.ones(4), np.ones(4), mode, 9.0, camera().compiled())
    np.testing.assert_array_equal(got_m, m)
    np.testing.assert_array_equal(got_P, P)


def test_a_track_without_a_box_is_forgotten_and_begins_anew() -> None:
    rows = _log(np.random.default_rng(10), 0.3)
    config = RoadFilterConfig(silence_s=0.5)
    road = RoadFilter(camera(), config)
    first = road.step(0.0, rows[:1], np.array([1]))
    assert len(first) == 1
    for k in range(1, 512):  # at the last of them it looks for such tracks, but it is not time yet
        road.step(0.0009 * k, rows[:0], np.array([1]))
    assert len(road.step(0.7, rows[:0], np.array([1]))) == 1
    for _ in range(511):
        road.step(0.7, rows[:0], np.array([1]))
    assert not len(road.step(0.7, rows[:0], np.array([1])))
    assert road.step(0.8, rows[:1], np.array([1]))["mean"].tobytes() == first["mean"].tobytes()


def test_boxes_that_come_at_once_tell_nothing_new() -> None:
    """Leaving out those within a share of their errors' memory changes little where these last."""
    rows = _log(np.random.default_rng(7), 0.7)
    lasting = LASTING_SHARE * rows["r"]
    rows["coloured_std"], rows["r"] = np.sqrt(lasting), rows["r"] - lasting
    final = {}
    for pause in (0.0, RoadFilterConfig().pause):
        road = RoadFilter(camera(), RoadFilterConfig(pause=pause))
        for k in range(len(rows)):
            states = road.step(float(rows["t"][k]), rows[k : k + 1], rows["track_id"][k : k + 1])
        final[pause] = states[0]
    spread = np.sqrt(final[0.0]["var"])
    off = final[RoadFilterConfig().pause]["mean"] - final[0.0]["mean"]
    off[3] = (off[3] + np.pi) % (2.0 * np.pi) - np.pi  # the heading
    assert (np.abs(off) < spread).all()
    np.testing.assert_allclose(np.sqrt(final[RoadFilterConfig().pause]["var"]), spread, rtol=0.2)


def test_tracks_are_kept_in_order_whenever_they_begin() -> None:
    """A track that is older than others but stands on the road later than they."""
    road = RoadFilter(camera())
    logs = {n: _log(np.random.default_rng(n), 0.3, number=n) for n in (2, 7, 5)}
    for k in range(2, 40):
        rows = np.concatenate([logs[n][k : k + 1] for n in (2, 7, 5) if k >= n])
        ids = np.array([9, 7, 2, 5])
        states = road.step(0.02 * k, rows, ids)
    assert states["track_id"].tolist() == [7, 2, 5]
    alone = RoadFilter(camera())
    for k in range(5, 40):
        one = alone.step(0.02 * k, logs[5][k : k + 1], np.array([5]))
    assert one[0]["mean"].tobytes() == states[2]["mean"].tobytes()


def test_the_past_does_not_depend_on_the_future() -> None:
    rows = _log(np.random.default_rng(3), 0.7)
    early = _follow(rows[:40])
    np.testing.assert_array_equal(early, _follow(rows)[: len(early)])


def test_stated_errors_are_about_what_they_are() -> None:
    """Over many drives the speed's error in its stated standard deviation is of size one."""
    nees = []
    for seed in range(30):
        _, kmh, var, _ = _follow(_log(np.random.default_rng(seed), 0.7))[-1]
        nees.append((kmh - 79.2) ** 2 / var)
    assert 0.1 < np.mean(nees) < 1.6


def test_a_vehicle_cut_off_by_the_edge_has_no_state_yet() -> None:
    rows = _log(np.random.default_rng(4), 0.3)[:1]
    rows["z"][0, 1] = HEIGHT - np.exp(rows["log_size"][0, 1]) / 2.0
    road = RoadFilter(camera())
    assert not len(road.step(0.0, rows, np.array([1])))


def test_calibration_share_is_that_of_the_place() -> None:
    from dataclasses import replace

    spread = np.zeros((12, 12))
    spread[11, 11] = 0.08**2  # the height: all lengths on the road go with it
    share = CalibrationShare(replace(camera(), covariance=spread))
    place = camera().to_road(np.array([[WIDTH / 2.0, HEIGHT / 2.0]]))
    var, relative = share.at(place)
    assert np.sqrt(relative[0]) == pytest.approx(0.01, rel=0.05)
    assert np.sqrt(var[0, 1]) == pytest.approx(0.01 * place[0, 1], rel=0.15)
    assert not CalibrationShare(camera()).at(place)[0].any()


def test_track_with_a_camera_writes_the_tables_of_the_road(tmp_path: Path) -> None:
    sim, run = tmp_path / "sim", tmp_path / "run"
    assert main(["simulate", "day-sparse", "--out", str(sim), "--duration", "2.5", "--seed", "2"]) == 0
    track = ["track", str(sim / "detections.csv"), "--out", str(run)]
    assert main([*track, "--camera", str(sim / "camera.yaml")]) == 0
    tables = {}
    for kind in ("causal", "smoothed"):
        with (run / f"road_{kind}.csv").open() as file:
            tables[kind] = list(csv.DictReader(file))
        assert {"x", "y", "speed_kmh", "heading_deg", "acceleration", "var_speed_kmh"} <= set(tables[kind][0])
    with (run / "causal.csv").open() as file:
        seen = {(float(r["t"]), r["track_id"]) for r in csv.DictReader(file)}
    known = [(float(r["t"]), r["track_id"]) in seen for r in tables["causal"]]
    assert np.mean(known) > 0.99
    assert "road_causal.csv" in (run / "run.json").read_text()
    again = [run.joinpath(f"road_{kind}.csv").read_bytes() for kind in tables]
    assert main([*track, "--camera", str(sim / "camera.yaml")]) == 0
    assert again == [run.joinpath(f"road_{kind}.csv").read_bytes() for kind in tables]
    assert main(track) == 0
    assert not (run / "road_causal.csv").exists()
