"""What networks are shown: changed pictures and events, with boxes that lie where the changed things are."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")

from jeat_graph.data.errors import DataError  # noqa: E402
from jeat_graph.data.events import EventArray  # noqa: E402
from jeat_graph.data.trajectories import GroundTruth  # noqa: E402
from jeat_graph.detection.models.event_places import EventPlaces, event_scale  # noqa: E402
from jeat_graph.detection.models.feeding import letterbox_scale, place, usual_feed  # noqa: E402
from jeat_graph.detection.models.model_settings import ModelSettings  # noqa: E402
from jeat_graph_sehn.training.batches import Batches  # noqa: E402
from jeat_graph_sehn.training.coco_pictures import read_coco_pictures  # noqa: E402
from jeat_graph_sehn.training.data_sets import (  # noqa: E402
    Picture,
    read_event_segments,
    read_pictures,
    split_by_segment,
)
from jeat_graph_sehn.training.event_samples import draw_sequence, drawn_events, windows_of  # noqa: E402
from jeat_graph_sehn.training.judging import LAYOUT, Looked, _shared_out, precision_of  # noqa: E402
from jeat_graph_sehn.training.picture_samples import CutOut, cut_out, draw_light, draw_window  # noqa: E402
from jeat_graph_sehn.training.settings import (  # noqa: E402
    EventChanges,
    NetSettings,
    PictureChanges,
    TrainSettings,
)
from jeat_graph_sehn.training.truth_at import TrueBoxes, TruthByTime  # noqa: E402

from .small_sets import FRAMES, SIZE, write_segment  # noqa: E402

NO_CHANGE = PictureChanges(mirror_share=0.0, zoom=1.0, exposure=1.0, gamma=1.0, noise=0.0)


def one_box(*corners):
    return TrueBoxes(np.array([corners], dtype=float), np.array([False]), np.array([1]))


@pytest.mark.parametrize("seed", range(8))
def test_boxes_stay_on_what_they_are_about(seed):
    """A bright box in a dark picture: after any cut-out its pixels end where the moved box does."""
    rng = np.random.default_rng(seed)
    frame = np.zeros((96, 128, 3), dtype=np.uint8)
    frame[30:70, 40:100] = 255
    truth = one_box(40.0, 30.0, 100.0, 70.0)
    window = draw_window(rng, (128, 96), (64, 48), truth, (1.6, 0.5, 1.0))
    (corners,), _ = window.boxes(truth)
    values = cut_out(frame, window, rng, draw_light(rng, NO_CHANGE)).mean(axis=0)
    rows, columns = np.nonzero(values > 0.6)
    # The pad is grey (0.45), and interpolation blurs an edge over a pixel.
    found = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
    np.testing.assert_allclose(found, corners, atol=1.01)


def test_boxes_that_are_mostly_cut_off_are_not_asked_for():
    window = CutOut((64, 48), 1.0, -90.0, 0.0, False)
    corners, ignored = window.boxes(one_box(40.0, 10.0, 100.0, 30.0))
    np.testing.assert_allclose(corners, [[0.0, 10.0, 10.0, 30.0]])
    assert ignored.tolist() == [True]
    _, ignored = window._replace(left=-50.0).boxes(one_box(40.0, 10.0, 100.0, 30.0))
    assert ignored.tolist() == [False]
    assert len(window._replace(left=-101.0).boxes(one_box(40.0, 10.0, 100.0, 30.0))[0]) == 0


def test_truth_between_two_frames_lies_between_their_boxes():
    truth = TruthByTime(
        GroundTruth(
            t=np.array([0.0, 0.0, 0.1, 0.1]),
            object_id=np.array([1, 2, 1, 3]),
            boxes=np.array([[0.0, 0, 10, 10], [50, 0, 5, 5], [8, 4, 12, 10], [90, 0, 5, 5]]),
            motion=None,
            ignore=np.zeros(4, dtype=bool),
            classes=None,
            distance=None,
            frames=np.array([0.0, 0.1]),
        )
    )
    found = truth.at(0.025)
    np.testing.assert_allclose(found.corners[0], [2.0, 1.0, 12.5, 11.0])
    assert found.object_id.tolist() == [1, 2, 3]
    assert found.ignored.tolist() == [False, True, True]
    assert truth.at(0.1).ignored.tolist() == [False, False]
    # The right side of vehicle 1 goes farthest: 10 px, half of them in half of the time.
    assert truth.moved(0.0, 0.1, 9.0) == {1}
    assert truth.moved(0.0, 0.1, 11.0) == set()
    assert truth.moved(0.05, 0.1, 4.5) == {1}
    assert truth.moved(0.05, 0.1, 5.5) == set()


def test_events_lie_in_the_boxes_of_the_moment(small_set):
    """Mirrored, scaled and at another speed: most events of the newest bins are in the boxes of then."""
    settings = TrainSettings(
        crop_px=(64, 48), steps=3, most_step_bins=4, events=EventChanges(noise_hz_px=0.0, drop_share=0.3)
    )
    net = NetSettings(kind="events")
    for seed in range(6):
        segment = read_event_segments(small_set)[seed % 2]
        drawn = draw_sequence(segment, np.random.default_rng(seed), net, settings)
        assert drawn.windows.shape == (3, 20, 48, 64)
        for window, corners in zip(drawn.windows, drawn.corners, strict=True):
            rows, columns = np.nonzero(window[-4:].sum(axis=0))
            inside = np.zeros(len(rows), dtype=bool)
            for left, top, right, bottom in corners:
                inside |= (
                    (columns >= left - 1.5)
                    & (columns < right + 1.5)
                    & (rows >= top - 1.5)
                    & (rows < bottom + 1.5)
                )
            assert len(rows) > 5
            assert inside.mean() > 0.95


def test_a_batch_is_the_same_whoever_asks_and_when(small_set):
    members = read_pictures(small_set)
    settings = TrainSettings(crop_px=(32, 32), batch=2, seed=9)
    a, b = (Batches(members, NetSettings(), settings) for _ in range(2))
    for step in (0, 1, 2):
        a.get(step)
    late, direct = a.get(3), b.get(3)
    assert torch.equal(late.steps[0], direct.steps[0])
    assert all(torch.equal(x.boxes, y.boxes) for x, y in zip(late.targets[0], direct.targets[0], strict=True))
    assert not torch.equal(direct.steps[0], b.get(4).steps[0])
    a.close()
    b.close()


def test_segments_are_shown_alike_often_where_that_is_asked_for():
    """One world of nine pictures and one of a single one: each makes half of what is shown."""
    loaded = []

    def picture(group, number):
        def load():
            loaded.append(group)
            return np.zeros((32, 32, 3), dtype=np.uint8)

        return Picture(group, "set", load, TrueBoxes(np.zeros((0, 4)), np.zeros(0, bool), np.zeros(0, int)))

    members = [picture("long", k) for k in range(9)] + [picture("short", 0)]
    for by_segment, share in ((True, 0.5), (False, 0.1)):
        loaded.clear()
        settings = TrainSettings(crop_px=(32, 32), batch=10, by_segment=by_segment, kept_mb=0.0)
        batches = Batches(members, NetSettings(), settings)
        for step in range(4):
            batches.get(step)
        batches.close()
        assert np.mean([group == "short" for group in loaded[:40]]) == share


def test_no_segment_is_both_learned_from_and_judged(tmp_path):
    for segment in range(3):
        write_segment(tmp_path / "set" / "segments" / f"{segment:06d}", segment)
    members = read_pictures(tmp_path / "set")
    assert len(members) == 3 * FRAMES
    split = split_by_segment(members, [tmp_path / "set"])
    assert {m.group for m in split.learned}.isdisjoint({m.group for m in split.judged})
    (tmp_path / "set" / "val.txt").write_text("segments/000000\n", encoding="utf-8")
    (tmp_path / "set" / "test.txt").write_text("segments/000002\n", encoding="utf-8")
    split = split_by_segment(members, [tmp_path / "set"])
    assert {m.group[-1] for m in split.learned} == {"1"}
    assert {m.group[-1] for m in split.judged} == {"0"}


def coco(tmp_path, **changes):
    """A COCO file of one picture with a car, a crowd and a person."""
    import cv2

    (tmp_path / "images").mkdir(exist_ok=True)
    cv2.imwrite(str(tmp_path / "images" / "a.png"), np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
    tree = {
        "images": [{"id": 7, "file_name": "a.png", "width": SIZE[0], "height": SIZE[1]}],
        "categories": [{"id": 1, "name": "person"}, {"id": 3, "name": "car"}],
        "annotations": [
            {"image_id": 7, "category_id": 3, "bbox": [1, 2, 10, 5]},
            {"image_id": 7, "category_id": 3, "bbox": [30, 2, 10, 5], "iscrowd": 1},
            {"image_id": 7, "category_id": 1, "bbox": [20, 20, 3, 9]},
        ],
    } | changes
    path = tmp_path / "instances.json"
    path.write_text(json.dumps(tree), encoding="utf-8")
    return path


def test_of_a_coco_file_vehicles_are_taken(tmp_path):
    (picture,) = read_coco_pictures(coco(tmp_path))
    np.testing.assert_allclose(picture.truth.corners, [[1, 2, 11, 7], [30, 2, 40, 7]])
    assert picture.truth.ignored.tolist() == [False, True]
    assert picture.load().shape == (SIZE[1], SIZE[0], 3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"images": [{"id": 1, "file_name": "b.png"}]}, "names the picture b.png, which is not in"),
        ({"images": []}, "lists no images"),
        ({"annotations": [{"image_id": 7, "bbox": [1, 2, 3]}]}, "annotation 1 needs image_id and a bbox"),
        ({"annotations": 5}, "must have a list of `annotations`"),
    ],
)
def test_a_coco_file_that_is_wrong_is_refused_by_name(tmp_path, changes, words):
    with pytest.raises(DataError, match=re.escape(words)):
        read_coco_pictures(coco(tmp_path, **changes))


def test_precision_by_size_leaves_out_what_is_of_other_sizes():
    truth = TrueBoxes(
        np.array([[0.0, 0, 8, 8], [50.0, 50, 90, 90]]), np.zeros(2, dtype=bool), np.array([1, 2])
    )
    found = np.array([[50.0, 50, 90, 90], [20.0, 20, 28, 28], [0.0, 0, 8, 8]])
    looks = [Looked("a", found, np.array([0.9, 0.8, 0.7]), truth)]
    assert precision_of(looks, 32.0).ap50 == pytest.approx(100.0)
    # Of the small ones the first is false, the second true: precision 1/2 at every recall.
    assert precision_of(looks, 0.0, 12.0).ap50 == pytest.approx(50.0)
    assert precision_of(looks).boxes == 2
    assert np.isnan(precision_of(looks, 12.0, 32.0).ap50)


@pytest.mark.parametrize("times", [0.5, 1.0, 1.5])
def test_pictures_are_learned_from_at_the_size_at_which_they_are_looked_at(times):
    """Unchanged but for its size, what is learned from is what the network is fed with in use."""
    rng = np.random.default_rng(4)
    frame = np.kron(rng.integers(0, 256, (12, 16, 3)), np.ones((8, 8, 1))).astype(np.uint8)
    side = (round(128 * times), round(96 * times))
    fed, at = place(frame, side, usual_feed(LAYOUT, ModelSettings()))
    served = letterbox_scale((128, 96), side)
    truth = one_box(40.0, 30.0, 100.0, 70.0)
    window = draw_window(rng, (128, 96), side, truth, (1.0, 0.0, 0.0), served)
    shown = cut_out(frame, window, rng, draw_light(rng, replace(NO_CHANGE, grey_share=0.0)))
    np.testing.assert_allclose(at.back(window.boxes(truth)[0]), truth.corners, atol=1e-9)
    inner = (slice(None), slice(2, -2), slice(2, -2))
    # Both interpolate between neighbours, with weights in steps of 1/32 or finer.
    assert np.abs(fed[0][inner] - shown[inner]).max() < 1 / 32 + 2 / 255


@pytest.mark.parametrize("times", [1, 2])
def test_events_are_learned_from_at_the_size_at_which_they_are_looked_at(small_set, times):
    side = (SIZE[0] * times, SIZE[1] * times)
    changes = EventChanges(mirror_share=0.0, zoom=1.0, drop_share=0.0, time_scale=1.0, noise_hz_px=0.0)
    settings = TrainSettings(crop_px=side, steps=2, least_step_bins=2, most_step_bins=2, events=changes)
    net = NetSettings(kind="events")
    segment = read_event_segments(small_set)[0]
    drawn = draw_sequence(segment, np.random.default_rng(5), net, settings, side)
    plan, events, size_px = drawn_events(segment, np.random.default_rng(5), net, settings)
    own_us = (events.t_us - plan.start_us).astype(np.int64)
    kept = (own_us >= 0) & (own_us < plan.ends_us(net)[-1])
    own = EventArray(own_us[kept], events.x[kept], events.y[kept], events.polarity[kept])
    moved = EventPlaces(size_px, event_scale(size_px, side)).moved(own)
    served = windows_of(moved, side, net, plan.ends_us(net))
    np.testing.assert_array_equal(drawn.windows, np.stack(served))
    for corners, end in zip(drawn.corners, plan.ends_us(net), strict=True):
        np.testing.assert_allclose(corners, times * segment.truth.at(plan.file_s(end)).corners, atol=1e-9)


def test_recordings_are_judged_for_long_enough_that_something_has_moved(small_set):
    """Of many recordings few are, rather than the first window of each, in which nothing has."""
    segments = read_event_segments(small_set) * 6
    chosen, each = _shared_out(segments, 16)
    assert (len(chosen), each) == (2, 8)
    assert _shared_out(segments, 5) == ([segments[0]], 5)
    chosen, each = _shared_out(segments, 240)
    assert (len(chosen), each) == (12, 20)
