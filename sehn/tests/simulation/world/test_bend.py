"""Motion on a bent road against differences of the bent places."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph_sehn.simulation.imaging.rays import road_place
from jeat_graph_sehn.simulation.world.bend import bend_motion, bend_points


@pytest.mark.parametrize("curvature", [1.0 / 700.0, -1.0 / 450.0])
def test_velocity_and_acceleration_are_the_derivatives_of_the_place(curvature: float) -> None:
    dt = 1e-3
    t = np.array([-dt, 0.0, dt])
    x, y, turn = 4.0 + 0.7 * t - 0.3 * t**2, 60.0 + 28.0 * t - 1.5 * t**2, 0.02 + 0.01 * t
    zero = np.zeros(3)
    pose = np.column_stack([x, y, turn])
    velocity = np.column_stack([0.7 - 0.6 * t, 28.0 - 3.0 * t, 0.01 + zero])
    acceleration = np.column_stack([-0.6 + zero, -3.0 + zero, zero])
    p, v, a = bend_motion(pose, velocity, acceleration, curvature)
    np.testing.assert_allclose((p[2] - p[0]) / (2 * dt), v[1], atol=1e-5)
    np.testing.assert_allclose((v[2] - v[0]) / (2 * dt), a[1], atol=1e-4)


@pytest.mark.parametrize("curvature", [0.0, 1.0 / 500.0, -1.0 / 900.0])
def test_a_place_on_the_road_is_found_again(curvature: float) -> None:
    for x, y in ((0.0, 10.0), (-9.0, 120.0), (14.0, 300.0), (5.0, -30.0)):
        px, py = bend_points(np.array(x), np.array(y), curvature)
        np.testing.assert_allclose(road_place(float(px), float(py), curvature), (x, y), atol=1e-8)
