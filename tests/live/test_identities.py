"""Identities in live answers: one that was given out for a vehicle stays its own, whatever comes late."""

from __future__ import annotations

from collections import Counter
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.live.identities import Identities, most_shared
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.tracker import Tracker

PICTURE = ["image.width=1920", "image.height=1080"]
CONFIG = load_config("default", [*PICTURE, "smoother.lag_s=0.5"])


class World:
    """Vehicles that cross the picture at constant speed, seen by two sensors that miss and invent some."""

    def __init__(self, seed, seconds=4.0):
        rng = np.random.default_rng(seed)
        self.begin = rng.uniform(-2.0, seconds, 24)
        right = rng.random(24) < 0.5
        self.x = np.where(right, -20.0, 1940.0)
        self.speed = np.where(right, 1.0, -1.0) * rng.uniform(150.0, 400.0, 24)
        self.y = rng.permutation(np.linspace(60.0, 1020.0, 24))
        self.scans = []
        for sensor, rate in (("rgb", 20), ("evt", 100)):
            for k in range(int(seconds * rate)):
                x = self.at(k / rate)
                seen = (k / rate >= self.begin) & (x > 0.0) & (x < 1920.0) & (rng.random(24) < 0.9)
                false = rng.uniform((30, 20), (1890, 1020), (rng.poisson(0.2), 2))
                centre = np.column_stack([x, self.y])[seen] + rng.normal(0.0, 1.0, (seen.sum(), 2))
                centre = np.concatenate([centre, false])
                boxes = np.column_stack([centre - (30, 20), np.tile([60.0, 40.0], (len(centre), 1))])
                scores = np.append(rng.uniform(0.6, 1.0, seen.sum()), rng.uniform(0.1, 0.5, len(false)))
                self.scans.append(Scan(k / rate, sensor, boxes, scores))

    def at(self, t):
        return self.x + self.speed * (t - self.begin)

    def vehicles(self, table):
        """Number (N,) of the vehicle under each row, -1 for none."""
        centre = table.boxes[:, :2] + 0.5 * table.boxes[:, 2:]
        out = np.full(len(table), -1)
        for n, (t, (x, y)) in enumerate(zip(table.t, centre, strict=True)):
            far = np.where(t >= self.begin, np.hypot(self.at(t) - x, self.y - y), np.inf)
            if far.min() < 30.0:
                out[n] = far.argmin()
        return out

    def arrivals(self, rgb_late_s):
        late = [scan.t + (rgb_late_s if scan.sensor == "rgb" else 0.005) for scan in self.scans]
        return [self.scans[k] for k in np.argsort(late, kind="stable")]

    def names(self, table):
        """The identities of each vehicle, and how many rows have them."""
        out = {}
        for vehicle, identity in zip(self.vehicles(table).tolist(), table.track_id.tolist(), strict=True):
            out.setdefault(vehicle, Counter())[identity] += 1
        return {vehicle: ids for vehicle, ids in out.items() if vehicle >= 0}


@pytest.fixture(scope="module", params=[0, 2])
def world(request):
    return World(request.param)


@cache
def in_order(world):
    tracker, tables = Tracker(CONFIG), []
    for t in sorted({scan.t for scan in world.scans}):
        here = [scan for scan in world.scans if scan.t == t]
        tables.append(tracker.step(sorted(here, key=lambda scan: scan.sensor)))
    return Trajectories.concatenate(tables), tracker.finish()


def live_run(world, rgb_late_s, file=None, every=41):
    """All answers, and the smoothed rows, of a live tracker that is saved and loaded if a file is given."""
    live, tables = LiveTracker(Tracker(CONFIG)), []
    for k, scan in enumerate(world.arrivals(rgb_late_s)):
        if file is not None and k % every == every - 1:
            live.save(file)
            live = LiveTracker.load(file, CONFIG)[0]
        tables.append(live.step(scan).table)
    assert live.replayed > 100
    return Trajectories.concatenate(tables), live.finish()


@cache
def unbroken(world, rgb_late_s):
    return live_run(world, rgb_late_s)


@pytest.mark.parametrize("rgb_late_s", [0.03, 0.08, 0.2])
def test_vehicles_have_no_more_identities_than_with_scans_in_order(world, rgb_late_s):
    plain, _ = in_order(world)
    answers, _ = unbroken(world, rgb_late_s)
    usual, found = world.names(plain), world.names(answers)
    more = [v for v, ids in found.items() if len(ids) > len(usual.get(v, [0]))]
    # One may have been in answers by a track that came to nothing when the picture of that time had come.
    assert len(more) <= 1, [(v, found[v], usual.get(v)) for v in more]


@pytest.mark.parametrize("rgb_late_s", [0.03, 0.08, 0.2])
def test_no_identity_names_two_vehicles(world, rgb_late_s):
    answers, _ = unbroken(world, rgb_late_s)
    owners = {}
    for vehicle, ids in world.names(answers).items():
        for identity in ids:
            owners.setdefault(identity, set()).add(vehicle)
    assert max(map(len, owners.values())) == 1


def test_smoothed_rows_have_the_identities_of_the_answers(world):
    answers, smoothed = unbroken(world, 0.08)
    _, plain = in_order(world)
    given_out, later = world.names(answers), world.names(smoothed)
    for vehicle, ids in later.items():
        # What had been given out by most answers of a vehicle is what its smoothed rows have.
        if vehicle in given_out:
            assert ids.most_common(1)[0][0] == given_out[vehicle].most_common(1)[0][0]
    # Names apart, the smoothed rows are to the last bit those of scans in order.
    rows, others = (table.take(np.lexsort((*table.boxes.T, table.t))) for table in (smoothed, plain))
    for name in ("t", "boxes", "existence", "mean", "var", "used"):
        np.testing.assert_array_equal(getattr(rows, name), getattr(others, name), err_msg=name)
    pairs = set(zip(rows.track_id.tolist(), others.track_id.tolist(), strict=True))
    assert len(pairs) == len(np.unique(rows.track_id)) == len(np.unique(others.track_id))
    assert (np.diff(smoothed.t) >= 0.0).all()
    same = np.diff(smoothed.t) == 0.0
    assert (np.diff(smoothed.track_id)[same] > 0).all()


def test_a_loaded_tracker_gives_out_the_same_identities(world, tmp_path):
    config = load_config("default", [*PICTURE, "smoother.engine=none"])
    runs = []
    for resume in (False, True):
        live, tables = LiveTracker(Tracker(config)), []
        for k, scan in enumerate(world.arrivals(0.08)):
            if resume and k % 7 == 3:
                live.save(tmp_path / "live.npz")
                live, _ = LiveTracker.load(tmp_path / "live.npz", config)
            tables.append(live.step(scan).table)
            if k % 50 == 0:
                tables.append(live.predict(live.time + 0.02))
        runs.append([(t.track_id.tolist(), t.boxes.tolist()) for t in tables])
    assert runs[0] == runs[1]


def test_a_loaded_tracker_smooths_with_the_same_identities(world, tmp_path):
    answers, smoothed = unbroken(world, 0.08)
    again_answers, again = live_run(world, 0.08, tmp_path / "live.npz")
    np.testing.assert_array_equal(again_answers.track_id, answers.track_id)
    np.testing.assert_array_equal(again.track_id, smoothed.track_id)
    np.testing.assert_array_equal(again.t, smoothed.t)


def test_what_a_live_tracker_saved_is_for_a_live_tracker(tmp_path):
    LiveTracker(Tracker(CONFIG)).save(tmp_path / "live.npz")
    with pytest.raises(DataError, match=r"LiveTracker\.load"):
        Tracker.load(tmp_path / "live.npz")


def test_the_rows_of_a_moment_are_by_identity():
    names = Identities(np.zeros(0, dtype=np.int64), 1)
    one, none = np.array([1, 2]), np.array([0, 0])
    known = names.follow(1, 3, [one], [none])
    # A scan before them: its track is new, and theirs are renumbered.
    known = names.follow(1, 4, [np.array([1]), np.array([3, 2])], [np.array([0]), *known])
    np.testing.assert_array_equal(names.of(np.array([1, 2, 3])), [3, 2, 1])
    assert [one.tolist() for one in known] == [[3], [1, 2]]
    table = Trajectories.empty()
    rows = {
        name: np.zeros((3, *getattr(table, name).shape[1:])) for name in ("boxes", "mean", "var", "size_var")
    }
    table = Trajectories(
        t=np.zeros(3),
        track_id=np.array([1, 2, 3]),
        existence=np.array([0.1, 0.2, 0.3]),
        used=np.zeros(3, int),
        **rows,
    )
    renamed = names.rename(table)
    np.testing.assert_array_equal(renamed.track_id, [1, 2, 3])
    np.testing.assert_array_equal(renamed.existence, [0.3, 0.2, 0.1])


def test_an_identity_comes_back_with_its_detection_and_with_no_other():
    names = Identities(np.zeros(0, dtype=np.int64), 1)
    (known,) = names.follow(1, 2, [np.array([1])], [np.array([0])])
    (known,) = names.follow(1, 1, [np.array([0])], [known])  # taken again, nothing is born of it
    (other,) = names.follow(1, 2, [np.array([1])], [np.array([0])])  # what is born now is another vehicle
    assert other.tolist() == [2]
    _, known = names.follow(1, 3, [np.array([1]), np.array([2])], [other, known])
    assert known.tolist() == [1]


@given(st.lists(st.tuples(st.integers(1, 5), st.integers(1, 5)), max_size=30), st.sets(st.integers(1, 5)))
def test_the_most_shared_pair_comes_first(pairs, shown):
    """Against taking the best pair, striking out its row and its column, and so on."""
    shared, expected = Counter(pairs), {}
    while shared:
        best = min(shared, key=lambda pair: (pair[1] not in shown, -shared[pair], pair[1], pair[0]))
        expected[best[0]] = best[1]
        shared = Counter({p: n for p, n in shared.items() if p[0] != best[0] and p[1] != best[1]})
    track, name = most_shared(*np.array(pairs, dtype=np.int64).reshape(-1, 2).T, np.array(sorted(shown), int))
    assert dict(zip(track.tolist(), name.tolist(), strict=True)) == expected
