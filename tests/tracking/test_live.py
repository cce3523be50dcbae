"""A live caller: memory that does not grow with time."""

import gc
import sys
from types import BuiltinFunctionType, FunctionType, ModuleType

import numpy as np
import pytest

from jeat_graph import Tracker, load_config

from .endless import scans_100_hz

PLAIN = ["smoother.engine=none"]
CODE = (type, ModuleType, FunctionType, BuiltinFunctionType)


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


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_memory_is_flat_over_minutes_of_100_hz_input(preset):
    tracker, held = Tracker(load_config(preset, PLAIN)), []
    for k, scan in enumerate(scans_100_hz(4_000)):
        tracker.step(scan)
        if k % 800 == 799:
            held.append(bytes_held(tracker))
    assert tracker.num_born > 32, "many tracks were born and ended"
    assert max(held) - min(held) < 2_000


def test_the_state_that_is_saved_is_flat_too():
    tracker, sizes = Tracker(load_config("default", PLAIN)), []
    for k, scan in enumerate(scans_100_hz(4_000)):
        tracker.step(scan)
        if k % 800 == 799:
            model = tracker.state()["model"]
            sizes.append(sum(np.asarray(value).nbytes for value in model.values()))
    assert max(sizes[1:]) < 2 * min(sizes[1:]), "what is remembered of ended tracks is bounded"


def test_many_tracks_survive_growth_in_the_middle_of_a_run():
    grid = np.array([[60.0 * (k % 20), 60.0 * (k // 20), 40.0, 30.0] for k in range(200)])
    tracker = Tracker(load_config("default", PLAIN))
    for k in range(10):
        tracker.step((0.05 * k, "rgb", grid[:40], np.full(40, 0.95)))
    first = tracker.causal().track_id
    for k in range(10, 30):
        table = tracker.step((0.05 * k, "rgb", grid, np.full(200, 0.95)))
    assert set(first.tolist()) <= set(table.track_id.tolist())
    assert len(table) > 150
