"""Embeddings decide who takes a detection, by as much as they turn out to tell vehicles apart."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.tracking.appearance import Appearances, compare, remember

NUMBERS = 32


def scans(seed: int, appearance: str, steps: int = 100):
    """Four vehicles; two stand side by side, are hidden, and then are more than half their distance on.

    Args:
        seed: of noise and order.
        appearance: `own` embeddings for each vehicle, `any` at random, or `none`.
        steps: at 20 Hz.

    Yields:
        Scans with the vehicles (M,) that their boxes are of.
    """
    rng = np.random.default_rng(seed)
    shared, own = 0.35 * rng.normal(size=NUMBERS), rng.normal(size=(4, NUMBERS))
    for k in range(steps):
        t = k / 20
        shift = 30.0 if t > 3.2 else 0.0
        centres = np.array([[300 + shift, 300], [350 + shift, 300], [100 + 30 * t, 500], [700 - 20 * t, 120]])
        boxes = np.column_stack([centres - [20, 15], np.full((4, 2), [40.0, 30.0])]) + rng.normal(
            0, 1, (4, 4)
        )
        seen = rng.permutation(4)
        noise = rng.normal(size=(4, NUMBERS))
        found = shared + own + 0.3 * noise if appearance == "own" else noise
        if 3.0 < t < 3.5:
            seen = seen[seen > 1]
        told = None if appearance == "none" else found[seen]
        yield Scan(t, "rgb", boxes[seen], np.full(len(seen), 0.9), None, told), seen


def make(*overrides: str) -> Tracker:
    return Tracker(load_config("default", ["smoother.engine=none", *overrides]), image=(800, 600))


def test_a_saved_tracker_goes_on_as_the_other(tmp_path):
    tracker = make()
    rest = [scan for scan, _ in scans(2, "own", 90)]
    for scan in rest[:50]:
        tracker.step(scan)
    tracker.save(tmp_path / "state.npz")
    again = Tracker.load(tmp_path / "state.npz")
    for scan in rest[50:]:
        np.testing.assert_array_equal(tracker.step(scan).mean, again.step(scan).mean)
    for one, other in zip(tracker.snapshot().appearance, again.snapshot().appearance, strict=True):
        np.testing.assert_array_equal(one, other)


def test_embeddings_of_another_length_are_refused_and_change_nothing():
    tracker = make()
    for scan, _ in scans(0, "own", 20):
        tracker.step(scan)
    before, born = tracker.snapshot(), tracker.num_born
    with pytest.raises(DataError, match="32 numbers as those before, not 3"):
        tracker.step(Scan(1.0, "rgb", [[1, 2, 30, 40]], [0.9], None, np.ones((1, 3))))
    assert tracker.num_born == born
    assert before.appearance is tracker.snapshot().appearance


def test_update_takes_them_too():
    one, other = make(), make()
    for scan, _ in scans(3, "own", 80):
        table = one.step(scan)
        again = other.update(
            scan.boxes, t=scan.t, sensor="rgb", scores=scan.scores, embeddings=scan.embeddings
        )
        np.testing.assert_array_equal(table.mean, again.mean)


def test_the_ratio_is_that_of_two_normal_distributions():
    """By lists of cosines, one by one, the textbook's pooled variance, and some before anything was seen."""
    rng = np.random.default_rng(5)
    own = rng.normal(size=(3, 8))
    appearance, living = Appearances.start(2, 8), np.array([4, 7, 9])
    memory: dict[tuple[int, int], np.ndarray] = {}
    same: dict[int, list[float]] = {0: [], 1: []}
    others: dict[int, list[tuple[float, float]]] = {0: [], 1: []}
    for step in range(40):
        sensor = np.array([step % 2] * 3)
        found = own + 0.5 * rng.normal(size=(3, 8))
        found = (found / np.linalg.norm(found, axis=1, keepdims=True)).astype(np.float32)
        exact = found.astype(np.float64)
        order = rng.permutation(3)
        compared = compare(appearance.of(living), found[order], sensor, 50.0)
        appearance = remember(compared, living[order], np.arange(3), living)
        s = step % 2
        seen = [k for k in range(3) if (s, k) in memory]
        for j in order.tolist():
            unit = {k: memory[s, k] @ exact[j] / np.linalg.norm(memory[s, k]) for k in seen}
            if j in unit:
                same[s].append(unit[j])
                rest = np.array([unit[k] for k in seen if k != j])
                others[s].append((rest.mean(), (rest**2).mean()))
        for j in range(3):
            memory[s, j] = exact[j] if (s, j) not in memory else 0.9 * memory[s, j] + 0.1 * exact[j]
    slope, middle = appearance.ratio()
    for s in (0, 1):
        a, b = np.array(same[s]), np.array(others[s])
        pooled = (a.sum() + b[:, 0].sum()) / (len(a) + len(b))
        means = [(x.sum() + 20 * pooled) / (len(x) + 20) for x in (a, b[:, 0])]
        within = ((a - a.mean()) ** 2).sum() + b[:, 1].sum() - len(b) * b[:, 0].mean() ** 2
        var = (within + 20 * 0.2**2) / (len(a) + len(b) + 20)
        assert slope[s] == pytest.approx((means[0] - means[1]) / var, rel=1e-9)
        assert middle[s] == pytest.approx(sum(means) / 2, rel=1e-9)
    # The ratio of two normal densities of that variance at some cosine.
    cosine = 0.37
    density = [-0.5 * (cosine - mean) ** 2 / var for mean in means]
    assert slope[1] * (cosine - middle[1]) == pytest.approx(density[0] - density[1], rel=1e-9)
