"""The noise filter keeps what moves and drops what stands alone or never rests."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.errors import ConfigError
from jeat_graph.data.events import EventArray
from jeat_graph.detection.noise import NoiseFilter, NoiseSettings

SIZE = (40, 30)


def events(rows):
    """Events of rows (t in µs, x, y)."""
    t, x, y = np.array(sorted(rows), dtype=np.int64).T
    return EventArray(t, x.astype(np.uint16), y.astype(np.uint16), np.ones(len(t), dtype=np.uint8))


def brute_force(found, support_us):
    """Whether each event has an earlier one in the eight pixels around it, not longer ago."""
    good = []
    for k in range(len(found)):
        x, y, t = int(found.x[k]), int(found.y[k]), int(found.t_us[k])
        good.append(
            any(
                max(abs(x - int(found.x[j])), abs(y - int(found.y[j]))) == 1
                and t - int(found.t_us[j]) <= support_us
                for j in range(k)
            )
        )
    return good


def test_events_that_stand_alone_are_those_of_a_brute_force_search():
    rng = np.random.default_rng(0)
    rows = [(int(rng.integers(200_000)), int(rng.integers(40)), int(rng.integers(30))) for _ in range(600)]
    found = events(rows)
    noise = NoiseFilter(SIZE, NoiseSettings(support_s=0.01, hot_pixels=False))
    signal = np.concatenate([noise.signal(found.take(slice(k, k + 50))) for k in range(0, 600, 50)])
    assert signal.tolist() == brute_force(found, 10_000)
    assert noise.alone == 600 - signal.sum()


@pytest.mark.parametrize("gap_us", [1 << 29, 1 << 31, 1 << 40])
@pytest.mark.parametrize("support_s", [0.01, 1000.0])
def test_times_of_hours_are_told_apart_as_those_of_seconds(gap_us, support_s):
    rng = np.random.default_rng(1)
    rows = [
        (k * gap_us + int(rng.integers(60_000)), int(rng.integers(40)), int(rng.integers(30)))
        for k in range(5)
        for _ in range(60)
    ]
    found = events(rows)
    noise = NoiseFilter(SIZE, NoiseSettings(support_s=support_s, hot_pixels=False))
    assert noise.signal(found).tolist() == brute_force(found, round(support_s * 1e6))


def test_a_hot_pixel_is_found_and_a_busy_edge_is_not():
    hot = [(t, 5, 5) for t in range(0, 3_000_000, 10_000)]
    flicker = [
        (t + k, 20 + k, 10 + j) for t in range(0, 3_000_000, 10_000) for k in range(3) for j in range(3)
    ]
    found = events(hot + flicker)
    noise = NoiseFilter(SIZE, NoiseSettings(alone=False))
    signal = noise.signal(found)
    assert np.argwhere(noise.hot).tolist() == [[5, 5]]
    late = (found.t_us > 1_100_000) & (found.x == 5)
    assert not signal[late].any()
    assert signal[found.x >= 20].all()


def test_nothing_is_left_out_where_both_are_off():
    found = events([(t, t % 40, t % 30) for t in range(0, 2_000_000, 1000)])
    assert NoiseFilter(SIZE, NoiseSettings(alone=False, hot_pixels=False)).signal(found).all()


def test_events_outside_the_picture_are_left_out():
    found = events([(0, 39, 29), (1, 38, 29), (2, 60, 29)])
    assert NoiseFilter(SIZE, NoiseSettings()).signal(found).tolist() == [False, True, False]


def test_settings_are_checked():
    with pytest.raises(ConfigError, match=r"support_s: 0.0 is not in"):
        NoiseSettings(support_s=0.0)
