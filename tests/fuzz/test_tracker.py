"""Every preset survives what no sensor should send, and says what it must about it."""

from __future__ import annotations

import os

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.errors import DataError, TimeOrderError, UnknownSensorError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.tracker import Tracker

from .grammar import BURST, LARGE_BURST, Step, settings, stream

pytestmark = pytest.mark.filterwarnings("ignore::jeat_graph.data.errors.InputWarning")
FULL = bool(os.environ.get("JEAT_GRAPH_FULL"))
SEEDS = range(200 if FULL else 2)
LENGTH = 1500 if FULL else 120
#: Of the presets with these two sensors; every other name is refused.
SENSORS = ("evt", "rgb")
DECLARED = ("sensors.evt={}", "sensors.rgb={}", "input.undeclared=refuse")
#: The smoothers of each preset that need no other package.
SMOOTHERS = {"default": ("fixed-lag", "full", "gtsam"), "paper": ("fixed-lag", "full", "gtsam-full")}
DOCUMENTED = (DataError, TimeOrderError, UnknownSensorError)
#: Part by which a smoothed variance may exceed the causal one: what may have moved a vehicle goes by the size
#: of its box, of which the smoother may think otherwise; boxes that grow fivefold show it.
OTHER_SIZE = 0.1
#: So far ahead tracks are predicted after each step (s).
AHEAD_S = 0.5


def run(preset: str, engine: str, steps: list[Step], *more: str) -> tuple[list[Trajectories], Trajectories]:
    """Take a stream step by step; refused scans must raise what is documented, all others must not."""
    tracker = Tracker(load_config(preset, [f"smoother.engine={engine}", *DECLARED, *more]))
    living, next_id = np.zeros(0, dtype=np.int64), 0
    tables = []
    for step in steps:
        if step.bad:
            with pytest.raises(DOCUMENTED):
                tracker.step(step.scan)
            continue
        tables.append(tracker.step(step.scan))
        ids, next_now = tracker.living()
        check_identities(ids, living, next_id, next_now)
        living, next_id = ids, next_now
        for ahead in (0.0, AHEAD_S):
            check_covariances(tracker.predict(tables[-1].instants[0] + ahead).cov)
    return tables, tracker.finish()


def check_identities(ids: np.ndarray, before: np.ndarray, next_before: int, next_now: int) -> None:
    """Whoever is not of before is new, and has a number that nobody has had."""
    assert (ids[1:] > ids[:-1]).all()
    old = ids[ids < next_before]
    assert (before[np.minimum(np.searchsorted(before, old), len(before) - 1)] == old).all()
    assert len(ids) == 0 or ids[-1] < next_now


def check_covariances(cov: np.ndarray) -> None:
    """All (N, D, D) are symmetric and positive definite: judged as correlations, whatever the units."""
    if cov.size:
        std = np.sqrt(np.einsum("...ii->...i", cov))
        correlation = cov / std[..., :, None] / std[..., None, :]
        # NaN, infinity and a variance that is not positive fail here, too.
        assert (np.abs(correlation - np.swapaxes(correlation, -1, -2)) < 1e-9).all()
        np.linalg.cholesky(correlation)  # raises where one is not positive definite


def check_table(table: Trajectories) -> None:
    """Numbers are numbers, variances positive, existence a probability, no track is there twice."""
    for values in (table.boxes, table.mean, table.var):
        assert np.isfinite(values).all()
    assert (table.var > 0).all()
    assert ((table.existence >= 0) & (table.existence <= 1)).all()
    rows = np.column_stack([table.t, table.track_id])
    assert len(np.unique(rows, axis=0)) == len(table)


def check_later_knows_more(causal: Trajectories, smoothed: Trajectories) -> None:
    """The smoother knows all that the tracker knew, so it is nowhere less sure, in sides of the box."""
    place = {(t, k): row for row, (t, k) in enumerate(zip(causal.t, causal.track_id, strict=True))}
    pairs = [
        (place[key], row)
        for row, key in enumerate(zip(smoothed.t, smoothed.track_id, strict=True))
        if key in place
    ]
    assert pairs
    before, after = np.array(pairs).T
    # A detector's errors go by the box: where that turns out to be larger, they do.
    grown = np.maximum(smoothed.boxes[after, 2:] / causal.boxes[before, 2:], 1.0).max(axis=1) ** 2
    # The acceleration in the picture has a part that goes by the velocity, and so has its variance.
    known = slice(0, 4)
    good = smoothed.var[after, known] <= (1.0 + OTHER_SIZE) * grown[:, None] * causal.var[before, known]
    # What the edge of the picture cuts off may turn out to be any part of it.
    assert good.all(axis=1).mean() > 0.99 or (~good).sum() <= 2


def numbers(tables: list[Trajectories]) -> list[np.ndarray]:
    joined = Trajectories.concatenate(tables)
    return [joined.t, joined.track_id, joined.boxes, joined.mean, joined.var, joined.existence]


def assert_same(one: list[Trajectories], other: list[Trajectories]) -> None:
    for mine, yours in zip(numbers(one), numbers(other), strict=True):
        np.testing.assert_array_equal(mine, yours)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("preset", SMOOTHERS)
def test_any_stream_gives_sound_estimates_and_the_same_ones_without_its_refused_scans(preset, seed):
    steps = stream(seed, SENSORS, LENGTH, LARGE_BURST if seed % 50 == 49 else BURST)
    tables, _ = run(preset, "none", steps)
    assert any(map(len, tables))
    for table in tables:
        check_table(table)
    again, _ = run(preset, "none", [step for step in steps if not step.bad])
    assert_same(tables, again)


@pytest.mark.parametrize(("preset", "engine"), [(name, one) for name in SMOOTHERS for one in SMOOTHERS[name]])
@pytest.mark.parametrize("seed", range(100, 150) if FULL else range(100, 101))
def test_smoothed_estimates_are_sound_and_causal_ones_do_not_depend_on_them(seed, preset, engine):
    steps = stream(seed, SENSORS, LENGTH // 2)
    causal, _ = run(preset, "none", steps)
    with_smoother, smoothed = run(preset, engine, steps)
    assert_same(causal, with_smoother)
    check_table(smoothed)
    check_later_knows_more(Trajectories.concatenate(causal), smoothed)


@pytest.mark.parametrize("preset", SMOOTHERS)
@pytest.mark.parametrize("seed", range(300, 350) if FULL else range(300, 302))
def test_with_any_settings_estimates_are_sound_and_the_same_ones_with_a_smoother(seed, preset):
    engine = SMOOTHERS[preset][seed % 2]
    more = settings(seed, SENSORS, preset)
    steps = stream(seed, SENSORS, LENGTH // 2)
    causal, _ = run(preset, "none", steps, *more)
    with_smoother, smoothed = run(preset, engine, steps, *more)
    assert_same(causal, with_smoother)
    for table in (*causal, smoothed):
        check_table(table)
