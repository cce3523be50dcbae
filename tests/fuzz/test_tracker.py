"""Every preset survives what no sensor should send, and says what it must about it."""

from __future__ import annotations

import os

import numpy as np
import pytest

from jeat_graph.config.reading import load_config, preset_names
from jeat_graph.data.errors import DataError, TimeOrderError, UnknownSensorError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.tracker import Tracker

from .grammar import Step, stream

FULL = bool(os.environ.get("JEAT_GRAPH_FULL"))
SEEDS = range(200 if FULL else 2)
LENGTH = 1500 if FULL else 120
PRESETS = [name for name in preset_names() if name != "default" or "highway" not in preset_names()]
DOCUMENTED = (DataError, TimeOrderError, UnknownSensorError)


def run(preset: str, engine: str, steps: list[Step]) -> tuple[list[Trajectories], Trajectories]:
    """Take a stream step by step; refused scans must raise what is documented, all others must not."""
    tracker = Tracker(load_config(preset, f"smoother.engine={engine}"))
    tables = []
    for step in steps:
        if step.bad:
            with pytest.raises(DOCUMENTED):
                tracker.step(step.scan)
        else:
            tables.append(tracker.step(step.scan))
    return tables, tracker.finish()


def numbers(tables: list[Trajectories]) -> list[np.ndarray]:
    joined = Trajectories.concatenate(tables)
    return [joined.t, joined.track_id, joined.boxes, joined.mean, joined.var, joined.existence]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("preset", PRESETS)
def test_any_stream_gives_finite_estimates_and_the_same_ones_without_its_refused_scans(preset, seed):
    sensors = tuple(sorted(load_config(preset).sensors))
    steps = stream(seed, sensors, LENGTH)
    tables, _ = run(preset, "none", steps)
    for table in tables:
        assert np.isfinite(table.mean).all()
        assert np.isfinite(table.boxes).all()
        assert np.isfinite(table.var).all()
        assert (table.var > 0).all()
        assert ((table.existence >= 0) & (table.existence <= 1)).all()
        assert len(np.unique(table.track_id)) == len(table)
    again, _ = run(preset, "none", [step for step in steps if not step.bad])
    for one, other in zip(numbers(tables), numbers(again), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("engine", ["rts", "fixed-lag"] if not FULL else ["rts", "fixed-lag", "full"])
@pytest.mark.parametrize("seed", range(100, 101 if not FULL else 150))
def test_causal_estimates_do_not_depend_on_the_smoother(seed, engine):
    sensors = tuple(sorted(load_config("default").sensors))
    steps = stream(seed, sensors, LENGTH // 2)
    causal, _ = run("default", "none", steps)
    with_smoother, smoothed = run("default", engine, steps)
    for one, other in zip(numbers(causal), numbers(with_smoother), strict=True):
        np.testing.assert_array_equal(one, other)
    assert np.isfinite(smoothed.mean).all()
    assert np.isfinite(smoothed.var).all()
