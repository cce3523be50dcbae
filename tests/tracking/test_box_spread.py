"""Detections that say how sure they are of each side: drawn from the model, tracked with that and without."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Detections, Scan, Tracker, load_config, track
from jeat_graph.filters import singer
from jeat_graph.filters.model_constants import ModelConstants

C = ModelConstants()
RATE_HZ, SECONDS, SETTLED_S = 20.0, 20.0, 4.0
#: Least and greatest standard deviation of a side, in shares of the object: the same object, all in one box.
SHARES = (0.03, 0.35)
PICTURE = ["image.width=1920", "image.height=1080"]


def drawn(seed, told=1.0, count=6):
    """Scans of squares that move as the model has it, their true centres, and an error that lasts.

    Standard deviations are given divided by `told`: 2 if a detector is twice too sure.
    """
    rng = np.random.default_rng(seed)
    dt, size = 1.0 / RATE_HZ, 90.0 * rng.uniform(0.8, 1.2, count)
    step = singer.discretise(dt, C)
    L = np.linalg.cholesky((0.5 * size[:, None, None]) ** 2 * step.jerk + 1e-12 * np.eye(singer.STATES))
    state = np.zeros((count, 2, singer.STATES))
    state[:, :, singer.POSITION] = np.stack([np.linspace(300, 1600, count), np.linspace(200, 900, count)], 1)
    state[:, :, singer.VELOCITY] = rng.normal(0, 60, (count, 2))
    mean_square = (SHARES[1] ** 2 - SHARES[0] ** 2) / (2.0 * np.log(SHARES[1] / SHARES[0]))
    lasting_std = np.sqrt(C.error_share * mean_square) * size[:, None]
    keep = np.exp(-dt / C.error_time_s)
    lasting = rng.normal(0, 1, (count, 4)) * lasting_std
    for k in range(int(SECONDS * RATE_HZ)):
        noise = np.einsum("nij,naj->nai", L, rng.normal(0, 1, state.shape))
        state = np.einsum("ij,naj->nai", step.F, state) + noise
        lasting = keep * lasting + np.sqrt(1.0 - keep**2) * rng.normal(0, 1, (count, 4)) * lasting_std
        std = np.exp(rng.uniform(*np.log(SHARES), (count, 4))) * size[:, None]
        centre = state[:, :, singer.POSITION]
        sides = np.concatenate([centre - size[:, None] / 2, centre + size[:, None] / 2], axis=1)
        sides += lasting + rng.normal(0, 1, (count, 4)) * std
        boxes = np.concatenate([sides[:, :2], np.maximum(sides[:, 2:] - sides[:, :2], 4.0)], axis=1)
        yield k * dt, boxes, std / told, centre


def judged(seed, given, told=1.0):
    """RMSE of the centre (px) and ANEES of the filter's own state, after the first seconds; the factor."""
    tracker = Tracker(load_config("default", [*PICTURE, "smoother.engine=none"]))
    errors, squares = [], []
    for t, boxes, std, centre in drawn(seed, told):
        tracker.step(Scan(t, "cam", boxes, np.full(len(boxes), 0.9), box_std=std if given else None))
        if t < SETTLED_S:
            continue
        for mean, covariance in zip(*tracker._model.states(), strict=True):
            off = mean.reshape(2, -1)[:, singer.POSITION] - centre
            off = off[np.argmin(np.hypot(*off.T))]
            P = covariance.reshape(2, singer.STATES, singer.STATES)
            variance = P[:, singer.POSITION, singer.POSITION]
            errors.append(off @ off)
            squares.append((off**2 / variance).mean())
    return np.sqrt(np.mean(errors)), np.mean(squares), tracker.sensor_states()["cam"].spread_factor


def test_positions_are_more_exact_and_variances_nearer_the_truth():
    """On each of several draws; ANEES, of which each draw has its own, in their mean."""
    found = np.array([[judged(seed, given)[:2] for given in (True, False)] for seed in range(1, 6)])
    error, anees = found[..., 0], found[..., 1]
    assert (error[:, 0] < 0.93 * error[:, 1]).all()
    assert (np.abs(anees[:, 0] - 1.0) < 0.15).all()
    assert np.abs(anees[:, 0] - 1.0).mean() < 0.6 * np.abs(anees[:, 1] - 1.0).mean()


@pytest.mark.parametrize("told", [0.6, 1.0, 2.0])
def test_a_detector_that_is_too_sure_or_not_sure_enough_is_corrected(told):
    error, _, factor = judged(1, True, told)
    assert factor == pytest.approx(told, rel=0.1)
    assert error == pytest.approx(judged(1, True)[0], rel=0.02)


def test_what_says_nothing_has_the_same_bytes_as_without_the_columns():
    boxes, scores = np.array([[100.0, 100.0, 60.0, 40.0]]), np.array([0.8])
    plain, blank = Tracker(), Tracker()
    for k in range(30):
        boxes = boxes + np.array([2.0, 1.0, 0.0, 0.0])
        one = plain.step(Scan(0.05 * k, "cam", boxes, scores))
        other = blank.step(Scan(0.05 * k, "cam", boxes, scores, box_std=np.full((1, 4), np.nan)))
        assert one.var.tobytes() == other.var.tobytes()
        assert one.mean.tobytes() == other.mean.tobytes()


@pytest.mark.parametrize("identities", ["causal", "lag", "whole"])
def test_smoothed_tracks_are_more_exact_too(identities):
    scans, truth = [], []
    for t, boxes, std, centre in drawn(5):
        scans.append(Scan(t, "cam", boxes, np.full(len(boxes), 0.9), box_std=std))
        truth.append((t, centre))
    with_them = Detections.from_scans(scans)
    without = Detections.from_scans([Scan(one.t, one.sensor, one.boxes, one.scores) for one in scans])
    errors = []
    for detections in (with_them, without):
        config = load_config("default", [*PICTURE, f"smoother.identities={identities}"])
        table = track(detections, config).smoothed
        off = []
        for t, centre in truth:
            for row in np.flatnonzero(np.abs(table.t - t) < 1e-6):
                away = np.hypot(*(table.mean[row, :2] - centre).T).min()
                off.append(away**2)
        assert len(off) > 0.95 * sum(len(centre) for _, centre in truth)
        errors.append(np.sqrt(np.mean(off)))
    assert errors[0] < errors[1]
