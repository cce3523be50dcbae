"""Illuminance by sky, lamps and own lights."""

import numpy as np
import pytest

from jeat_graph_sehn.simulation.world.light import Light, LightConfig


def test_below_one_lamp_the_inverse_square_law_holds() -> None:
    light = Light(LightConfig(ambient_lux=0.0, lamp_candela=9000.0, lamp_spacing_m=1e6))
    assert light.illuminance(np.array([0.0]), np.array([0.0])) == pytest.approx([90.0], rel=1e-6)


def test_beside_a_lamp_the_cosine_law_is_added() -> None:
    light = Light(LightConfig(ambient_lux=0.0, lamp_candela=9000.0, lamp_spacing_m=1e6))
    # At as much distance aside as the lamp is high: r² = 2 h², cosine 1/√2.
    assert light.illuminance(np.array([10.0]), np.array([0.0])) == pytest.approx([90 / 2**1.5], rel=1e-6)


def test_lamps_switched_off_leave_the_sky() -> None:
    light = Light(LightConfig(ambient_lux=0.05))
    assert light.illuminance(np.zeros(3), np.arange(3.0)) == pytest.approx([0.05] * 3)


def test_headlights_show_a_vehicle_better_than_tail_lights_and_near_ones_better_than_far() -> None:
    light = Light(LightConfig(ambient_lux=0.0))
    place, no = np.zeros(4), np.zeros(4, dtype=bool)
    seen = light.visibility(
        place, place + 50, np.array([50.0, 50.0, 100.0, 100.0]), np.array([True, False, True, False]), no
    )
    assert seen == pytest.approx([3.0, 1.2, 0.75, 0.3])
