"""Our own pass and GTSAM's against the same formulas with 60 digits, over steps of 1 µs to 3 s."""

from __future__ import annotations

from dataclasses import replace

import mpmath
import numpy as np
import pytest

from jeat_graph.filters import box_sides, singer
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.smoothers.filtered_track import FilteredTrack, smoothed_together
from jeat_graph.smoothers.gtsam.filter_graph import filter_graph
from jeat_graph.smoothers.gtsam.solvers import LagChain, solve_whole
from jeat_graph.tracking.paper import kalman

C = ModelConstants()
#: Standard deviations by which estimates may differ.
_SIGMA = 1e-6
#: A track that nothing finds for 3 s has ended.
SHORTEST_S, LONGEST_S = 1e-6, 3.0


def steps_of(rng, count):
    """Drawn steps: of all lengths, none at all, and runs of the shortest."""
    steps = np.exp(rng.uniform(np.log(SHORTEST_S), np.log(LONGEST_S), count))
    steps = np.where(rng.random(count) < 0.2, 0.0, steps)
    steps = np.where(rng.random(count) < 0.3, rng.choice([1e-6, 2e-6, 0.01, 0.05], count), steps)
    steps[0] = 0.0
    return np.round(steps, 6)


def collected(rows, t, sensor):
    F, *states = (np.array(column) for column in zip(*rows, strict=True))
    return FilteredTrack(1, t, F, *states, sensor)


def of_model(seed, count=9):
    """A track of the model: Singer's motion in perspective, updates by four sides, some of them uncovered."""
    rng = np.random.default_rng(seed)
    steps = steps_of(rng, count)
    box = np.array([[600.0, 300.0, 680.0, 350.0]])
    mean, P = box_sides.initial_state(box, np.zeros((1, 2, 2), dtype=bool), -5.0, -5.0, C)
    q, sensor, rows = singer.initial_process_noise(C), np.where(rng.random(count) < 0.3, -1, 0), []
    for k, dt in enumerate(steps.tolist()):
        model = singer.discretise(dt, C)
        F = singer.in_perspective(model.F, mean, dt, C)
        if dt > 0.0:
            mean, P = singer.predict(mean, P, model, F, q, -5.0, C)
        if rng.random() < 0.2:  # a camera's shift, known with its variance
            mean, P = mean.copy(), P.copy()
            mean[:, :, 0] += rng.normal(0.0, 3.0, 2)
            P[..., 0, 0] += 0.5
        before = mean[0], P[0]
        if sensor[k] >= 0 and k:
            expected = box_sides.by_axis(box_sides.expected_corners(mean))
            H = box_sides.measurement_matrix(singer.expected_size(mean))
            R = np.full((1, 2, 2), rng.choice([0.5, 9.0, 1e4]))
            S = np.einsum("naid,nade,naie->nai", H, P, H) + R
            y = rng.normal(0.0, 1.0, expected.shape) * np.sqrt(S)
            mean, P = box_sides.update(mean, P, y, H, R)
        rows.append((np.repeat(F[0], 2, axis=0), *before, mean[0], P[0]))
    return collected(rows, np.cumsum(steps), sensor)


def of_paper(seed, count=9):
    """A track of the paper's filter: motion and size of both axes."""
    rng = np.random.default_rng(seed)
    steps = steps_of(rng, count)
    sensor = np.where(rng.random(count) < 0.3, -1, 0)
    motion, cov = np.zeros((1, 2, 3)), np.diag([9.0, 150.0**2, 100.0**2])[None]
    size, size_cov = np.full((1, 2, 2), 3.0), np.diag([0.01, 0.25])[None]
    rows = []

    def whole():
        P = np.zeros((2, 5, 5))
        P[:, :3, :3], P[:, 3:, 3:] = cov[0], size_cov[0]
        return np.concatenate([motion[0], size[0]], axis=1), P

    for k, dt in enumerate(steps.tolist()):
        if dt > 0.0:
            motion, cov = kalman.move(motion, cov, *kalman.motion_model(dt, 200.0))
            size, size_cov = kalman.move(size, size_cov, *kalman.size_model(dt, 0.5))
        before = whole()
        if sensor[k] >= 0 and k:
            R = np.array([rng.choice([1.0, 16.0, 160.0])])
            z = motion[:, :, 0] + rng.normal(0.0, 1.0, (1, 2)) * np.sqrt(cov[:, 0, 0] + R)
            motion, cov, _ = kalman.correct(motion, cov, z, R)
            z = size[:, :, 0] + rng.normal(0.0, 1.0, (1, 2)) * np.sqrt(size_cov[:, 0, 0] + 0.01)
            size, size_cov, _ = kalman.correct(size, size_cov, z, np.array([0.01]))
        F = kalman.transition(dt)
        rows.append((np.stack([F, F]), *before, *whole()))
    return collected(rows, np.cumsum(steps), sensor)


def sixty_digits(track):
    """Means and covariances by the Rauch–Tung–Striebel formulas with 60 digits."""
    mean, covariance = track.mean.copy(), track.covariance.copy()
    with mpmath.workdps(60):
        for axis in range(mean.shape[1]):
            m, P = (mpmath.matrix(one[-1, axis].tolist()) for one in (track.mean, track.covariance))
            for k in range(len(track) - 2, -1, -1):
                F, before = (
                    mpmath.matrix(one[k + 1, axis].tolist()) for one in (track.F, track.predicted_covariance)
                )
                here = mpmath.matrix(track.covariance[k, axis].tolist())
                G = here * F.T * before**-1
                m = mpmath.matrix(track.mean[k, axis].tolist()) + G * (
                    m - mpmath.matrix(track.predicted_mean[k + 1, axis].tolist())
                )
                P = here + G * (P - before) * G.T
                mean[k, axis] = [float(value) for value in m]
                covariance[k, axis] = np.array(P.tolist(), dtype=float)
    return mean, covariance


def apart(found, wanted):
    """Return the greatest difference of means and covariances in standard deviations."""
    std = np.sqrt(np.diagonal(wanted[1], axis1=-2, axis2=-1))
    spread = (found[1] - wanted[1]) / (std[..., :, None] * std[..., None, :])
    return max(np.abs((found[0] - wanted[0]) / std).max(), np.abs(spread).max())


def window(track, first, end):
    return replace(
        track,
        **{
            name: getattr(track, name)[first:end]
            for name in (
                *("t", "F", "predicted_mean", "predicted_covariance", "mean", "covariance", "sensor"),
            )
        },
    )


@pytest.mark.parametrize("drawn", [of_model, of_paper])
@pytest.mark.parametrize("seed", range(2))
def test_both_smoothers_are_right_to_a_millionth_of_a_standard_deviation(drawn, seed):
    track = drawn(seed)
    wanted = sixty_digits(track)
    assert apart(smoothed_together([track])[0], wanted) < _SIGMA
    assert apart(solve_whole(track), wanted) < _SIGMA


@pytest.mark.parametrize("drawn", [of_model, of_paper])
@pytest.mark.parametrize("seed", range(3, 8))
def test_gtsam_is_our_own_pass_over_whole_tracks_and_with_any_lag(drawn, seed):
    track = drawn(seed, 40)
    assert apart(solve_whole(track), smoothed_together([track])[0]) < _SIGMA
    chain, first, rng = LagChain(), 0, np.random.default_rng(seed)
    for end in (5, 11, 12, 25, 40):
        part = window(track, first, end)
        chain.extend(part)
        count = int(rng.integers(0, len(part)))
        wanted = smoothed_together([part])[0]
        found = chain.states(len(part))
        assert apart(found, wanted) < _SIGMA
        chain.leave(count)
        first += count


@pytest.mark.parametrize("drawn", [of_model, of_paper])
def test_the_graph_in_users_hands_gives_the_same(drawn):
    track = drawn(20)
    graph = filter_graph([track])
    std = np.sqrt(np.diagonal(track.smoothed()[1], axis1=-2, axis2=-1))[:, :, :3]
    states = np.flatnonzero(np.diff(track.t, append=np.inf) > 0.0)
    found = {float(t): row for t, row in zip(graph.times_s[1], graph.motion(graph.solve(), 1), strict=True)}
    for k in states.tolist():
        if float(track.t[k]) in found:
            np.testing.assert_allclose(
                (found[float(track.t[k])] - track.smoothed()[0][k, :, :3]) / std[k], 0.0, atol=1e-3
            )
