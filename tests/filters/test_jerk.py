"""The density of a track's jerk."""

import numpy as np
import pytest

from jeat_graph.filters.jerk import common_growth, jerk_density, track_jerk


def test_without_growth_it_is_the_drivers_alone():
    assert jerk_density(40.0, 0.0, 3.0, 0.5, 7.0) == pytest.approx(3.0 + 0.5 * 40.0)


def test_the_parts_add_as_independent_noises_do():
    drivers, perspective = 3.0 + 0.5 * 40.0, 7.0 * 40.0 * 1.5**2.5
    for growth in (1.5, -1.5):
        assert jerk_density(40.0, growth, 3.0, 0.5, 7.0) == pytest.approx(np.hypot(drivers, perspective))


def test_perspective_has_the_scale_of_a_vehicle_that_passes():
    """Size and place go with 1 / (t0 - t): the true third derivative over the density's scale is constant."""
    t0 = 3.0
    t = np.array([0.0, 1.0, 2.0, 2.5])
    size, growth = 50.0 / (t0 - t), 1.0 / (t0 - t)
    third = 6.0 * 50.0 / (t0 - t) ** 4
    # A jerk of this size for about 1 / growth is a white process of density jerk · growth^-1/2.
    density = [jerk_density(s, g, 0.0, 0.0, 1.0) for s, g in zip(size, growth, strict=True)]
    assert third / np.sqrt(growth) / density == pytest.approx(np.full(4, 6.0))


def test_a_runaway_size_or_growth_stays_finite():
    wild = np.array([[1e6, 1e9], [1e6, -1e3]])
    assert np.isfinite(track_jerk(wild, 1.0, 1.0, 1.0, 1.0))


def test_beyond_a_growth_of_four_a_second_it_grows_no_more():
    fastest = jerk_density(40.0, 4.0, 3.0, 0.5, 7.0)
    assert fastest > jerk_density(40.0, 3.9, 3.0, 0.5, 7.0)
    assert jerk_density(40.0, 4.1, 3.0, 0.5, 7.0) == jerk_density(40.0, -1e3, 3.0, 0.5, 7.0) == fastest


def test_a_calm_track_has_a_part_of_it():
    size = np.array([[4.0, 0.3], [3.0, 0.1]])
    full = track_jerk(size, 1.0, 0.5, 2.0, 1.0)
    assert full == pytest.approx(jerk_density(np.exp(3.5), 0.1, 1.0, 0.5, 2.0))
    assert track_jerk(size, 1.0, 0.5, 0.0, 0.1) == pytest.approx(0.1 * (1.0 + 0.5 * np.exp(3.5)))


def test_perspective_is_not_calm_but_a_manoeuvre_is_more_of_all():
    """However calmly a car drives past: its image jerks by the growth of its distances."""
    size = np.array([[4.0, 0.6], [4.0, 0.6]])
    perspective = jerk_density(np.exp(4.0), 0.6, 0.0, 0.0, 2.0)
    assert track_jerk(size, 0.0, 0.5, 2.0, 0.1) == pytest.approx(
        np.hypot(0.1 * 0.5 * np.exp(4.0), perspective)
    )
    assert track_jerk(size, 1.0, 0.5, 2.0, 3.0) == pytest.approx(3.0 * track_jerk(size, 1.0, 0.5, 2.0, 1.0))


@pytest.mark.parametrize(
    ("width", "height", "growth"),
    [
        (0.4, 0.4, 0.4),
        (0.4, 0.1, 0.1),
        (-0.2, -0.5, -0.2),
        (0.4, -0.1, 0.0),
        (-0.3, 0.2, 0.0),
        (0.7, 0.0, 0.0),
    ],
)
def test_only_what_both_sides_share_is_approach(width, height, growth):
    assert common_growth(width, height) == growth
    assert common_growth(height, width) == growth


def test_a_walker_whose_arms_swing_is_not_taken_for_one_that_comes_near():
    walks, swings = np.array([[4.0, 0.0], [5.0, 0.0]]), np.array([[4.0, 0.9], [5.0, -0.05]])
    assert track_jerk(swings, 0.0, 1.0, 10.0, 1.0) == track_jerk(walks, 0.0, 1.0, 10.0, 1.0)
