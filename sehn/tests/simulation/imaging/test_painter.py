from __future__ import annotations

import numpy as np
import pytest

from jeat_graph_sehn.simulation.imaging.air import airlight
from jeat_graph_sehn.simulation.imaging.lighting import LUMINANCE
from jeat_graph_sehn.simulation.imaging.moments import BOX, HULL, SIDES
from jeat_graph_sehn.simulation.imaging.smooth import clamp01
from jeat_graph_sehn.simulation.imaging.visibility import buffers
from jeat_graph_sehn.simulation.world.light import LightConfig
from jeat_graph_sehn.simulation.world.surroundings import FIXED

from .scenes import CAR, DARK, DAY, LAMPS, renderer_of

OTHERS = [CAR, (1, -4.0, 30.0, -25.0, 4.7, 1.9, 1.72), (3, 9.0, 26.0, 22.0, 11.0, 2.5, 3.7)]


def outline_of(body: np.ndarray) -> np.ndarray:
    """Half-planes (sides, 3) of a body's outline."""
    return body[HULL : HULL + 3 * int(body[SIDES])].reshape(-1, 3)


@pytest.mark.parametrize("light", [DAY, LAMPS, DARK])
def test_without_vehicles_there_is_the_static_picture(light: LightConfig) -> None:
    renderer = renderer_of([], light)
    np.testing.assert_array_equal(renderer.picture(0.0), renderer.background.whole)


@pytest.mark.parametrize("light", [DAY, LAMPS, DARK])
def test_radiance_is_finite_and_not_negative(light: LightConfig) -> None:
    picture = renderer_of(OTHERS, light).picture(0.3)
    assert np.isfinite(picture).all()
    assert (picture >= 0.0).all()


@pytest.mark.parametrize("bridge_m", [18.0, 30.0, 45.0])
def test_in_a_bridge_s_shadow_a_vehicle_takes_no_more_light_than_there_is(bridge_m: float) -> None:
    """There is no sun to take: what is left beside the vehicle is a quarter of the sky's light and more."""
    around = FIXED._replace(bridges_m=(bridge_m,), bridge_wide_m=12.0)
    alone = renderer_of([], DAY, around=around)
    ground = alone.background
    dim = (ground.lux > 0.0) & (ground.lux < 0.5 * ground.lux.max()) & (ground.front_cover == 0.0)
    lane = dim & (np.abs(ground.place[..., 0] - 4.0) < 1.0)
    row = (0, 4.0, float(np.median(ground.place[lane][:, 1])), 0.0, 4.4, 1.8, 1.46)
    shaded = renderer_of([row], DAY, around=around)
    look, moments = shaded.seen_at(0.0)
    _, instance, _ = buffers(moments, look, ground.front_depth, ground.front_cover)
    dim &= instance == 0
    before, after = (one.picture(0.0)[dim] @ LUMINANCE for one in (alone, shaded))
    assert (after < 0.9 * before).any()
    assert (after >= 0.24 * before).all()


def test_what_is_dark_is_dark() -> None:
    road = [
        float(np.median(renderer_of(OTHERS, light).picture(0.0)[60:] @ LUMINANCE))
        for light in (DAY, LAMPS, DARK)
    ]
    assert road[0] > 100.0 * road[1] > 1000.0 * road[2]


def test_the_road_has_the_luminance_of_a_diffuse_surface() -> None:
    renderer = renderer_of([], DAY)
    ground = renderer.background
    bare = (ground.front_cover == 0.0) & (ground.lux == ground.lux.max())
    luminance, albedo = ground.back[bare] @ LUMINANCE, ground.albedo[bare] @ LUMINANCE
    np.testing.assert_allclose(luminance, albedo * 20000.0 / np.pi, rtol=0.02)


def test_street_lamps_light_the_road_as_the_scene_says() -> None:
    renderer = renderer_of([], LAMPS)
    ground = renderer.background
    near = (ground.front_cover == 0.0) & (ground.lux > 0.0)
    near &= (ground.place[..., 1] < 80.0) & (np.abs(ground.place[..., 0]) < 15.0)
    expected = renderer.scene.light.illuminance(ground.place[near, 0], ground.place[near, 1])
    # Lamps beyond the last one by which the scene counts add a little.
    np.testing.assert_allclose(ground.lux[near], expected, rtol=0.03)


@pytest.mark.parametrize("light", [DAY, LAMPS, DARK])
def test_radiance_changes_continuously_with_motion(light: LightConfig) -> None:
    renderer = renderer_of(OTHERS, light)
    start = np.log(renderer.picture(0.5) @ LUMINANCE + 0.005)
    change = [
        float(np.abs(np.log(renderer.picture(0.5 + dt) @ LUMINANCE + 0.005) - start).max())
        for dt in (4e-4, 1e-4)
    ]
    # A jump would stay when the step is made smaller.
    assert change[1] < 0.4 * change[0]


def test_a_bodys_cover_is_the_part_of_the_pixel_within_its_outline() -> None:
    renderer = renderer_of([CAR], DAY)
    moments = renderer.moments(np.array([0.0]), renderer.plan(0.0, 0.0).look)
    sides = outline_of(moments.body[0, 0, 1])
    box = moments.body[0, 0, 1, BOX : BOX + 4]
    fine = (np.arange(24) + 0.5) / 24
    worst, total = 0.0, [0.0, 0.0]
    for row in range(int(box[1]), int(box[3]) + 1):
        for column in range(int(box[0]), int(box[2]) + 1):
            u, v = np.meshgrid(column + fine, row + fine)
            inside = np.all([s[0] * u + s[1] * v + s[2] >= 0.5 for s in sides], axis=0).mean()
            cover = np.prod([clamp01(s[0] * (column + 0.5) + s[1] * (row + 0.5) + s[2]) for s in sides])
            worst = max(worst, abs(cover - inside))
            total[0] += cover
            total[1] += inside
    assert worst < 0.2
    assert total[0] == pytest.approx(total[1], rel=0.02)


def test_headlights_flare_over_more_pixels_than_they_cover() -> None:
    rows = [(0, -6.0, 40.0, -25.0, 4.4, 1.8, 1.46)]
    with_glow = renderer_of(rows, DARK).picture(0.0) @ LUMINANCE
    without = renderer_of(rows, DARK, glare_share=0.0).picture(0.0) @ LUMINANCE
    assert (with_glow > 1.0).sum() > 2 * (without > 1.0).sum() > 0


def test_beams_light_the_road_before_a_vehicle_and_not_behind_it() -> None:
    renderer = renderer_of([CAR], DARK, glare_share=0.0, taillight_candela=0.0)
    gain = (renderer.picture(0.0) - renderer.background.whole) @ LUMINANCE
    x, y = renderer.background.place[..., 0], renderer.background.place[..., 1]
    road = (renderer.background.lux > 0.0) & (np.abs(x - CAR[1]) < 1.0)
    assert gain[road & (y > 46.0) & (y < 60.0)].min() > 0.0
    assert np.abs(gain[road & (y > 20.0) & (y < 34.0)]).max() == 0.0


def test_a_vehicle_hides_what_is_behind_it() -> None:
    hidden = (0, 9.0, 42.0, 20.0, 4.4, 1.7, 1.4)
    truck = (3, 9.0, 26.0, 20.0, 12.0, 2.5, 3.9)
    alone = renderer_of([truck], DAY, headlights_below_lux=0.0).picture(0.0)
    both = renderer_of([truck, hidden], DAY, headlights_below_lux=0.0)
    moments = both.moments(np.array([0.0]), both.plan(0.0, 0.0).look)
    outline = outline_of(moments.body[0, 0, 1])
    rows, columns = np.mgrid[0:112, 0:192] + 0.5
    inside = np.all([s[0] * columns + s[1] * rows + s[2] >= 1.0 for s in outline], axis=0)
    assert inside.sum() > 100
    np.testing.assert_array_equal(both.picture(0.0)[inside], alone[inside])


def test_fog_takes_contrast_away_by_the_law_of_koschmieder() -> None:
    white, black = (renderer_of([CAR], DAY, fog_m=fog, headlights_below_lux=0.0) for fog in (0.0, 60.0))
    clear, foggy = white.picture(0.0) @ LUMINANCE, black.picture(0.0) @ LUMINANCE
    moments = white.moments(np.array([0.0]), white.plan(0.0, 0.0).look)
    body = moments.body[0, 0, 1]
    rows, columns = np.mgrid[0:112, 0:192] + 0.5
    inside = np.all([s[0] * columns + s[1] * rows + s[2] >= 1.0 for s in outline_of(body)], axis=0)
    # The body is 37.8 to 42.2 m away; at 60 m contrast is 2 %.
    left = 0.02 ** (39.0 / 60.0)
    air = airlight(black.lights) @ LUMINANCE
    expected = clear[inside].mean() * left + air * (1.0 - left)
    assert foggy[inside].mean() == pytest.approx(expected, rel=0.03)


def test_fog_takes_contrast_from_shadows_as_from_what_stands_there() -> None:
    clear, foggy = (
        renderer_of([CAR], DAY, fog_m=fog, headlight_candela=0.0, taillight_candela=0.0)
        for fog in (0.0, 60.0)
    )
    change = [(r.picture(0.0) - r.background.whole) @ LUMINANCE for r in (clear, foggy)]
    ground = clear.background
    # Shaded ground beside the car, none of whose pixels it covers.
    body = clear.moments(np.array([0.0]), clear.plan(0.0, 0.0).look).body[0, 0]
    seen = body[body[:, SIDES] > 0.0]
    rows, columns = np.mgrid[0:112, 0:192] + 0.5
    beside = (
        (columns < seen[:, BOX].min()) | (columns > seen[:, BOX + 2].max()) | (rows > seen[:, BOX + 3].max())
    )
    shaded = beside & (ground.front_cover == 0.0) & (change[0] < -0.2 * ground.whole @ LUMINANCE)
    assert shaded.sum() > 10
    eye = clear.view.eye
    away = np.linalg.norm(
        np.concatenate([ground.place - eye[:2], 0 * ground.lux[..., None] - eye[2]], axis=2), axis=2
    )
    left = 0.02 ** (away[shaded] / 60.0)
    np.testing.assert_allclose(change[1][shaded], change[0][shaded] * left, rtol=0.02)


def test_corners_are_darker_by_the_fourth_power_of_the_cosine() -> None:
    plain, dark = (renderer_of([], DAY, vignetting=v) for v in (0.0, 1.0))
    ratio = dark.picture(0.0)[0, 0] / plain.picture(0.0)[0, 0]
    lens = plain.view.lens
    across, down = (0.5 - lens[2]) / lens[0], (0.5 - lens[3]) / lens[1]
    np.testing.assert_allclose(ratio, (1.0 + across**2 + down**2) ** -2, rtol=1e-9)
