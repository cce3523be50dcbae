"""The sorted sweep lists exactly the pairs that a look at all pairs lists."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal, multivariate_t

from jeat_graph.association.densities import Likelihood, log_constants, log_density_of
from jeat_graph.association.gates import Expected, Found, gated_pairs
from jeat_graph.filters.cut_boxes import BOTH_CUT, HIGH_CUT, LOW_CUT

NORMAL = Likelihood(0.0, 3.0)


def random_scene(rng, tracks, dets, sensors=2, width=300.0):
    """Arguments of `gated_pairs` up to the gates."""
    lasting_std = rng.uniform(0.5, 5.0, (tracks, sensors, 2))
    position_var = rng.uniform(1.0, 60.0, (tracks, sensors, 2))
    shared = rng.uniform(-0.9, 0.9, (tracks, sensors, 2)) * lasting_std * np.sqrt(position_var)
    usual_std = lasting_std * rng.uniform(1.0, 2.0, shared.shape)
    shift = rng.normal(0.0, 4.0, shared.shape)
    lasting = np.stack([shift, 2.0 * shared, lasting_std**2], axis=-1)
    expected = Expected(
        rng.uniform(0.0, width, (tracks, 1, 2)) + rng.normal(0.0, 2.0, (tracks, sensors, 2)),
        position_var + 2.0 * shared + lasting_std**2,
        lasting,
        rng.uniform(1.0, 30.0, (tracks, sensors, 2)),
        usual_std,
        rng.normal(4.0, 0.3, (tracks, 2)),
        rng.uniform(0.001, 0.05, (tracks, 2)),
        rng.uniform(0.005, 0.05, (sensors, 2)),
        np.zeros((tracks, 2), dtype=np.int64),
    )
    found = Found(
        rng.uniform(0.0, width, (dets, 2)),
        rng.normal(4.0, 0.3, (dets, 2)),
        rng.uniform(1.0, 10.0, dets),
        rng.uniform(0.2, 3.0, dets),
        rng.integers(0, sensors, dets),
        np.zeros((dets, 2), dtype=np.int64),
        np.zeros((dets, 2)),
    )
    return expected, found, NORMAL


def all_pairs(expected, found, _, gate, size_gate):
    position, var, lasting, noise, usual, log_size, size_var, size_noise, _ = expected
    z, z_size, weight, spread, sensor, _, _ = found
    out = []
    for i in range(len(position)):
        for j in range(len(z)):
            s, f = sensor[j], spread[j]
            c, (shift, shared, own) = min(f, 1.0), lasting[i, s].T
            centre = position[i, s] - (1.0 - c) * shift
            # What the track's own place has, and the part of the lasting error that this detection shows.
            S = (var[i, s] - shared - own) + c * shared + c**2 * own
            S += (f**2 * noise[i, s] + (f**2 - c**2) * usual[i, s] ** 2) * weight[j]
            d2 = ((z[j] - centre) ** 2 / S).sum()
            V = size_var[i] + f**2 * size_noise[s]
            size_d2 = ((z_size[j] - log_size[i]) ** 2 / V).sum()
            if d2 <= gate and size_d2 <= size_gate:
                density = multivariate_normal.logpdf(z[j], centre, np.diag(S))
                size_density = multivariate_normal.logpdf(z_size[j], log_size[i], np.diag(V))
                out.append((i, j, d2, density, size_density))
    return out


@pytest.mark.parametrize("gates", [(9.21, 9.21), (9.21, np.inf), (55.0, 55.0)])
@pytest.mark.parametrize(("tracks", "dets"), [(0, 0), (0, 5), (5, 0), (1, 1), (7, 3), (40, 60)])
def test_lists_the_pairs_of_a_look_at_all_pairs(tracks, dets, gates):
    for seed in range(5):
        scene = random_scene(np.random.default_rng(seed), tracks, dets)
        expected = all_pairs(*scene, *gates)
        rows, cols, d2, density, size_density = gated_pairs(*scene, *gates)
        assert list(zip(rows, cols, strict=True)) == [pair[:2] for pair in expected]
        found = np.column_stack([d2, density, size_density])
        assert np.allclose(found, np.array([pair[2:] for pair in expected]).reshape(-1, 3), rtol=1e-9)


@given(seed=st.integers(0, 10**6), tracks=st.integers(0, 12), dets=st.integers(0, 12))
@settings(max_examples=60, deadline=None)
def test_pairs_ascend_by_track_then_detection(seed, tracks, dets):
    # In a small picture nearly everything is gated, which is more than the first allocation holds.
    scene = random_scene(np.random.default_rng(seed), tracks, dets, width=5.0)
    rows, cols, *_ = gated_pairs(*scene, 60.0, np.inf)
    pairs = list(zip(rows.tolist(), cols.tolist(), strict=True))
    assert pairs == sorted(set(pairs))


def test_more_pairs_than_rows_and_columns_are_all_kept():
    scene = random_scene(np.random.default_rng(0), 50, 50, width=1.0)
    rows, cols, *_ = gated_pairs(*scene, 100.0, np.inf)
    assert len(rows) == 2500
    assert np.array_equal(rows, np.repeat(np.arange(50), 50))
    assert np.array_equal(cols, np.tile(np.arange(50), 50))


def test_a_detection_on_the_gate_is_inside():
    one, flat, none = np.ones((1, 2)), np.zeros((1, 2)), np.zeros((1, 2), dtype=np.int64)
    z = np.array([[6.0, 0.0]])
    arguments = (
        Expected(flat[None], one[None], np.zeros((0, 0, 0, 0)), one[None], flat[None], flat, one, one, none),
        Found(z, flat, np.ones(1), np.ones(1), none[0, :1], none, flat),
        NORMAL,
    )
    assert len(gated_pairs(*arguments, 18.0, np.inf)[0]) == 1
    assert len(gated_pairs(*arguments, 17.999, np.inf)[0]) == 0


@pytest.mark.parametrize("dims", [1, 2])
@pytest.mark.parametrize("freedom", [3.0, 5.0, 30.0])
def test_heavy_tails_are_students_t_of_the_same_covariance(dims, freedom):
    rng = np.random.default_rng(0)
    for _ in range(5):
        S, y = rng.uniform(0.5, 9.0, dims), rng.normal(0.0, 6.0, dims)
        shape = np.diag(S) * (freedom - 2.0) / freedom
        expected = multivariate_t(np.zeros(dims), shape, df=freedom).logpdf(y)
        d2, det = float((y**2 / S).sum()), float(S.prod())
        found = log_density_of(d2, det, dims, freedom, log_constants(freedom))
        assert found == pytest.approx(expected, rel=1e-9)


def one_cut(cut, side, shown, centre=100.0, width=80.0, size_var=0.04, last_cut=0, position_var=4.0):
    """Pairs of one track 80 px wide around x = 100 with one detection cut along x, of which `side` shows."""
    track = Expected(
        np.array([[[centre, 50.0]]]),
        np.full((1, 1, 2), position_var),
        np.zeros((0, 0, 0, 0)),
        np.full((1, 1, 2), 5.0),
        np.zeros((1, 1, 2)),
        np.log([[width, 40.0]]),
        np.full((1, 2), size_var),
        np.full((1, 2), 0.01),
        np.array([[last_cut, 0]]),
    )
    middle = side - 0.5 * shown if cut == LOW_CUT else side + 0.5 * shown
    found = Found(
        np.array([[middle, 50.0]]),
        np.log([[shown, 40.0]]),
        np.ones(1),
        np.ones(1),
        np.zeros(1, dtype=np.int64),
        np.array([[cut, 0]]),
        np.array([[side, 0.0]]),
    )
    return gated_pairs(track, found, NORMAL, 55.0, 55.0)


@pytest.mark.parametrize(("cut", "side"), [(LOW_CUT, 143.0), (HIGH_CUT, 57.0)])
def test_a_cut_box_is_judged_by_the_side_that_shows(cut, side):
    pairs = one_cut(cut, side, 25.0)
    # 3 px off where the track's other side should be; half a width's spread is 40 px times .2.
    S = 4.0 + 5.0 + 40.0**2 * 0.04
    assert pairs.d2[0] == pytest.approx(9.0 / S)
    assert pairs.log_density[0] == pytest.approx(
        multivariate_normal.logpdf([3.0, 0.0], [0, 0], np.diag([S, 9.0]))
    )


def test_a_part_that_shows_says_no_more_of_the_size_than_clutter_would():
    height = -0.5 * np.log(2.0 * np.pi * 0.05)
    assert one_cut(LOW_CUT, 140.0, 25.0).log_size_density[0] == pytest.approx(height - np.log(3.0))


def test_a_part_larger_than_the_whole_is_a_difference_in_size():
    pairs = one_cut(LOW_CUT, 140.0, 100.0)
    e, V = np.log(100.0 / 80.0), 0.05
    expected = multivariate_normal.logpdf([e, 0.0], [0, 0], np.diag([V, V]))
    assert pairs.log_size_density[0] == pytest.approx(expected)


def test_a_box_cut_on_both_sides_may_belong_to_any_place():
    far = one_cut(BOTH_CUT, 0.0, 1000.0, centre=700.0, width=1500.0)
    near = one_cut(BOTH_CUT, 0.0, 1000.0, centre=500.0, width=1500.0)
    assert far.d2[0] == near.d2[0] == 0.0
    assert far.log_density[0] == near.log_density[0]


def test_a_track_that_was_cut_in_the_same_way_is_compared_by_the_side_that_shows():
    """Its centre comes from that side and that size: the error of the size is in both and cancels."""
    size_var = 0.25
    from_size = 40.0**2 * size_var
    known = {"size_var": size_var, "position_var": from_size + 9.0}
    same = one_cut(LOW_CUT, 140.0 + 3.0, 60.0, last_cut=LOW_CUT, **known)
    entering = one_cut(LOW_CUT, 140.0 + 3.0, 60.0, last_cut=0, **known)
    y_part = -0.5 * np.log(2.0 * np.pi * (from_size + 9.0 + 5.0))
    for pairs, var in ((same, 9.0 + 5.0), (entering, from_size + 9.0 + 5.0 + from_size)):
        x_part = -0.5 * (3.0**2 / var + np.log(2.0 * np.pi * var))
        assert pairs.log_density[0] == pytest.approx(x_part + y_part, rel=1e-9)


def test_the_side_is_known_no_better_than_a_box_measures_it():
    same = one_cut(HIGH_CUT, 60.0, 60.0, last_cut=HIGH_CUT, size_var=0.25, position_var=400.0)
    y_part = -0.5 * np.log(2.0 * np.pi * 405.0)
    assert same.log_density[0] == pytest.approx(y_part - 0.5 * np.log(2.0 * np.pi * 10.0), rel=1e-9)


@pytest.mark.parametrize(("cut", "side"), [(LOW_CUT, 140.0), (HIGH_CUT, 60.0)])
def test_of_a_vehicle_that_shows_more_than_its_known_size_the_centre_is_that_of_what_shows(cut, side):
    """Known to be 20 px wide, it shows 80 px: where the filter takes it in, the gate looks for it."""
    there = one_cut(cut, side, 80.0, centre=100.0, width=20.0, size_var=0.3)
    assert there.d2 == pytest.approx(0.0, abs=1e-20)
    off = one_cut(cut, side, 80.0, centre=97.0, width=20.0, size_var=0.3)
    assert off.d2[0] == pytest.approx(9.0 / (4.0 + 5.0 + 40.0**2 * 0.3))


def cut_residual(scene, i, j, axis):
    """Difference of detection j from track i along an axis, and its variance, for one that is cut or not."""
    expected, found, _ = scene
    s, weight, f = found.sensor[j], found.weight[j], found.spread[j]
    shift, shared, own = expected.lasting[i, s, axis]
    usual = expected.coloured_std[i, s, axis]
    c = min(f, 1.0)
    var = expected.position_var[i, s, axis] - shared - own + c * shared + c**2 * own
    var += (f**2 * expected.noise[i, s, axis] + (f**2 - c**2) * usual**2) * weight
    centre, cut = found.z[j, axis], found.cut[j, axis]
    if cut == BOTH_CUT:
        return 0.0, var + np.exp(found.log_size[j, axis]) ** 2 / (2.0 * np.pi)
    if cut:
        half = 0.5 * np.exp(max(expected.log_size[i, axis], found.log_size[j, axis]))
        centre = found.side[j, axis] + (half if cut == HIGH_CUT else -half)
        var += half**2 * expected.log_size_var[i, axis]
    return centre - expected.position[i, s, axis] + (1.0 - c) * shift, var


def test_no_pair_with_a_box_that_is_cut_lies_outside_the_window():
    """The sweep over sorted places must reach as far as the gates do, whatever shows of whatever size."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        expected, found, _ = scene = random_scene(rng, 15, 15)
        expected.log_size[:] = rng.uniform(2.5, 5.0, expected.log_size.shape)
        expected.log_size_var[:] = rng.uniform(0.001, 0.5, expected.log_size.shape)
        found.log_size[:] = rng.uniform(2.5, 5.0, found.log_size.shape)
        found.cut[:] = rng.choice([0, LOW_CUT, HIGH_CUT], found.cut.shape)
        sign = np.where(found.cut == LOW_CUT, 0.5, -0.5)
        found.side[:] = found.z + sign * np.exp(found.log_size)
        expect = []
        for i in range(15):
            for j in range(15):
                parts = [cut_residual(scene, i, j, axis) for axis in range(2)]
                d2 = sum(y * y / S for y, S in parts)
                if d2 <= 9.21:
                    expect.append((i, j, d2))
        rows, cols, d2, *_ = gated_pairs(*scene, 9.21, np.inf)
        assert list(zip(rows, cols, strict=True)) == [pair[:2] for pair in expect]
        assert np.allclose(d2, [pair[2] for pair in expect], rtol=1e-9)
        assert len(expect) > 0
