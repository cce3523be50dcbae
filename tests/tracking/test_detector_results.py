"""What detectors return goes into `update`, and comes back as it went in."""

from __future__ import annotations

import warnings
from types import SimpleNamespace

import numpy as np
import pytest

from jeat_graph import Tracker, Trajectories
from jeat_graph.data.errors import DataError, InputWarning

IMAGE = (1280, 720)
LTWH = np.array([[100.0, 200.0, 60.0, 40.0], [700.0, 300.0, 80.0, 50.0], [400.0, 500.0, 90.0, 60.0]])
XYXY = np.hstack([LTWH[:, :2], LTWH[:, :2] + LTWH[:, 2:]])
CENTRE = np.hstack([LTWH[:, :2] + LTWH[:, 2:] / 2, LTWH[:, 2:]])
SCORES, IDS = np.array([0.9, 0.8, 0.7]), np.array([2, 7, 2])


def taken(source, **more) -> Trajectories:
    tracker = Tracker(image=IMAGE)
    for k in range(10):
        table = tracker.update(source, t=k / 20, sensor="rgb", **more)
    return table


def expected(classes=None) -> Trajectories:
    return taken(LTWH, scores=SCORES, classes=classes)


@pytest.mark.parametrize(
    ("source", "more"),
    [
        (XYXY, {"format": "xyxy", "scores": SCORES}),
        (CENTRE, {"format": "xywh", "scores": SCORES}),
        (LTWH, {"format": "ltwh", "scores": SCORES}),
        (np.column_stack([XYXY, SCORES]), {"format": "xyxy"}),
    ],
)
def test_arrays_say_by_format_what_their_columns_are(source, more):
    np.testing.assert_allclose(taken(source, **more).mean, expected().mean, atol=1e-9)


def parts(**more):
    return SimpleNamespace(xyxy=XYXY, conf=SCORES, cls=IDS.astype(float), **more)


NAMES = {2: "car", 7: "truck"}


@pytest.mark.parametrize(
    ("source", "more", "names"),
    [
        (np.column_stack([LTWH, SCORES, IDS]), {}, ("2", "7", "2")),
        (np.column_stack([XYXY, SCORES, IDS]), {"format": "xyxy"}, ("2", "7", "2")),
        ({"boxes": XYXY, "scores": SCORES, "labels": IDS}, {}, ("2", "7", "2")),
        ([{"boxes": XYXY, "scores": SCORES, "labels": IDS}], {}, ("2", "7", "2")),
        ({"boxes": CENTRE, "scores": SCORES, "labels": IDS}, {"format": "xywh"}, ("2", "7", "2")),
        (SimpleNamespace(boxes=parts(), names=NAMES), {}, ("car", "truck", "car")),
        (SimpleNamespace(boxes=None, obb=parts(), names=NAMES), {}, ("car", "truck", "car")),
        (parts(), {}, ("2", "7", "2")),
        (
            SimpleNamespace(xyxy=[np.column_stack([XYXY, SCORES, IDS])], names=NAMES),
            {},
            ("car", "truck", "car"),
        ),
        (LTWH, {"scores": SCORES, "classes": IDS}, ("2", "7", "2")),
        (LTWH, {"scores": SCORES, "classes": ["car", "truck", "car"]}, ("car", "truck", "car")),
    ],
)
def test_every_kind_of_result_keeps_its_classes(source, more, names):
    table = taken(source, **more)
    np.testing.assert_allclose(table.mean, expected(list(names)).mean, atol=1e-9)
    assert sorted(table.classes.tolist()) == sorted(names)


def test_none_is_a_scan_that_found_nothing():
    one, other = Tracker(image=IMAGE), Tracker(image=IMAGE)
    for k in range(10):
        one.update(LTWH, t=k / 20, sensor="rgb")
        other.update(LTWH, t=k / 20, sensor="rgb")
    first, second = one.update(None, t=0.5, sensor="rgb"), other.update([], t=0.5, sensor="rgb")
    np.testing.assert_array_equal(first.existence, second.existence)
    assert one.time == 0.5


@pytest.mark.parametrize(
    ("source", "more", "what"),
    [
        (LTWH, {"format": "cxcywh"}, "format 'cxcywh'"),
        ({"scores": SCORES}, {}, "boxes, scores and labels"),
        (LTWH, {"classes": [1, 2]}, "classes must have shape"),
        (SimpleNamespace(boxes=parts(), names=NAMES), {"format": "ltwh"}, "format 'ltwh' is for arrays"),
        (np.zeros((2, 7)), {}, "scores and classes"),
    ],
)
def test_what_does_not_fit_is_refused(source, more, what):
    with pytest.raises(DataError, match=what):
        Tracker(image=IMAGE).update(source, t=0.0, sensor="rgb", **more)


def test_boxes_that_can_only_be_corners_are_warned_of_at_once():
    with pytest.warns(InputWarning, match='format="xyxy"'):
        Tracker(image=IMAGE).update(XYXY, t=0.0, sensor="rgb")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Tracker(image=IMAGE).update(LTWH, t=0.0, sensor="rgb")
        Tracker(image=IMAGE).update(XYXY, t=0.0, sensor="rgb", format="xyxy")


def test_numbers_of_classes_are_those_that_came_in_whatever_is_seen():
    pytest.importorskip("supervision")
    tracker = Tracker(image=IMAGE)
    for k in range(30):
        rows = [0, 1, 2] if k < 20 else [0, 2]
        source = SimpleNamespace(
            boxes=SimpleNamespace(xyxy=XYXY[rows], conf=SCORES[rows], cls=IDS[rows]), names=NAMES
        )
        table = tracker.update(source, t=k / 20, sensor="rgb")
        found = table.to_supervision()
        named = dict(zip(found.data["class_name"].tolist(), found.class_id.tolist(), strict=True))
        assert named.items() <= {"car": 2, "truck": 7, "": -1}.items()
    assert set(found.class_id.tolist()) == {2}
    assert tracker.finish().take([0]).to_supervision().class_id.tolist() in ([2], [7])


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_names_without_numbers_keep_those_they_were_given_first(preset):
    pytest.importorskip("supervision")
    tracker = Tracker(preset, image=IMAGE)
    first: dict[str, int] = {}
    for k in range(40):
        names = ["van", "van", "bus"] if k < 20 else ["van", "car", "bus"]
        found = tracker.update(LTWH, t=k / 20, sensor="rgb", classes=names).to_supervision()
        for name, number in zip(found.data["class_name"].tolist(), found.class_id.tolist(), strict=True):
            assert first.setdefault(name, number) == number
    assert len(set(first.values())) == len(first) >= 2


def test_a_user_s_detections_come_back_with_the_tracks_that_took_them(tmp_path):
    sv = pytest.importorskip("supervision")
    tracker = Tracker(image=IMAGE)
    for k in range(20):
        order = np.roll(np.arange(3), k)
        masks = np.zeros((3, 72, 128), dtype=bool)
        masks[np.arange(3), order, order] = True
        source = sv.Detections(
            xyxy=XYXY[order] + 2.0 * k,
            mask=masks,
            confidence=SCORES[order],
            class_id=IDS[order],
            data={"class_name": np.array([NAMES[i] for i in IDS[order]]), "plate": order.copy()},
        )
        if k == 10:
            tracker.save(tmp_path / "state.npz")
            tracker = Tracker.load(tmp_path / "state.npz")
        table = tracker.update(source, t=k / 20, sensor="rgb")
    back = table.to_supervision()
    assert len(back) == 3
    for name in ("xyxy", "mask", "confidence", "class_id"):
        np.testing.assert_array_equal(getattr(back, name), getattr(source, name))
    assert back.data["plate"].tolist() == order.tolist()
    assert source.tracker_id is None
    assert sorted(back.tracker_id.tolist()) == sorted(table.track_id.tolist())
    for row, identity in enumerate(back.tracker_id.tolist()):
        np.testing.assert_allclose(table.of(identity).xyxy[0], back.xyxy[row], atol=6.0)
    # Of some tracks only their detections; of the tracks themselves their boxes.
    one = table.of(int(back.tracker_id[0])).to_supervision()
    assert one.data["plate"].tolist() == [order[0]]
    assert table.to_supervision(own=False).confidence.tolist() == table.existence.tolist()
    nothing = tracker.update(sv.Detections.empty(), t=1.0, sensor="rgb")
    assert len(nothing.to_supervision()) == 0


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_what_no_reported_track_took_has_minus_one(preset):
    sv = pytest.importorskip("supervision")
    tracker = Tracker(preset, image=IMAGE)
    for k in range(20):
        table = tracker.update(
            sv.Detections(xyxy=XYXY[:2] + k, confidence=SCORES[:2]), t=k / 20, sensor="rgb"
        )
    stray = np.vstack([XYXY[:2] + 20, [[1000.0, 100.0, 1000.0, 140.0], [1100.0, 600.0, 1150.0, 640.0]]])
    source = sv.Detections(xyxy=stray, confidence=np.array([0.9, 0.8, 0.5, 0.05]))
    back = tracker.update(source, t=1.0, sensor="rgb").to_supervision()
    assert sorted(back.tracker_id[:2].tolist()) == sorted(table.track_id.tolist())
    assert back.tracker_id[2:].tolist() == [-1, -1]
