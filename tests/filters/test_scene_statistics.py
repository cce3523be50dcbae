"""What is learnt of noise, gaps, scores, presence and the camera, against cases whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters import (
    box_sides,
    camera_motion,
    gap_survival,
    noise_learning,
    score_calibration,
    singer,
    visibility,
)
from jeat_graph.filters.model_constants import ModelConstants

C = ModelConstants()


def test_measurement_noise_goes_to_what_makes_the_squares_right():
    rng = np.random.default_rng(0)
    log_variance, true_scale = 2.0 * np.log(0.06), 0.12
    for _ in range(4000):
        y = rng.standard_t(C.degrees_of_freedom, size=(10, 4)) * true_scale
        e = y / np.exp(log_variance / 2.0)
        log_variance = noise_learning.learn_measurement_noise(log_variance, e, 1.0, C)
    # What is learnt is the standard deviation of these errors, of t with six degrees of freedom.
    assert np.exp(log_variance / 2.0) == pytest.approx(true_scale * np.sqrt(6.0 / 4.0), rel=0.03)


def test_measurement_noise_stays_above_its_floor():
    log_variance = 2.0 * np.log(0.06)
    for _ in range(2000):
        log_variance = noise_learning.learn_measurement_noise(log_variance, np.zeros((8, 4)), 1.0, C)
    assert np.exp(log_variance / 2.0) == pytest.approx(C.side_std_bounds[0])


def test_process_noise_follows_successive_innovations_and_white_ones_leave_it():
    q = singer.initial_process_noise(C)
    alike, known = np.ones((8, 4)), np.ones(8, dtype=bool)
    more = noise_learning.learn_process_noise(q, alike, alike, known, 1.0, C)
    less = noise_learning.learn_process_noise(q, alike, -alike, known, 1.0, C)
    same = noise_learning.learn_process_noise(q, alike, 0.0 * alike, known, 1.0, C)
    assert all(a > b > c for a, b, c in zip(more, q, less, strict=True))
    assert same == q
    assert noise_learning.learn_process_noise(q, alike, alike, ~known, 1.0, C) == q


def test_presence_follows_the_chain_of_its_rates():
    hide, show = C.visible_to_hidden, C.hidden_to_visible
    leave, vanish = C.visible_to_gone, C.hidden_to_gone
    generator = np.array([[-hide - leave, hide, leave], [show, -show - vanish, vanish], [0, 0, 0]])
    presence, small = visibility.seen(1)[0], 1e-5
    for _ in range(100_000):  # Euler's steps
        presence = presence + presence @ generator * small
    for steps in (1, 4):
        there = visibility.seen(1)
        for _ in range(steps):
            there = visibility.predict(there, 1.0 / steps, C)
        np.testing.assert_allclose(there[0], presence, atol=1e-5)


@given(dt=st.floats(0, 10), p=st.floats(0.02, 0.98), times=st.integers(1, 20))
def test_presence_is_a_distribution(dt, p, times):
    presence = visibility.seen(1)
    for _ in range(times):
        presence = visibility.miss(visibility.predict(presence, dt, C), np.array([p]))
    assert presence.sum() == pytest.approx(1.0)
    assert presence.min() >= 0.0


def test_a_miss_is_bayes_rule():
    got = visibility.miss(np.array([[0.5, 0.3, 0.2]]), np.array([0.8]))
    np.testing.assert_allclose(got, [[0.1 / 0.6, 0.3 / 0.6, 0.2 / 0.6]])


def test_survival_goes_from_the_prior_to_what_is_counted():
    counts = gap_survival.no_gaps()
    prior = gap_survival.survival(counts, np.array([0.0, 0.1, 7.5, 99.0]), C)
    np.testing.assert_allclose(prior, [1.0, *np.exp(-np.array([C.gap_prior_least, 6.0, 27.0]) / C.gap_prior)])
    for _ in range(1000):
        counts = gap_survival.count_ends(counts, np.array([7.5, 7.5]), np.array([True, False]))
    half = gap_survival.survival(counts, np.array([1.5, 7.0]), C)
    np.testing.assert_allclose(half, 0.5, atol=0.01)
    # No gap lasted longer: the prior stands.
    assert gap_survival.survival(counts, np.array([30.0]), C)[0] == pytest.approx(prior[3])
    lost = gap_survival.count_losses(counts, 10_000)
    assert gap_survival.survival(lost, np.array([1.5]), C)[0] < 0.1


def _steady(number: int) -> FloatArray:
    """Boxes that are at the same places in all scans."""
    return np.arange(number)[:, None] * 50.0 + np.array([[0.0, 0.0, 30.0, 30.0]])


def _stray(rng: np.random.Generator, number: int) -> FloatArray:
    """Boxes that are somewhere, in each scan somewhere else."""
    return rng.uniform(0, 1000, (number, 1)) + np.array([[500.0, 500.0, 520.0, 520.0]])


def test_scores_above_which_boxes_come_again_are_found():
    rng = np.random.default_rng(2)
    counts = score_calibration.no_repetition()
    steady = _steady(20)
    for _ in range(200):
        stray = _stray(rng, 20)
        boxes = np.concatenate([steady, stray])
        logits = np.concatenate([rng.normal(3.0, 0.3, 20), rng.normal(-1.0, 0.3, 20)])
        counts = score_calibration.count_repetition(counts, boxes, logits, C)
    assert -0.5 < score_calibration.half_as_many(counts, C) < 2.5
    z = score_calibration.half_as_many(counts, C)
    want = C.threshold_offset + C.threshold_slope * z
    assert score_calibration.decision_threshold(counts, C) == pytest.approx(want)


def test_boxes_are_counted_once_each_about_their_logits():
    """A Gaussian kernel keeps number and mean, and adds its own variance."""
    counts, scans = score_calibration.no_repetition(), 10
    boxes = _steady(3)
    logits = np.array([-1.3, 0.45, 2.0])
    for _ in range(scans):
        counts = score_calibration.count_repetition(counts, boxes, logits, C)
    total, grid = counts.boxes, score_calibration.SCORE_GRID
    assert total.sum() == pytest.approx(3 * (scans - 2))  # of those with a scan before and after them
    mean = total @ grid / total.sum()
    assert mean == pytest.approx(logits.mean())
    variance = logits.var() + score_calibration._BANDWIDTH**2
    assert total @ (grid - mean) ** 2 / total.sum() == pytest.approx(variance)
    np.testing.assert_allclose(counts.repeated, total, atol=1e-12)  # they all stood


def _repeated(
    persistent: float, things: int, scans: int, seed: int = 0, std: float = 1.5
) -> score_calibration.RepeatCounts:
    """Things that stand, whose logits have this share of their variance in common from scan to scan."""
    rng = np.random.default_rng(seed)
    counts = score_calibration.no_repetition()
    boxes = _steady(things)
    own = rng.normal(0.0, np.sqrt(persistent), things)
    for _ in range(scans):
        logits = 1.0 + std * (own + rng.normal(0.0, np.sqrt(1.0 - persistent), things))
        counts = score_calibration.count_repetition(counts, boxes, logits, C)
    return counts


def test_scores_of_things_have_a_meaning_and_random_ones_none():
    for seed in range(10):
        assert score_calibration.meaning(_repeated(0.6, 12, 30, seed), C) > 0.99
        assert score_calibration.meaning(_repeated(0.0, 12, 300, seed), C) < 0.5
        # A car that is parked alone, and is as surely found all the time.
        assert score_calibration.meaning(_repeated(0.0, 1, 300, seed, std=0.3), C) > 0.9
    assert score_calibration.meaning(score_calibration.no_repetition(), C) == 1.0
    # A detector with one score for all says nothing, but there is nothing against it.
    assert score_calibration.meaning(_repeated(0.0, 12, 300, 0, std=0.0), C) == 1.0


def test_scores_that_are_better_where_boxes_come_again_have_a_meaning():
    """Those of real things differ by chance alone; what is false does not come again."""
    rng = np.random.default_rng(4)
    counts = score_calibration.no_repetition()
    steady = _steady(10)
    for _ in range(100):
        stray = _stray(rng, 5)
        logits = np.concatenate([rng.normal(1.5, 1.5, 10), rng.normal(0.0, 1.5, 5)])
        counts = score_calibration.count_repetition(counts, np.concatenate([steady, stray]), logits, C)
    assert score_calibration.meaning(counts, C) > 0.99


@pytest.mark.parametrize(("things", "scans", "persistent"), [(8, 6, 0.1), (20, 20, 0.05), (12, 60, 0.0)])
def test_the_evidence_that_scores_have_a_meaning_is_that_by_integration(things, scans, persistent):
    sums = _repeated(persistent, things, scans).persistence
    n = sums.pairs
    first, second = sums.first / n, sums.second / n
    covariance = sums.product / n - first * second
    r = covariance / np.sqrt((sums.first_squared / n - first**2) * (sums.second_squared / n - second**2))
    x = np.arctanh(max(r, 0.0))

    def log_evidence(std: float) -> float:
        """Return ln ∫ N(x; m, 1/n) N(m; 0, std²) dm."""
        mean = np.linspace(-8.0 * std, 8.0 * std, 200_001)
        density = np.exp(-0.5 * n * (x - mean) ** 2 - 0.5 * (mean / std) ** 2)
        return float(np.log(np.trapezoid(density, mean) * np.sqrt(n) / std / (2.0 * np.pi)))

    want = log_evidence(1.0) - log_evidence(C.no_meaning_std)
    assert score_calibration.log_factor(sums, C) == pytest.approx(want, rel=1e-6)


@pytest.mark.parametrize(("scans", "persistent"), [(20, 0.0), (60, 0.0), (20, 0.1), (300, 0.0)])
def test_the_probability_that_scores_have_a_meaning_is_that_of_bayes(scans, persistent):
    counts = _repeated(persistent, 12, scans, std=3.0)  # so that they vary by more than is asked for
    likelihood = np.array([1.0, np.exp(score_calibration.log_factor(counts.persistence, C))])
    prior = np.array([C.no_meaning_share, 1.0 - C.no_meaning_share])
    none, some = prior * likelihood / (prior @ likelihood)
    assert none > 1e-3
    assert score_calibration.meaning(counts, C) == pytest.approx(some)


@pytest.mark.parametrize("seed", range(5))
def test_a_box_that_overlaps_a_better_one_is_less_likely_an_object(seed):
    rng = np.random.default_rng(seed)
    corner, logits = rng.uniform(0, 60, (12, 2)), rng.normal(0.0, 1.5, 12)
    boxes = np.concatenate([corner, corner + rng.uniform(10, 40, (12, 2))], axis=1)
    found = score_calibration.box_probability(boxes, logits, 0.7)
    for j, (left, top, right, bottom) in enumerate(boxes):
        apart = 1.0
        for k, other in enumerate(boxes):
            w, h = min(right, other[2]) - max(left, other[0]), min(bottom, other[3]) - max(top, other[1])
            if logits[k] > logits[j] and w > 0 and h > 0:
                areas = (right - left) * (bottom - top) + (other[2] - other[0]) * (other[3] - other[1])
                apart = min(apart, 1.0 - w * h / (areas - w * h))
        real, false = apart * np.exp(logits[j] - 0.7), 1.0
        assert found[j] == pytest.approx(real / (real + false), rel=1e-12)


def test_without_boxes_there_is_no_probability():
    assert score_calibration.box_probability(np.zeros((0, 4)), np.zeros(0), 0.0).shape == (0,)


def test_logits_of_certain_scores_are_finite():
    np.testing.assert_allclose(
        score_calibration.logit(np.array([0.0, 0.5, 1.0])), [-6.9068, 0.0, 6.9068], atol=1e-4
    )


@pytest.mark.parametrize("theta", [(12.0, -5.0, 0.0), (0.0, 0.0, 0.01), (3.0, 2.0, -0.005)])
def test_the_cameras_shift_and_scale_are_found_in_spite_of_a_stray(theta):
    rng = np.random.default_rng(1)
    centre = rng.uniform(100, 1800, (12, 2)) * [1.0, 0.55]
    boxes = np.concatenate([centre - 30.0, centre + 30.0], axis=1)
    mean, covariance = box_sides.initial_state(
        boxes, np.zeros((len(boxes), 2, 2), bool), *2 * [2.0 * np.log(0.03)], C
    )
    picture = (1920.0, 1080.0)
    moved = centre + theta[:2] + theta[2] * (centre - np.array(picture) / 2.0)
    moved[0] += 25.0
    half = 30.0 * (1.0 + theta[2])
    seen = np.concatenate([moved - half, moved + half], axis=1)
    prior = camera_motion.CameraVariance(0.04, 1e-3, np.zeros(3))
    motion, learnt = camera_motion.estimate(
        mean, covariance, seen, 2.0 * np.log(0.03), picture, 0.1, prior, C
    )
    assert motion is not None
    np.testing.assert_allclose(motion.theta / [0.6, 0.6, 1e-3], theta / np.array([0.6, 0.6, 1e-3]), atol=1.0)
    assert learnt.shift != prior.shift
    np.testing.assert_allclose(learnt.last, motion.theta / 0.1)
    after, _ = camera_motion.compensate(mean, covariance, motion, picture, 0.1, C)
    np.testing.assert_allclose(after[1:, :, singer.POSITION], moved[1:], atol=1.5)
    # What lasts of it is the tracks' own.
    share = (1.0 - np.exp(-0.1 / C.camera_time_s)) / 0.1
    gone = after[..., singer.POSITION] - mean[..., singer.POSITION]
    np.testing.assert_allclose(after[..., singer.VELOCITY], share * gone)
    np.testing.assert_allclose(after[..., singer.GROWTH], share * motion.theta[2])


def test_a_camera_that_goes_on_and_tracks_that_move_do_not_grow_against_each_other():
    """Tracks that stand, and believe to move by as much as the camera moves back: soon neither does."""
    picture, dt = (1920.0, 1080.0), 0.1
    centre = np.random.default_rng(2).uniform(300, 900, (10, 2))
    boxes = np.concatenate([centre - 30.0, centre + 30.0], axis=1)
    none, noise = np.zeros((10, 2, 2), bool), 2.0 * np.log(0.03)
    mean, covariance = box_sides.initial_state(boxes, none, noise, noise, C)
    mean[..., singer.VELOCITY] = 100.0
    covariance[..., singer.VELOCITY, singer.VELOCITY] = 1.0  # so sure of it that boxes will not tell it
    prior = camera_motion.CameraVariance(0.04, 1e-4, np.zeros(3))
    for _ in range(20):
        mean = (singer.discretise(dt, C).F @ mean[..., None])[..., 0]
        motion, prior = camera_motion.estimate(mean, covariance, boxes, noise, picture, dt, prior, C)
        assert motion is not None
        mean, _ = camera_motion.compensate(mean, covariance, motion, picture, dt, C)
    assert np.abs(mean[..., singer.VELOCITY]).max() < 10.0
    assert np.abs(motion.theta[:2]).max() < 2.0


def test_one_track_tells_nothing_of_the_camera():
    mean, covariance = box_sides.initial_state(
        np.array([[0.0, 0.0, 9.0, 9.0]]), np.zeros((1, 2, 2), bool), -5.0, -5.0, C
    )
    prior = camera_motion.initial_variance(C)
    motion, learnt = camera_motion.estimate(
        mean, covariance, np.ones((0, 4)), -5.0, (100.0, 100.0), 0.1, prior, C
    )
    assert motion is None
    assert learnt == prior


def test_a_row_of_like_objects_is_not_taken_for_its_neighbours_when_the_camera_goes_on():
    """Parked cars 40 px apart, and a camera that pans by 36 px a scan: the nearest box is a neighbour's."""
    left = np.arange(8)[:, None] * 40.0 + 200.0
    boxes = np.concatenate([left, np.full((8, 1), 100.0), left + 30.0, np.full((8, 1), 120.0)], axis=1)
    mean, covariance = box_sides.initial_state(
        boxes, np.zeros((len(boxes), 2, 2), bool), *2 * [2.0 * np.log(0.03)], C
    )
    seen = boxes + np.array([36.0, 0.0, 36.0, 0.0])
    picture = (640.0, 240.0)
    lost = camera_motion.CameraVariance(0.04, 1e-6, np.zeros(3))
    goes_on = lost._replace(last=np.array([360.0, 0.0, 0.0]))
    for prior, shift in ((lost, -4.0), (goes_on, 36.0)):
        motion, _ = camera_motion.estimate(mean, covariance, seen, 2.0 * np.log(0.03), picture, 0.1, prior, C)
        assert motion is not None
        np.testing.assert_allclose(motion.theta[0], shift, atol=3.0)
