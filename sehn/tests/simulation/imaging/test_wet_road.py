"""A wet road is darker from above, mirrors the sky at low angles, and draws the lamps' streaks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from jeat_graph_sehn.simulation.imaging.config import RenderConfig
from jeat_graph_sehn.simulation.imaging.lighting import LUMINANCE
from jeat_graph_sehn.simulation.imaging.wet_road import fresnel
from jeat_graph_sehn.simulation.lens_variety import vary_wet

from .scenes import CAR, DARK, DAY, renderer_of

COMING = (0, -6.0, 40.0, -20.0, 4.4, 1.8, 1.46)
AWAY = CAR


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 75.0, 85.0, 90.0])
def test_reflectance_is_that_of_fresnel_s_equations_for_water(degrees: float) -> None:
    n, angle = 1.333, math.radians(degrees)
    inside = math.sqrt(1.0 - (math.sin(angle) / n) ** 2)
    s = (math.cos(angle) - n * inside) / (math.cos(angle) + n * inside)
    p = (inside - n * math.cos(angle)) / (inside + n * math.cos(angle))
    assert fresnel(math.cos(angle)) == pytest.approx((s * s + p * p) / 2.0, abs=0.06)


def test_a_wet_road_is_darker_near_and_mirrors_the_sky_far_away() -> None:
    dry, wet = (renderer_of([], DAY, wet=wet).background for wet in (0.0, 1.0))
    ratio = (wet.back @ LUMINANCE) / (dry.back @ LUMINANCE)
    distance = np.hypot(dry.place[..., 0], dry.place[..., 1])
    lane = (dry.lux > 0.0) & (np.abs(np.abs(dry.place[..., 0]) - 6.0) < 4.0) & (dry.front_cover == 0.0)
    assert ratio[lane & (distance < 22.0)].mean() < 1.0
    assert ratio[lane & (distance > 80.0) & (distance < 150.0)].mean() > 1.2
    beside = (np.abs(dry.place[..., 0]) > 18.0) & (dry.lux > 0.0)
    np.testing.assert_array_equal(wet.back[beside], dry.back[beside])
    assert (wet.albedo[lane] < dry.albedo[lane]).all()


@pytest.mark.parametrize(("car", "colour"), [(COMING, None), (AWAY, 0)])
def test_lamps_draw_streaks_below_their_mirror_images(car, colour) -> None:
    pictures = {}
    for wet in (0.0, 1.0):
        for rows in ([car], []):
            made = renderer_of(rows, DARK, wet=wet)
            pictures[wet, len(rows)] = made.picture(0.0)
    streak = (pictures[1.0, 1] - pictures[1.0, 0]) - (pictures[0.0, 1] - pictures[0.0, 0])
    camera = made.scene.camera
    ahead = 0.5 * car[4] * (1.0 if car[3] > 0 else -1.0)
    # Lamps at the end that is seen: heads of the one that comes, tails of the one that goes.
    lamp = np.array([[car[1], car[2] - abs(ahead), 0.7], [car[1], car[2] - abs(ahead), -0.7]])
    (u, v), (_, mirrored) = camera.project(lamp)[0]
    light = np.maximum(streak @ LUMINANCE, 0.0)
    near = light[round(mirrored) - 1 : round(mirrored) + 2, round(u) - 6 : round(u) + 7].max()
    assert near > 0.0
    assert light[: round(v) - 6].max() < 0.05 * light.max()  # nothing above the vehicle
    if colour is not None:
        at = streak[round(mirrored), round(u) - 6 : round(u) + 7].sum(axis=0)
        assert at.argmax() == colour  # tail lamps draw red
        assert at[colour] > 3.0 * np.delete(at, colour).max()


def test_by_day_without_lamps_a_vehicle_adds_no_streak() -> None:
    made = renderer_of([AWAY], DAY, wet=1.0)
    plan = made.plan(0.0, 0.0)
    dry = renderer_of([AWAY], DAY).plan(0.0, 0.0)
    np.testing.assert_array_equal(plan.boxes[:, 0], dry.boxes[:, 0])


def test_rain_makes_most_roads_wet_and_clear_air_few() -> None:
    def share(fog: float) -> float:
        drawn = [vary_wet(np.random.default_rng(k), RenderConfig(fog_m=fog)).wet for k in range(300)]
        assert all(wet == 0.0 or 0.4 <= wet <= 1.0 for wet in drawn)
        return float(np.mean([wet > 0.0 for wet in drawn]))

    assert share(300.0) == pytest.approx(0.6, abs=0.1)
    assert share(0.0) == pytest.approx(0.1, abs=0.06)
    assert vary_wet(np.random.default_rng(0), RenderConfig(wet=0.3)).wet == 0.3
