"""A vehicle as a factor graph: its factors against a dense graph, the fit against the other solver."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from road_scenes import camera
from scipy.linalg import expm

from jeat_graph.cli.main import main
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.road.box_errors import BoxRows
from jeat_graph.road.box_rows import BoxConfig, rows_of_table
from jeat_graph.road.chain_rows import MOTION, LinearBoxes, chain_rows
from jeat_graph.road.cuboid import sides
from jeat_graph.road.cuboid_fit import CuboidConfig, CuboidFit, fit_cuboid
from jeat_graph.road.graph_fit import GraphConfig, fit_graph
from jeat_graph.road.key_motion import key_rows
from jeat_graph.road.motion_fit import MotionFitConfig
from jeat_graph.smoothers.gtsam.shared_chain import ChainRows, PriorRows, solve_shared_chain

#: Knots so close that steps of acceleration are as good as white jerk.
MOTION_CONFIG = MotionFitConfig(acceleration_sd=0.8, jerk=0.4, knot_s=0.05, most_knots=200)


def test_between_states_lies_the_quintic_that_has_them_at_its_ends() -> None:
    way = np.polynomial.Polynomial([1.0, 2.0, -0.5, 0.3, 0.1, -0.05])
    keys, t = np.array([0.0, 0.5, 1.3, 2.0]), np.linspace(0.0, 2.0, 23)
    states = np.stack([way(keys), way.deriv()(keys), way.deriv(2)(keys)], axis=1).ravel()
    for d in range(3):
        expected = (way.deriv(d) if d else way)(t)
        np.testing.assert_allclose(key_rows(t, keys, d) @ states, expected, atol=1e-12)


def test_beyond_the_ends_the_acceleration_stays() -> None:
    keys, states = np.array([1.0, 2.0]), np.array([0.0, 3.0, 2.0, 5.0, 4.0, -1.0])
    t = np.array([0.5, 2.5])
    np.testing.assert_allclose(key_rows(t, keys, 0) @ states, [-1.25, 6.875])
    np.testing.assert_allclose(key_rows(t, keys, 1) @ states, [2.0, 3.5])
    np.testing.assert_allclose(key_rows(t, keys, 2) @ states, [2.0, -1.0])


def _motion(dt: float, jerk: np.ndarray, memory: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Transition and noise of a state by the matrix exponential."""
    n = MOTION + 4 * len(memory)
    A, noise = np.zeros((n, n)), np.zeros((n, n))
    for axis in range(2):
        A[3 * axis, 3 * axis + 1] = A[3 * axis + 1, 3 * axis + 2] = 1.0
        noise[3 * axis + 2, 3 * axis + 2] = jerk[axis] ** 2
    for e in range(MOTION, n):
        A[e, e] = -1.0 / memory[(e - MOTION) // 4]
        noise[e, e] = 2.0 / memory[(e - MOTION) // 4]
    lifted = expm(np.block([[-A, noise], [np.zeros_like(A), A.T]]) * dt)
    F = lifted[n:, n:].T
    return F, F @ lifted[:n, n:]


def test_states_between_are_eliminated_exactly() -> None:
    """Against dense least squares in which every box has a state of its own: means, covariances, evidence."""
    rng, memory = np.random.default_rng(0), np.array([0.2, 0.7])
    keys, jerk = np.array([0.0, 0.6, 1.1, 2.0]), np.array([0.2, 0.5])
    # Boxes at states and between them, two at one time; not closer, for the dense system's digits.
    t = np.array([0.0, 0.15, 0.35, 0.6, 0.75, 0.9, 0.9, 1.25, 1.5, 1.7, 2.0])
    N, n = len(t), MOTION + 8
    mode = np.zeros((N, 2), dtype=np.int64)
    mode[4, 0] = 3  # nothing of its width is seen
    white, coloured = rng.uniform(0.5, 2.0, (N, 4)), rng.uniform(0.5, 2.0, (N, 4))
    rows = BoxRows(t, np.zeros((N, 4)), white, coloured, mode, rng.integers(0, 2, N), memory)
    J, d, weight = rng.standard_normal((N, 4, 5)), rng.standard_normal((N, 4)), rng.uniform(0.3, 1.0, N)
    out, counts, logs = chain_rows(keys, rows, LinearBoxes(J, d, weight), jerk)
    A0, A1, B, b = np.split(out, [n, 2 * n, 2 * n + 3], axis=2)
    priors = [PriorRows(0, np.eye(n), np.zeros(n)), PriorRows(None, np.eye(3), np.ones(3))]
    system = ChainRows(A0, A1, B, b[..., 0], counts)
    solved = solve_shared_chain(system, priors)

    times = np.unique(np.r_[keys, t])
    size = len(times) * n + 3
    A, right, log = [np.zeros((n, size)), np.zeros((3, size))], [np.zeros(n), np.ones(3)], 0.0
    A[0][:, :n], A[1][:, -3:] = np.eye(n), np.eye(3)
    for k, dt in enumerate(np.diff(times)):
        F, Q = _motion(dt, jerk, memory)
        W = np.linalg.inv(np.linalg.cholesky(Q))
        block = np.zeros((n, size))
        block[:, k * n : (k + 1) * n], block[:, (k + 1) * n : (k + 2) * n] = -W @ F, W
        A.append(block)
        right.append(np.zeros(n))
        log += np.linalg.slogdet(Q)[1]
    for k in range(N):
        for channel in range(4):
            if mode[k, channel % 2]:
                continue
            own = np.searchsorted(times, t[k]) * n
            row = np.zeros((1, size))
            row[0, own], row[0, own + 3], row[0, -3:] = J[k, channel, 0], J[k, channel, 1], J[k, channel, 2:]
            row[0, own + MOTION + 4 * rows.group[k] + channel] = coloured[k, channel]
            total = white[k, channel] + coloured[k, channel] ** 2
            variance = white[k, channel] + total * (1.0 / weight[k] - 1.0)
            A.append(row / np.sqrt(variance))
            right.append(d[k, channel : channel + 1] / np.sqrt(variance))
            log += np.log(variance)
    dense, y = np.concatenate(A), np.concatenate(right)
    normal = dense.T @ dense
    x = np.linalg.lstsq(dense, y, rcond=None)[0]
    index = np.r_[(np.searchsorted(times, keys)[:, None] * n + np.arange(n)).ravel(), size - 3 + np.arange(3)]
    np.testing.assert_allclose(np.r_[solved.states.ravel(), solved.shared], x[index], atol=1e-8)
    np.testing.assert_allclose(solved.covariance(), np.linalg.inv(normal)[np.ix_(index, index)], atol=1e-8)
    left = sum(
        (
            (A0[k] @ solved.states[k] + A1[k] @ solved.states[k + 1] + B[k] @ solved.shared - b[k, :, 0]) ** 2
        ).sum()
        for k in range(3)
    )
    left += (solved.states[0] ** 2).sum() + ((solved.shared - 1.0) ** 2).sum()
    got = left + logs.sum() + solved.log_determinant
    expected = ((dense @ x - y) ** 2).sum() + log + np.linalg.slogdet(normal)[1]
    assert got == pytest.approx(expected, rel=1e-6)


def test_two_states_at_one_time_are_refused() -> None:
    one, four, whole = np.zeros(1), np.ones((1, 4)), np.zeros((1, 2), dtype=np.int64)
    rows = BoxRows(one, four, four, four, whole, np.zeros(1, dtype=np.int64), np.ones(1))
    boxes = LinearBoxes(np.zeros((1, 4, 5)), np.zeros((1, 4)), np.ones(1))
    with pytest.raises(RuntimeError, match="not positive definite"):
        chain_rows(np.zeros(2), rows, boxes, np.ones(2))


def _drive(rng: np.random.Generator, noise: float, length: float = 4.5) -> BoxRows:
    t = np.arange(0.0, 2.0, 0.05)
    xy = np.c_[np.full(len(t), 3.0), 60.0 - 18.0 * t + 0.8 * t**2]
    seen, _ = sides(camera(), xy, np.zeros(len(t)), np.array([length, 1.8, 1.5]))
    seen = seen + noise * rng.standard_normal(seen.shape)
    boxes, cam = np.c_[seen[:, :2], seen[:, 2:] - seen[:, :2]], camera()
    return rows_of_table(t, boxes, np.zeros((len(t), 4)), (cam.width, cam.height), BoxConfig())


def _deviation(fit: CuboidFit, t: np.ndarray, derivative: int) -> np.ndarray:
    C = fit.motion.coefficients.shape[1]
    row, own = fit.motion.basis(t, derivative), fit.motion.covariance[C:, C:]
    return np.sqrt(np.einsum("na,ab,nb->n", row, own, row))


@pytest.mark.parametrize("seed", range(3))
def test_the_graph_finds_what_the_other_solver_finds(seed: int) -> None:
    """Two forms of one belief, two solvers: they differ by far less than their standard deviations."""
    rows = _drive(np.random.default_rng(seed), 0.5)
    graph = fit_graph(rows, camera(), CuboidConfig(), MOTION_CONFIG, GraphConfig(key_s=0.1))
    other = fit_cuboid(rows, camera(), CuboidConfig(), MOTION_CONFIG)
    assert graph is not None
    assert other is not None
    assert graph.kind == other.kind
    t = rows.t[2:-2]
    for derivative in range(2):
        deviation = _deviation(other, t, derivative)
        off = graph.motion.at(t, derivative) - other.motion.at(t, derivative)
        assert (np.abs(off[:, 1]) < 0.1 * deviation).all()
        np.testing.assert_allclose(_deviation(graph, t, derivative), deviation, rtol=0.05)
    np.testing.assert_allclose(graph.size, other.size, atol=0.02)
    np.testing.assert_allclose(graph.size_covariance, other.size_covariance, atol=2e-3)
    assert graph.motion.window() == other.motion.window()


def test_states_farther_apart_tell_the_same() -> None:
    rows = _drive(np.random.default_rng(4), 0.5)
    near, far = (
        fit_graph(rows, camera(), CuboidConfig(), MOTION_CONFIG, GraphConfig(key_s=s)) for s in (0.1, 0.5)
    )
    assert near is not None
    assert far is not None
    off = near.motion.at(rows.t) - far.motion.at(rows.t)
    assert (np.abs(off[:, 1]) < 0.2 * _deviation(near, rows.t, 0)).all()


def test_what_the_camera_has_wrong_moves_both_fits_alike() -> None:
    spread = np.zeros((12, 12))
    spread[11, 11] = 0.05**2
    cam, rows = replace(camera(), covariance=spread), _drive(np.random.default_rng(5), 0.0)
    fits = [fit(rows, cam, CuboidConfig(), MOTION_CONFIG) for fit in (fit_graph, fit_cuboid)]
    deviations = []
    for fit in fits:
        assert fit is not None
        C = fit.motion.coefficients.shape[1]
        row = np.r_[np.zeros(C), fit.motion.basis(np.array(1.0), 1)]
        deviations.append(float(np.sqrt(row @ fit.by_calibration @ row)))
    assert deviations[0] == pytest.approx(deviations[1], rel=0.02)


def test_nothing_on_the_road_is_no_vehicle() -> None:
    rows = _drive(np.random.default_rng(6), 0.5)
    few = rows._replace(**{name: getattr(rows, name)[:2] for name in rows._fields if name != "memory_s"})
    assert fit_graph(few, camera(), CuboidConfig(), MOTION_CONFIG) is None


def test_the_commands_offer_both(tmp_path: Path) -> None:
    sim, run, found = tmp_path / "sim", tmp_path / "run", {}
    assert main(["simulate", "day-sparse", "--out", str(sim), "--duration", "1.5", "--seed", "2"]) == 0
    camera_file = ["--camera", str(sim / "camera.yaml")]
    track = ["track", str(sim / "detections.csv"), "--out", str(run), *camera_file]
    assert main([*track, "--set", "smoother.road=graph"]) == 0
    for name in ("spline", "graph"):
        out = tmp_path / name
        assert main(["road", str(run), *camera_file, "--out", str(out), "--smoother", name]) == 0
        found[name] = read_table(out / "road.csv", ("y",)).number("y")
    # `track` did what `road` does with the same smoother, to the last digit written.
    assert (found["graph"] == read_table(run / "road_smoothed.csv", ("y",)).number("y")).all()
    assert not np.array_equal(found["graph"], found["spline"])
    assert np.median(np.abs(found["graph"] - found["spline"])) < 0.1
