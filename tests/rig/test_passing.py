"""Passing times say whether two cameras face each other: vehicles through pinholes, in closed form."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from jeat_graph.data.arrays import FloatArray
from jeat_graph.rig.passing import facing_pattern
from jeat_graph.rig.sensor_tracks import STEP_S, SensorTracks

from .drawn_tracks import moving_tracks

_FOCAL_PX, _HEIGHT_M, _NEAR_M, _FAR_M = 800.0, 8.0, 12.0, 110.0
_SECONDS, _APART_M, _OFFSET_S = 90.0, 80.0, -12.3
SEEDS = range(2)


class Traffic(NamedTuple):
    """Vehicles (N,): when each is at the first camera (s), velocity (m/s), place across (m), size (m)."""

    t: FloatArray
    velocity: FloatArray
    across: FloatArray
    size: FloatArray


def traffic(seed: int) -> Traffic:
    rng = np.random.default_rng(seed)
    number = 110
    way = rng.choice([-1.0, 1.0], number)
    return Traffic(
        rng.uniform(-10.0, _SECONDS + 10.0, number),
        way * rng.uniform(10.0, 16.0, number),
        way * rng.uniform(2.0, 8.0, number),
        rng.uniform(1.4, 3.0, number),
    )


def seen(vehicles: Traffic, place: float, looks: float, clock: float, grows: bool = True) -> SensorTracks:
    """What a camera at a place along the road (m) sees, which looks along it (1) or back (-1)."""
    t = np.arange(0.0, _SECONDS, STEP_S)
    depth = looks * (vehicles.velocity[:, None] * (t - vehicles.t[:, None]) - place)
    depth = np.where((depth > _NEAR_M) & (depth < _FAR_M), depth, np.nan)
    kept = np.isfinite(depth).sum(axis=1) > 10
    depth, across, own = depth[kept], vehicles.across[kept, None], vehicles.size[kept, None]
    size = _FOCAL_PX * own / (depth if grows else 40.0 + 0.0 * depth)
    foot = (
        _FOCAL_PX / depth[:, :, None] * np.stack([looks * across + 0.0 * depth, _HEIGHT_M + 0.0 * depth], 2)
    )
    centre = foot - 0.5 * size[:, :, None] * [0.0, 1.0]
    return moving_tracks(clock, centre, np.repeat(size[:, :, None], 2, axis=2))


def ahead(vehicles: Traffic) -> SensorTracks:
    return seen(vehicles, 0.0, 1.0, 0.0)


def back(vehicles: Traffic) -> SensorTracks:
    return seen(vehicles, _APART_M, -1.0, _OFFSET_S)


@pytest.mark.parametrize("seed", SEEDS)
def test_cameras_that_face_each_other_are_found_with_their_clocks(seed: int) -> None:
    vehicles = traffic(seed)
    found = facing_pattern(ahead(vehicles), back(vehicles))
    assert found is not None
    assert found.offset_s == pytest.approx(_OFFSET_S, abs=0.5)
    other = facing_pattern(back(vehicles), ahead(vehicles))
    assert other is not None
    assert other.offset_s == pytest.approx(-_OFFSET_S, abs=0.5)


@pytest.mark.parametrize("seed", SEEDS)
def test_traffic_of_one_direction_is_enough(seed: int) -> None:
    vehicles = traffic(seed)
    one_way = vehicles._replace(velocity=np.abs(vehicles.velocity))
    assert facing_pattern(ahead(one_way), back(one_way)) is not None


@pytest.mark.parametrize("seed", SEEDS)
def test_cameras_that_look_the_same_way_do_not_face_each_other(seed: int) -> None:
    vehicles = traffic(seed)
    assert facing_pattern(ahead(vehicles), seen(vehicles, 5.0, 1.0, _OFFSET_S)) is None


@pytest.mark.parametrize("seed", SEEDS)
def test_cameras_over_different_roads_do_not_face_each_other(seed: int) -> None:
    assert facing_pattern(ahead(traffic(seed)), back(traffic(seed + 100))) is None


def test_sizes_that_do_not_change_tell_no_direction() -> None:
    vehicles = traffic(0)
    assert facing_pattern(ahead(vehicles), seen(vehicles, _APART_M, -1.0, _OFFSET_S, grows=False)) is None


def test_nothing_that_moves_tells_nothing() -> None:
    vehicles = traffic(0)
    ours = ahead(vehicles)
    still = SensorTracks(0.0, ours.centre, ours.size, ours.measured, np.zeros(len(ours)))
    assert facing_pattern(still, back(vehicles)) is None
