"""A live caller: the state's arrays, and memory that does not grow with time."""

import gc
import sys
from types import BuiltinFunctionType, FunctionType, ModuleType

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from jeat_graph import Tracker, load_config
from jeat_graph.tracking.compaction import allocate, grow

PLAIN = ["smoother.engine=none"]
CODE = (type, ModuleType, FunctionType, BuiltinFunctionType, Dispatcher)


def scans_100_hz(num, seed=0):
    """Endless traffic: three vehicles that start anew every 3 s, clutter, and empty scans."""
    rng = np.random.default_rng(seed)
    size = np.array([40.0, 30.0])
    clutter = np.hstack([rng.uniform([0, 0], [1200, 650], (997, 2)), rng.uniform(10, 60, (997, 2))])
    noise = rng.normal(0, 1.0, (1009, 3, 2))
    scores = np.full(4, 0.9)
    for k in range(num):
        t = 0.01 * k
        age = t % 3.0
        centre = np.array([[100 + 300 * age, 200], [1100 - 300 * age, 400], [300 + 100 * age, 600]])
        boxes = np.empty((4, 4))
        boxes[:3, :2] = centre + noise[k % 1009] - size / 2
        boxes[:3, 2:] = size
        boxes[3] = clutter[k % 997]
        shown = 0 if k % 10 == 7 else 4 if k % 5 == 0 else 3
        yield (t, "evt" if k % 6 else "rgb", boxes[:shown], scores[:shown])


def bytes_held(owner):
    """Bytes of everything that `owner` refers to, directly or not, but for code and modules."""
    seen, waiting, total = set(), [vars(owner)], 0
    while waiting:
        item = waiting.pop()
        if id(item) in seen or isinstance(item, CODE):
            continue
        seen.add(id(item))
        total += item.nbytes if isinstance(item, np.ndarray) else sys.getsizeof(item)
        waiting.extend(gc.get_referents(item))
    return total


@pytest.mark.parametrize("preset", ["highway", "paper"])
def test_memory_and_capacity_are_flat_over_minutes_of_100_hz_input(preset):
    tracker, peak, held = Tracker(load_config(preset, PLAIN)), 0, []
    for k, scan in enumerate(scans_100_hz(4_000)):
        tracker.step(scan)
        peak = max(peak, tracker.num_tracks)
        if k % 800 == 799:
            held.append(bytes_held(tracker))
    assert tracker.num_born > 32, "many tracks were born and ended"
    assert len(tracker._tracks.existence) <= max(64, 2 * (peak + 4))
    assert max(held) - min(held) < 1_000


def test_capacity_follows_the_peak_and_no_more():
    tracker = Tracker(load_config("paper", PLAIN))
    grid = np.array([[40.0 * (k % 30), 40.0 * (k // 30), 20.0, 20.0] for k in range(500)])
    for k in range(20):
        grid[:, 0] += 3000.0
        tracker.step((1.0 * k, "rgb", grid, np.full(500, 0.9)))
    assert tracker.num_born > 5_000
    assert len(tracker._tracks.existence) <= 2 * (2 * 500 + 500)


def test_growing_keeps_every_row_of_every_array():
    rng = np.random.default_rng(0)
    tracks = allocate(4, 2)
    for array in tracks:
        array[...] = (
            rng.integers(0, 2, array.shape) if array.dtype == bool else rng.integers(1, 99, array.shape)
        )
    before = {name: array.copy() for name, array in tracks._asdict().items()}
    larger = grow(tracks, 3, 5)
    assert len(larger.existence) >= 5
    for name, array in larger._asdict().items():
        assert array.dtype == before[name].dtype
        assert array.shape[1:] == before[name].shape[1:]
        assert np.array_equal(array[:3], before[name][:3]), name


def test_arrays_that_are_large_enough_are_not_copied():
    tracks = allocate(8, 2)
    assert grow(tracks, 3, 8) is tracks


def test_growing_one_row_at_a_time_copies_seldom():
    tracks, copies = allocate(64, 2), 0
    for n in range(64, 5000):
        larger = grow(tracks, n, n + 1)
        copies += larger is not tracks
        tracks = larger
    assert copies <= 7


def test_many_tracks_survive_growth_in_the_middle_of_a_run():
    grid = np.array([[60.0 * (k % 20), 60.0 * (k // 20), 40.0, 30.0] for k in range(200)])
    tracker = Tracker(load_config("highway", PLAIN))
    for k in range(10):
        tracker.step((0.05 * k, "rgb", grid[:40], np.full(40, 0.95)))
    first = tracker.causal().track_id
    for k in range(10, 30):
        table = tracker.step((0.05 * k, "rgb", grid, np.full(200, 0.95)))
    assert set(first.tolist()) <= set(table.track_id.tolist())
    assert len(table) > 150
