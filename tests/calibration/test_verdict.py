"""Between two configurations the more accurate one wins, if it wins by more than chance."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph import load_config
from jeat_graph.calibration.cuts import cut_scans, folds, shorten
from jeat_graph.calibration.verdict import Verdict, better, judge, scene_error, standard_error
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.eval.metrics import evaluate
from jeat_graph.runs.declaring import own_picture
from jeat_graph.tracking.whole import both_tables

LEAST = 0.1


def verdict(accuracy, weight=None):
    count = len(accuracy)
    weights = np.ones(count) if weight is None else np.asarray(weight, dtype=float)
    accuracies = np.asarray(accuracy, dtype=float)
    return Verdict(accuracies, weights, np.arange(count) % 2, accuracies, weights)


def test_a_gain_on_every_recording_is_better():
    assert better(verdict([81, 82, 83, 84]), verdict([80, 81, 82, 83]), LEAST)


def test_a_gain_on_one_half_alone_is_chance():
    assert not better(verdict([90, 80, 90, 80]), verdict([80, 81, 80, 81]), LEAST)


def test_a_gain_that_the_recordings_disagree_about_is_chance():
    now = verdict([80.0] * 8)
    gains = np.array([8.0, 8.0, -7.0, -7.0, 0.1, 0.1, 0.1, 0.1])
    assert gains.mean() > LEAST
    assert not better(verdict(80.0 + gains), now, LEAST)


def test_standard_error_is_that_of_a_mean():
    gain = np.array([1.0, 2.0, 4.0, 7.0])
    assert standard_error(gain, np.full(4, 3.0)) == pytest.approx(gain.std(ddof=1) / 2.0)
    assert standard_error(gain[:2], np.ones(2)) == 0.0


@given(
    st.lists(st.floats(0.0, 100.0), min_size=2, max_size=8),
    st.lists(st.floats(0.0, 100.0), min_size=2, max_size=8),
)
def test_two_are_never_better_than_each_other(one, other):
    count = min(len(one), len(other))
    a, b = verdict(one[:count]), verdict(other[:count])
    assert not (better(a, b, LEAST) and better(b, a, LEAST))


def test_accuracy_is_the_mean_of_three_scores_of_both_tables_of_each_recording(recordings):
    config, parts = load_config("default"), folds(shorten(recordings, 300))
    found = judge([config] * len(parts), parts)
    for k, (detections, truth) in enumerate([one for part in parts for one in part]):
        causal, smoothed = both_tables(own_picture(config, detections), detections)
        s = evaluate([(truth, causal)], instants=[np.unique(detections.scan_t)])
        later = evaluate([(truth, smoothed)], kind="smoothed")
        total = s.MOTA + s.IDF1 + s.HOTA + later.MOTA + later.IDF1 + later.HOTA
        assert found.accuracy[k] == pytest.approx(total / 6.0)
        assert found.weight[k] == s.truth_boxes


def test_few_recordings_are_judged_by_the_spread_over_parts_of_their_time(recordings):
    config, parts = load_config("default"), folds(shorten(recordings[:1], 300))
    found = judge([config] * len(parts), parts)
    assert len(found.accuracy) == 2
    assert len(found.part_accuracy) == 6
    assert found.part_weight.sum() == found.weight.sum(), "each true box is in one part"
    assert found.part_weight.max() < 2.0 * found.part_weight.min()
    many = [(detections, truth) for detections, truth in shorten(recordings[:1], 60)] * 6
    of_many = judge([config, config], [many[:3], many[3:]])
    np.testing.assert_array_equal(of_many.part_accuracy, of_many.accuracy)


def test_a_part_of_the_time_in_which_nothing_was_tracked_counts_as_missed(recordings):
    config, (detections, truth) = load_config("default"), shorten(recordings[:1], 300)[0]
    late = 0.5 * (detections.scan_t[0] + detections.scan_t[-1])
    boxes = [np.flatnonzero(detections.scan_t > late)[0], detections.num_scans]
    found = judge([config], [[(cut_scans(detections, *boxes), truth)]])
    assert len(found.part_accuracy) == 6
    assert found.part_accuracy[0] == 0.0 < found.part_accuracy[-1]


def test_a_gain_that_the_parts_of_the_time_disagree_about_is_chance():
    def one_recording(parts):
        both = np.array([np.mean(parts[:3]), np.mean(parts[3:])])
        return Verdict(both, np.ones(2), np.arange(2), np.asarray(parts, dtype=float), np.ones(6))

    now = one_recording([80.0] * 6)
    assert better(one_recording([81.0] * 6), now, LEAST)
    assert not better(one_recording([85.0, 72.0, 88.0, 73.0, 84.0, 87.0]), now, LEAST)


def test_scenes_that_agree_by_luck_do_not_tell_how_far_scenes_scatter():
    """A factor of .7 on the noise of four sequences of cars; of a fifth, that shakes, it cost two points."""
    now = verdict([91.87, 93.02, 79.03, 94.82], weight=[1307, 673, 1339, 1413])
    then = verdict([91.88, 93.26, 79.24, 94.93], weight=[1307, 673, 1339, 1413])
    assert better(then, now, 0.05)
    assert not better(replace(then, scene_error=4.0 / np.sqrt(96.0)), now, 0.05)


def test_what_scenes_gain_has_to_be_more_than_scenes_scatter():
    now = [80.0, 80.0]
    for gain, decided in ((1.4, False), (1.6, True)):
        one = replace(verdict([80.0 + gain] * 2), scene_error=0.75)
        assert better(one, verdict(now), LEAST) == decided


def test_scenes_scatter_by_the_root_of_all_their_objects(recordings):
    detections, truth = recordings[0]
    people = np.unique(truth.object_id[~truth.ignore])
    few = replace(truth, ignore=truth.ignore | ~np.isin(truth.object_id, people[:3]))
    whole, part = (scene_error([(detections, one)]) for one in (truth, few))
    assert part == pytest.approx(whole * np.sqrt(len(people) / 3.0))
    # The mean of independent scenes: numbers of objects that differ add up, and people of two scenes are two.
    assert scene_error([(detections, truth)] * 4) == pytest.approx(whole / 2.0)
    both = scene_error([(detections, truth), (detections, few)])
    assert both == pytest.approx(1.0 / np.sqrt(whole**-2 + part**-2))


def test_nothing_to_find_is_no_verdict():
    with pytest.raises(DataError, match="no truth has a box"):
        verdict([])


def test_a_recording_without_a_vehicle_is_judged_with_the_one_before(recordings):
    """False boxes where there is nothing to find must not vanish from the judgement."""
    config, (busy, *_) = load_config("default"), shorten(recordings, 300)
    t = np.repeat(np.arange(40) / 20.0, 2)
    boxes = np.tile([[100.0, 100.0, 60.0, 60.0], [400.0, 300.0, 60.0, 60.0]], (40, 1))
    false = Detections.from_rows(t, np.full(80, "rgb"), boxes, np.full(80, 0.99))
    nothing = GroundTruth(
        t=np.zeros(0),
        object_id=np.zeros(0, dtype=np.int64),
        boxes=np.zeros((0, 4)),
        motion=None,
        ignore=np.zeros(0, dtype=bool),
        frames=np.unique(t),
    )
    alone = judge([config], [[busy]])
    both = judge([config], [[busy, (false, nothing)]])
    assert len(both.accuracy) == len(alone.accuracy) == 1
    assert both.mean < alone.mean
