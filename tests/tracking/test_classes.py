"""The class of a track is what most of the scores of its detections say, and nothing else depends on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.trajectory_table import RUN_CLASSES
from jeat_graph.io.tables.trajectories_io import read_trajectories, write_trajectories
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.classes import MOST_CLASSES
from jeat_graph.tracking.tracker import Tracker

KINDS = np.array(["bus", "car", "truck", ""])
ENGINES = pytest.mark.parametrize("engine", ["fixed-lag", "full", "gtsam"])


def recording(named: bool = True, steps: int = 60, seed: int = 3) -> Detections:
    """Two vehicles far apart, each called many things, seen by two sensors of which one knows no classes."""
    rng = np.random.default_rng(seed)
    scans = []
    for k in range(steps):
        boxes = np.array([[100.0 + 4 * k, 200.0, 60.0, 40.0], [900.0 - 4 * k, 500.0, 80.0, 50.0]])
        scores = rng.uniform(0.5, 1.0, 2).round(3)
        kinds = rng.choice(KINDS, 2, p=[0.2, 0.4, 0.3, 0.1])
        scans.append(
            Scan(k / 20, "rgb", boxes + rng.normal(0, 0.5, (2, 4)), scores, kinds if named else None)
        )
        scans.append(Scan((k + 0.5) / 20, "evt", boxes + rng.normal(0, 0.5, (2, 4)), scores))
    return Detections.from_scans(scans)


def config(engine: str = "none"):
    return load_config("default", [f"smoother.engine={engine}", "smoother.lag_s=0.5"])


def summary_of(detections: Detections) -> list[tuple[float, int, str, float]]:
    """Time, vehicle, class and score of all that has a class; a vehicle keeps to its half of the picture."""
    return [
        (float(scan.t), int(box[1] > 350.0), str(kind), float(score))
        for scan in detections.scans()
        if scan.classes is not None
        for box, score, kind in zip(scan.boxes, scan.scores, scan.classes, strict=True)
        if kind
    ]


def majority(said: list[tuple[float, int, str, float]], vehicle: int, until: float) -> tuple[str, float]:
    """The same by a dictionary."""
    votes: dict[str, float] = {}
    for t, whose, kind, score in said:
        if t <= until and whose == vehicle:
            votes[kind] = votes.get(kind, 0.0) + score
    best = max(sorted(votes), key=lambda name: votes[name])
    return best, votes[best] / sum(votes.values())


def vehicle_of(table, row: int) -> int:
    return int(table.mean[row, 1] > 350.0)


def test_a_causal_class_is_the_majority_by_score_of_what_had_come():
    detections = recording()
    said, changed = summary_of(detections), set()
    for table in Tracker(config()).run(detections):
        for row in range(len(table)):
            name, share = majority(said, vehicle_of(table, row), float(table.t[row]))
            assert table.classes[row] == name
            assert table.class_probability[row] == pytest.approx(share)
            changed.add((vehicle_of(table, row), name))
    assert len(changed) > 2  # it was not one class from beginning to end


@ENGINES
def test_smoothed_rows_have_the_class_of_all_that_their_track_took_in(engine):
    detections = recording()
    tracker = Tracker(config(engine))
    for batch in detections.batches():
        tracker.step(batch)
    table, said = tracker.finish(), summary_of(detections)
    whole = engine == "full"
    for row in range(len(table)):
        t = float(table.t[row])
        known = {majority(said, vehicle_of(table, row), end) for end in np.arange(t + 1e-6, 3.1, 0.05)}
        if whole:
            known = {majority(said, vehicle_of(table, row), 9.0)}
        shares = [share for name, share in known if name == table.classes[row]]
        assert np.isclose(shares, table.class_probability[row]).any()


@ENGINES
def test_without_classes_every_byte_is_as_it_was_and_with_them_all_else_is(tmp_path, engine):
    texts = []
    for named in (False, True):
        tracker = Tracker(config(engine))
        tables = list(tracker.run(recording(named)))
        for name, table in (("causal", type(tables[0]).concatenate(tables)), ("smoothed", tracker.finish())):
            path = tmp_path / f"{name}-{named}.csv"
            write_trajectories(table, path)
            texts.append(path.read_text().splitlines())
    for plain, named in zip(texts[:2], texts[2:], strict=True):
        rows = [line.split(",") for line in named]
        place = rows[0].index(RUN_CLASSES[0])
        assert rows[0][place : place + 2] == list(RUN_CLASSES)
        assert plain == [",".join(row[:place] + row[place + 2 :]) for row in rows]


def test_files_keep_classes(tmp_path):
    tracker = Tracker(config("full"))
    list(tracker.run(recording()))
    table = tracker.finish()
    for name in ("t.csv", "t.parquet"):
        write_trajectories(table, tmp_path / name)
        back = read_trajectories(tmp_path / name)
        assert back.classes.tolist() == table.classes.tolist()
        assert back.class_probability == pytest.approx(table.class_probability, abs=1e-6)


def same(a, b) -> bool:
    return a.classes.tolist() == b.classes.tolist() and np.array_equal(
        a.class_probability, b.class_probability, equal_nan=True
    )


def test_late_scans_vote_as_if_they_had_come_in_time():
    detections = recording()
    config_ = replace(config("fixed-lag"))
    batches = list(detections.batches())
    ordered, late = LiveTracker(Tracker(config_)), LiveTracker(Tracker(config_))
    for batch in batches:
        ordered.step(batch)
    swapped = batches.copy()
    for k in range(4, len(swapped) - 1, 5):
        swapped[k], swapped[k + 1] = swapped[k + 1], swapped[k]
    for batch in swapped:
        late.step(batch)
    assert late.replayed > 5
    assert same(ordered.tracker.causal(), late.tracker.causal())
    assert same(ordered.finish(), late.finish())


def test_a_saved_tracker_goes_on_with_its_votes(tmp_path):
    batches = list(recording().batches())
    tracker = Tracker(config("fixed-lag"))
    for batch in batches[:50]:
        tracker.step(batch)
    tracker.save(tmp_path / "state.npz")
    loaded = Tracker.load(tmp_path / "state.npz")
    for batch in batches[50:]:
        assert same(tracker.step(batch), loaded.step(batch))
    assert same(tracker.finish(), loaded.finish())


def test_a_prediction_has_the_class_of_now():
    tracker = Tracker(config())
    now = list(tracker.run(recording()))[-1]
    assert tracker.predict(4.0).of(1).classes.tolist() == now.of(1).classes.tolist()


def test_a_track_that_nobody_names_has_no_class_beside_others_that_have_one():
    tracker = Tracker(config())
    for k in range(20):
        boxes = [[100 + 4 * k, 200, 60, 40], [900 - 4 * k, 500, 80, 50]]
        table = tracker.step((k / 20, "rgb", boxes, [0.9, 0.9], ["car", None]))
    assert table.classes.tolist() == ["car", ""]
    assert table.class_probability[0] == 1.0
    assert np.isnan(table.class_probability[1])


def test_classes_that_come_late_are_there_from_then_on():
    tracker = Tracker(config("fixed-lag"))
    for k in range(60):
        kinds = ["van"] if k >= 30 else None
        table = tracker.step((k / 20, "rgb", [[100 + 4 * k, 200, 60, 40]], [0.9], kinds))
        assert (table.classes is None) == (k < 30)
    smoothed = tracker.finish()
    assert smoothed.classes[-1] == "van"
    assert smoothed.classes[0] == ""


def test_names_without_end_are_refused_and_change_nothing():
    tracker = Tracker(config())
    many = MOST_CLASSES + 1
    boxes = np.tile([[100.0, 200.0, 60.0, 40.0]], (many, 1))
    with pytest.raises(DataError, match="classes"):
        tracker.step((0.0, "rgb", boxes, np.full(many, 0.9), [f"vehicle {k}" for k in range(many)]))
    assert tracker.time is None


def test_detections_keep_their_classes_through_selection():
    detections = recording()
    only = detections.select(["rgb"])
    assert only.classes.tolist() == [
        str(kind) for scan in detections.scans() if scan.sensor == "rgb" for kind in scan.classes
    ]
    cars = detections.of_class("car")
    assert cars.num_scans == detections.num_scans
    assert set(cars.classes) == {"car", ""}
    with pytest.raises(DataError, match="bus, car, truck"):
        detections.of_class("Car")
