"""Every preset survives what no sensor should send, and says what it must about it."""

from __future__ import annotations

import os

import numpy as np
import pytest

from jeat_graph.config.reading import load_config, preset_names
from jeat_graph.data.errors import DataError, TimeOrderError, UnknownSensorError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.tracker import Tracker

from .grammar import BURST, LARGE_BURST, Step, settings, stream

pytestmark = pytest.mark.filterwarnings("ignore::jeat_graph.data.errors.InputWarning")
FULL = bool(os.environ.get("JEAT_GRAPH_FULL"))
SEEDS = range(200 if FULL else 2)
LENGTH = 1500 if FULL else 120
#: The core's own tests draw streams for the presets that it tracks.
PRESETS = [name for name in preset_names() if load_config(name).tracker.engine == "compiled"]
DOCUMENTED = (DataError, TimeOrderError, UnknownSensorError)
#: Part by which a smoothed variance may exceed the causal one: the jerk follows the size of the box, which
#: the tracker takes from before a detection and the smoother from after it; boxes that grow fivefold show it.
OTHER_JERK = 0.1


def run(preset: str, engine: str, steps: list[Step], *more: str) -> tuple[list[Trajectories], Trajectories]:
    """Take a stream step by step; refused scans must raise what is documented, all others must not."""
    tracker = Tracker(load_config(preset, [f"smoother.engine={engine}", "input.undeclared=refuse", *more]))
    living, next_id = np.zeros(0, dtype=np.int64), 0
    tables = []
    for step in steps:
        if step.bad:
            with pytest.raises(DOCUMENTED):
                tracker.step(step.scan)
            continue
        tables.append(tracker.step(step.scan))
        now = tracker.snapshot()
        check_identities(now.tracks.track_id, living, next_id, now.next_id)
        living, next_id = now.tracks.track_id, now.next_id
        check_covariances(now.tracks.cov)
        check_covariances(now.tracks.size_cov)
    return tables, tracker.finish()


def check_identities(ids: np.ndarray, before: np.ndarray, next_before: int, next_now: int) -> None:
    """Whoever is not of before is new, and has a number that nobody has had."""
    assert (ids[1:] > ids[:-1]).all()
    old = ids[ids < next_before]
    assert (before[np.minimum(np.searchsorted(before, old), len(before) - 1)] == old).all()
    assert len(ids) == 0 or ids[-1] < next_now


def check_covariances(cov: np.ndarray) -> None:
    """All (N, 2, D, D) are symmetric and positive definite: judged as correlations, whatever the units."""
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


def check_later_knows_more(
    causal: Trajectories, smoothed: Trajectories, side_px: tuple[float, float]
) -> None:
    """The smoother knows all that the tracker knew, so it is nowhere less sure."""
    place = {(t, k): row for row, (t, k) in enumerate(zip(causal.t, causal.track_id, strict=True))}
    pairs = [
        (place[key], row)
        for row, key in enumerate(zip(smoothed.t, smoothed.track_id, strict=True))
        if key in place
    ]
    if pairs:
        before, after = np.array(pairs).T
        ratio = smoothed.var[after] / causal.var[before]
        # Noise goes by a vehicle's size, of which the smoother may think otherwise.
        # What the edge of the picture cuts off may turn out to be any part of it.
        assert (ratio <= 1 + OTHER_JERK).all(axis=1).mean() > 0.99 or (ratio > 1 + OTHER_JERK).sum() <= 2
        boxes = np.concatenate([causal.boxes[before], smoothed.boxes[after]], axis=1).reshape(-1, 2, 4)
        low, high = boxes[:, :, :2], boxes[:, :, :2] + boxes[:, :, 2:]
        inside = ((low > 3.0) & (high < np.array(side_px) - 3.0)).all(axis=(1, 2))
        assert (ratio[inside] <= 1.5).all()


def numbers(tables: list[Trajectories]) -> list[np.ndarray]:
    joined = Trajectories.concatenate(tables)
    return [joined.t, joined.track_id, joined.boxes, joined.mean, joined.var, joined.existence]


def assert_same(one: list[Trajectories], other: list[Trajectories]) -> None:
    for mine, yours in zip(numbers(one), numbers(other), strict=True):
        np.testing.assert_array_equal(mine, yours)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("preset", PRESETS)
def test_any_stream_gives_sound_estimates_and_the_same_ones_without_its_refused_scans(preset, seed):
    sensors = tuple(sorted(load_config(preset).sensors))
    steps = stream(seed, sensors, LENGTH, LARGE_BURST if seed % 50 == 49 else BURST)
    tables, _ = run(preset, "none", steps)
    for table in tables:
        check_table(table)
    again, _ = run(preset, "none", [step for step in steps if not step.bad])
    assert_same(tables, again)


@pytest.mark.usefixtures("forked_workers")
@pytest.mark.parametrize("seed", range(200, 210) if FULL else range(200, 201))
def test_a_smoother_in_a_process_of_its_own_gives_the_same_rows(seed):
    sensors = tuple(sorted(load_config("default").sensors))
    steps = stream(seed, sensors, LENGTH // 2)
    causal, smoothed = run("default", "fixed-lag", steps)
    beside, also_smoothed = run("default", "fixed-lag", steps, "smoother.worker=true")
    assert_same(causal, beside)
    assert_same([smoothed], [also_smoothed])


@pytest.mark.parametrize("engine", ["rts", "fixed-lag", "full"] if FULL else ["rts", "fixed-lag"])
@pytest.mark.parametrize("seed", range(100, 150) if FULL else range(100, 101))
def test_smoothed_estimates_are_sound_and_causal_ones_do_not_depend_on_them(seed, engine):
    preset = PRESETS[seed % len(PRESETS)]
    sensors = tuple(sorted(load_config(preset).sensors))
    steps = stream(seed, sensors, LENGTH // 2)
    causal, _ = run(preset, "none", steps)
    with_smoother, smoothed = run(preset, engine, steps)
    assert_same(causal, with_smoother)
    check_table(smoothed)
    # Out of sight the filter lets accelerations die away, and holds what stands to have no velocity. The
    # smoothers know how it went on, and do neither. What lasts goes by the height, of which they may think
    # otherwise.
    as_one = ("motion.unseen_memory_s=0", "standing.enabled=false", "output.lasting_error=0")
    causal, smoothed = run(preset, "none", steps, *as_one)[0], run(preset, engine, steps, *as_one)[1]
    image = load_config(preset).image
    check_later_knows_more(Trajectories.concatenate(causal), smoothed, (image.width, image.height))


@pytest.mark.parametrize("seed", range(300, 350) if FULL else range(300, 302))
def test_with_any_settings_estimates_are_sound_and_the_same_ones_with_a_smoother(seed):
    preset, engine = PRESETS[seed % len(PRESETS)], ("fixed-lag", "rts", "full")[seed % 3]
    sensors = tuple(sorted(load_config(preset).sensors))
    more = settings(seed, sensors)
    steps = stream(seed, sensors, LENGTH // 2)
    causal, _ = run(preset, "none", steps, *more)
    with_smoother, smoothed = run(preset, engine, steps, *more)
    assert_same(causal, with_smoother)
    for table in (*causal, smoothed):
        check_table(table)
