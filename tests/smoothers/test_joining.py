"""ln p(joined)/p(apart) against one dense Gaussian of all detections of both pieces."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.filters import singer
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.smoothers import joining
from jeat_graph.smoothers.joining import (
    LearntScene,
    MeasuredBoxes,
    beginnings_of,
    ends_of,
    log_birth,
    log_ratio,
)

C = ModelConstants(most_perspective=1e-9)  # linear: the oracle knows no growth
SCENE = LearntScene(singer.initial_process_noise(C), np.array([-5.0]), -5.0, (640.0, 480.0))


def detections(t, seed=0):
    rng = np.random.default_rng(seed)
    centre = np.stack([100.0 + 40.0 * t, 200.0 - 10.0 * t], axis=1) + rng.normal(size=(len(t), 2))
    size = np.exp(np.log([30.0, 40.0]) + 0.02 * rng.normal(size=(len(t), 2)))
    boxes = np.concatenate([centre - size / 2, centre + size / 2], axis=1)
    edges, camera = np.zeros((len(t), 2, 2), dtype=bool), np.zeros((len(t), 2))
    return MeasuredBoxes(t, np.zeros(len(t), dtype=int), boxes, edges, camera)


def dense(mean, covariance, z, R, F, Q):
    """Ln p(z) (K, 2) of one axis: a state N(mean, covariance) that moves by F, Q between detections."""
    K, H = len(z), joining._H
    states = [covariance]
    means = [mean]
    for f, q in zip(F, Q, strict=True):
        means.append(f @ means[-1])
        states.append(f @ states[-1] @ f.T + q)
    S = np.zeros((2 * K, 2 * K))
    for i in range(K):
        cross = states[i]
        for j in range(i, K):
            S[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = H @ cross @ H.T
            S[2 * j : 2 * j + 2, 2 * i : 2 * i + 2] = (H @ cross @ H.T).T
            if j + 1 < K:
                cross = cross @ F[j].T
        S[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += R[i]
    y = (z - np.array([H @ m for m in means])).reshape(-1)
    _, log_det = np.linalg.slogdet(S)
    return -0.5 * (y @ np.linalg.solve(S, y) + log_det + 2 * K * np.log(2 * np.pi))


def parts(gap):
    t = np.array([0.0, 0.1, 0.2, 0.2 + gap, 0.3 + gap, 0.5 + gap])
    return detections(t), np.array([[0, 1, 2], [3, 4, 5]])


def test_a_side_has_the_variance_of_its_own_spread():
    """Beside what lasts of the sensor's errors; a side without one has that of the sensor."""
    seen = detections(np.array([0.0]))
    spread = np.array([[[9.0, np.nan], [4.0, 25.0]]])
    own = np.array([-6.0])
    size = seen.boxes[:, 2:] - seen.boxes[:, :2]
    s2 = (0.5 * np.sqrt(size.prod()) + 0.5 * size[0]) ** 2
    low = spread[0, :, 0] + (np.exp(-5.0) - np.exp(-6.0)) * s2 + C.pixel_std**2
    high = np.array([np.exp(-5.0) * s2[0], 25.0 + (np.exp(-5.0) - np.exp(-6.0)) * s2[1]]) + C.pixel_std**2
    scene = SCENE._replace(log_own_variance=own)
    R = joining._noise(seen._replace(spread=spread), np.array([0]), size, scene, C)[0]
    np.testing.assert_allclose(R[:, 0, 0], (low + high) / 4.0)
    np.testing.assert_allclose(R[:, 1, 1], (low + high) / size[0] ** 2)
    np.testing.assert_allclose(R[:, 0, 1], (high - low) / (2.0 * size[0]))


def test_the_likelihood_of_a_piece_is_that_of_a_dense_normal():
    seen, hits = parts(1.0)
    ends, begun = ends_of(seen, hits, SCENE, C), beginnings_of(seen, hits, SCENE, C)
    mean, covariance = joining._predict(ends.mean[:1], ends.covariance[:1], np.array([1.0]), SCENE, C)
    exponent, constant = joining._joint(
        mean - begun.mean[1:], covariance, begun.L[1:], begun.e[1:], begun.k[1:]
    )
    _, _, steps = joining._filter(seen, hits, SCENE, C)
    z = joining._measure(seen, hits[1])
    total = 0.0
    for axis in (0, 1):
        R = [steps.R[k][1, axis] for k in range(3)]
        F, Q = zip(
            *(
                joining._transition(np.array([dt]), steps.mean[k][1:], SCENE, C)
                for k, dt in enumerate(np.diff(seen.t[hits[1]]))
            ),
            strict=True,
        )
        total += dense(
            mean[0, axis], covariance[0, axis], z[:, axis], R, [f[0, 0] for f in F], [q[0, axis] for q in Q]
        )
    # The dense covariance has a condition of some 1e6.
    assert exponent[0] + constant[0] == pytest.approx(total, abs=1e-6)


def test_a_piece_that_goes_on_is_joined_and_one_elsewhere_is_not():
    seen, hits = parts(0.5)
    moved = seen.boxes.copy()
    moved[3:] += 60.0
    elsewhere = seen._replace(boxes=moved)
    ratio = []
    for one in (seen, elsewhere):
        ends, begun = ends_of(one, hits, SCENE, C), beginnings_of(one, hits, SCENE, C)
        ratio.append(log_ratio(ends, np.array([0]), begun, np.array([1]), SCENE, C)[0])
    assert ratio[0] > 5.0
    assert ratio[0] - ratio[1] > 5.0


def test_pieces_are_filtered_apart_from_each_other():
    seen, hits = parts(0.5)
    both = ends_of(seen, hits, SCENE, C)
    alone = ends_of(seen, hits[1:], SCENE, C)
    assert np.array_equal(both.mean[1], alone.mean[0])
    short = np.array([[-1, -1, 0], [3, 4, 5]])
    assert ends_of(seen, short, SCENE, C).mean[1] == pytest.approx(alone.mean[0], abs=1e-12)


def test_a_side_that_the_edge_cuts_says_little():
    seen, hits = parts(0.5)
    cut = seen.edges.copy()
    cut[3, 0, 1] = True
    boxes = seen.boxes.copy()
    boxes[3, 2] -= 12.0
    tail, head = np.array([0]), np.array([1])
    ratio = []
    for edges in (seen.edges, cut):
        one = seen._replace(boxes=boxes, edges=edges)
        ends, begun = ends_of(one, hits, SCENE, C), beginnings_of(one, hits, SCENE, C)
        ratio.append(log_ratio(ends, tail, begun, head, SCENE, C)[0])
    assert ratio[1] > ratio[0] + 1.0


def test_a_birth_anywhere_in_a_larger_picture_is_less_likely():
    seen, hits = parts(0.5)
    begun = beginnings_of(seen, hits, SCENE, C)
    small = sum(log_birth(begun, SCENE, C))
    large = sum(log_birth(begun, SCENE._replace(picture=(1280.0, 960.0)), C))
    assert small - large == pytest.approx(np.log(4.0), abs=1e-3)


@pytest.mark.parametrize("gap", [0.3, 4.0])
def test_pieces_that_a_camera_moved_are_those_of_one_at_rest(gap):
    seen, hits = parts(gap)
    moved = np.random.default_rng(1).normal(0.0, 200.0, (len(seen.t), 2))
    both = seen._replace(boxes=seen.boxes + np.tile(moved, 2), camera=moved)
    unknown = both._replace(camera=np.zeros_like(moved))
    ratio = [
        log_ratio(
            *(ends_of(one, hits, SCENE, C), np.array([0]), beginnings_of(one, hits, SCENE, C), np.array([1])),
            *(SCENE, C),
        )
        for one in (seen, both, unknown)
    ]
    np.testing.assert_allclose(ratio[1], ratio[0], rtol=1e-9)
    assert abs(ratio[2] - ratio[0]) > 5.0
