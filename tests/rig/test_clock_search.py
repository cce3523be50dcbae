"""Rough differences of clocks by sizes: vehicles on a short stretch of road, seen for a second or so."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.arrays import FloatArray
from jeat_graph.rig.clock_search import offset_of, pairs_at, rank_offsets
from jeat_graph.rig.sensor_tracks import STEP_S, SensorTracks

from .drawn_tracks import moving_tracks

_SECONDS, _VEHICLES, _OFFSET_S, _RATIO = 60.0, 60, 7.4, 1.5
SEEDS = range(2)


def seen(begin: FloatArray, size: FloatArray, lasts_s: float, clock: float) -> SensorTracks:
    """Vehicles (N,) that cross a picture at 200 px/s from `begin` (s) on, with steady sizes (px)."""
    t = np.arange(0.0, _SECONDS, STEP_S)
    since = t - begin[:, None]
    x = np.where((since >= 0.0) & (since < lasts_s), 200.0 * since, np.nan)
    sides = np.repeat((size[:, None] + 0.0 * x)[:, :, None], 2, axis=2)
    return moving_tracks(clock, np.stack([x, 0.0 * x], axis=2), sides)


def two_views(seed: int, lasts_s: float) -> tuple[SensorTracks, SensorTracks]:
    rng = np.random.default_rng(seed)
    begin = np.sort(rng.uniform(0.0, _SECONDS - lasts_s, _VEHICLES))
    size = np.exp(rng.normal(np.log(60.0), 0.5, _VEHICLES))
    return seen(begin, size, lasts_s, 0.0), seen(begin, _RATIO * size, lasts_s, _OFFSET_S)


@pytest.mark.parametrize("lasts_s", [0.9, 1.3, 5.0])
@pytest.mark.parametrize("seed", SEEDS)
def test_every_vehicle_is_a_pair_with_itself_however_short_it_is_seen(seed: int, lasts_s: float) -> None:
    first, second = two_views(seed, lasts_s)
    pairs = pairs_at(first, second, 0)
    itself = set(pairs.a[pairs.a == pairs.b].tolist())
    assert itself == set(range(_VEHICLES))
    np.testing.assert_allclose(pairs.log_ratio[pairs.a == pairs.b], -np.log(_RATIO), atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_sizes_that_do_not_change_tell_the_clocks_as_they_differ_between_vehicles(seed: int) -> None:
    first, second = two_views(seed, 1.3)
    best, other = rank_offsets(first, second, 2)
    assert offset_of(best.shift, first, second) == pytest.approx(_OFFSET_S, abs=0.3)
    assert best.score > other.score
