from __future__ import annotations

import math

import numpy as np
import pytest

from jeat_graph_sehn.simulation.imaging.config import RGBConfig
from jeat_graph_sehn.simulation.imaging.rgb_camera import choose_exposure, develop, electrons, expose

from .scenes import CAR, DARK, DAY, renderer_of


@pytest.mark.parametrize("mean", [0.0, 3.0, 80.0, 4000.0])
def test_mean_and_variance_follow_the_photon_transfer_curve(mean: float) -> None:
    config = RGBConfig(read_noise_e=4.0)
    radiance = np.full((200, 200, 3), mean / (config.responsivity * 0.01))
    charge = electrons(radiance, 0.01, config, np.random.default_rng(1))
    variance = mean + 16.0
    assert charge.mean() == pytest.approx(mean, abs=5.0 * math.sqrt(variance / charge.size))
    # The variance of a sample variance is about 2 σ⁴ / n; a Poisson's tails are not far from normal.
    assert charge.var() == pytest.approx(variance, rel=6.0 * math.sqrt(2.0 / charge.size))


def test_noise_of_few_photoelectrons_has_their_skewness_beside_read_noise() -> None:
    config = RGBConfig(read_noise_e=3.0)
    for mean in (1.0, 6.0, 15.0):
        radiance = np.full((400, 400, 3), mean / (config.responsivity * 0.01))
        charge = electrons(radiance, 0.01, config, np.random.default_rng(1)).ravel()
        z = (charge - charge.mean()) / charge.std()
        # Cumulants of a sum add up, and all of a Poisson's are its mean. Sample skewness spreads by √(6 / n).
        assert (z**3).mean() == pytest.approx(
            mean / (mean + 9.0) ** 1.5, abs=5.0 * math.sqrt(6.0 / z.size) + 0.005
        )
        assert (z**4).mean() - 3.0 == pytest.approx(mean / (mean + 9.0) ** 2, abs=0.04)


def test_a_full_well_holds_no_more() -> None:
    config = RGBConfig(read_noise_e=0.0)
    charge = electrons(np.full((10, 10, 3), 1e9), 0.01, config, np.random.default_rng(0))
    assert (charge == config.full_well_e).all()
    assert (develop(charge, 1.0, config) == 255).all()


def test_development_is_gain_gamma_and_rounding() -> None:
    config = RGBConfig(full_well_e=1000.0, gamma=2.2)
    charge = np.array([-20.0, 0.0, 10.0, 100.0, 400.0, 1000.0])
    expected = [round(255.0 * min(max(2.0 * c / 1000.0, 0.0), 1.0) ** (1.0 / 2.2)) for c in charge]
    assert list(develop(charge, 2.0, config)) == expected


def test_exposure_is_short_by_day_and_long_at_night() -> None:
    config = RGBConfig()
    day = choose_exposure(config, np.full((20, 20, 3), 600.0))
    night = choose_exposure(config, np.full((20, 20, 3), 0.01))
    assert day.time_s == pytest.approx(0.18 * 12000.0 / (10000.0 * 600.0))
    assert day.gain == 1.0
    assert (night.time_s, night.gain) == (0.02, 16.0)


def test_an_exposure_is_the_mean_of_the_pictures_within_it() -> None:
    renderer = renderer_of([CAR, (3, -6.0, 30.0, -22.0, 10.0, 2.5, 3.6)])
    blurred = expose(renderer, 0.2, 0.03, 0.0)
    instants = 0.2 - 0.015 + 0.03 * (np.arange(60) + 0.5) / 60
    brute = np.mean([renderer.picture(t) for t in instants], axis=0)
    moved = np.abs(brute - renderer.background.whole) > 10.0
    assert moved.sum() > 500
    difference = np.abs(blurred - brute) / brute.mean()
    assert difference.mean() < 0.002
    assert np.percentile(difference[moved], 95) < 0.12


def test_motion_blur_is_as_long_as_speed_times_exposure() -> None:
    # The image of a lamp at constant speed is the unblurred one convolved with a line of length l, which
    # adds l²/12 to its variance. Only tail lamps are lit, so that there is but one image.
    car = (0, 4.0, 22.0, 18.0, 4.4, 1.8, 1.46)
    renderer = renderer_of([car], DARK, 640, 384, glare_share=0.0, headlight_candela=1e-9)
    exposure = 0.08
    moments = renderer.moments(np.array([0.0, -0.5 * exposure, 0.5 * exposure]), renderer.plan(0.0, 0.0).look)
    expected = float(np.hypot(*(moments.lamp[2, 0, 2, :2] - moments.lamp[1, 0, 2, :2])))
    lengths = []
    for time in (1e-6, exposure):
        image = np.maximum(expose(renderer, 0.0, time, 0.0)[..., 0] - 0.5, 0.0)
        u, v = moments.lamp[0, 0, 2, :2]
        other = moments.lamp[0, 0, 3, 0]
        rows, columns = np.mgrid[0 : image.shape[0], 0 : image.shape[1]] + 0.5
        near = (np.abs(columns - u) < abs(other - u) / 2.0) & (np.abs(rows - v) < 40)
        weight = np.where(near, image, 0.0) / image[near].sum()
        variance = sum(float((weight * (a - (weight * a).sum()) ** 2).sum()) for a in (rows, columns))
        lengths.append(variance)
    assert expected > 8.0
    assert math.sqrt(12.0 * (lengths[1] - lengths[0])) == pytest.approx(expected, rel=0.06)


def test_a_rolling_shutter_exposes_lower_rows_later() -> None:
    renderer = renderer_of([(2, 4.0, 18.0, 25.0, 5.6, 2.0, 2.4)], DAY)
    time, readout = 0.1, 0.02
    rolling = expose(renderer, time, 1e-4, readout)
    height = rolling.shape[0]
    for row in (16, 32, 64):
        middle = min(row + 4.0, height)
        at = time + readout * (middle / height - 0.5)
        instant = renderer.picture(at)
        earlier = renderer.picture(at - 0.01)
        band = slice(row, row + 8)
        right = np.abs(rolling[band] - instant[band]).mean()
        assert right < 0.2 * np.abs(rolling[band] - earlier[band]).mean() + 1e-9
