"""What the functions of one call take, and one line for what they do not."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Detections, Trajectories, calibrate, evaluate, track
from jeat_graph.data.errors import DataError
from jeat_graph.data.truth_frames import truth_of_frame

pd = pytest.importorskip("pandas")


def truth_frame(n=5):
    left = 100.0 + 3 * np.arange(n)
    return pd.DataFrame({"time": np.arange(n) / 20, "id": 7, "x1": left, "y1": 100.0, "w": 60.0, "h": 40.0})


@pytest.mark.parametrize("recording", [np.zeros((3, 5)), ["det.csv"], None, {"t": [1.0]}, 3])
def test_what_is_no_recording_is_refused_with_what_is(recording):
    with pytest.raises(DataError, match="detections are Detections, a data frame, or the path"):
        track(recording)


def test_a_recording_with_dates_as_text_is_refused():
    with pytest.raises(DataError, match="dates"):
        track(truth_frame().assign(time="2024-05-01"))
    with pytest.raises(DataError, match="must be numbers"):
        Detections.from_rows(["2024-05-01"], ["rgb"], [[1, 2, 3, 4]], [1])


def test_truth_may_be_a_data_frame():
    assert evaluate(Trajectories.empty(), truth_frame())["causal"]["FN"] == 5
    nothing = pd.DataFrame({"time": [9.0]})
    truth = truth_of_frame(pd.concat([truth_frame().assign(vx=60.0, ignore=[1, 0, 0, 0, None]), nothing]))
    assert len(truth) == 5
    assert truth.frame_times()[-1] == 9.0
    assert truth.ignore.tolist() == [True, False, False, False, False]
    assert truth.motion[0, :3].tolist() == [130.0, 120.0, 60.0]
    for bad, what in (({"w": 0.0}, "positive"), ({"time": 0.0}, "twice"), ({"id": 0.5}, "whole")):
        with pytest.raises(DataError, match=what):
            truth_of_frame(truth_frame().assign(**bad))


@pytest.mark.parametrize("what", [None, 3, ["gt.csv"], {}])
def test_what_is_no_truth_and_what_are_no_tracks_is_refused(what):
    with pytest.raises(DataError, match="truth is a GroundTruth, a data frame"):
        evaluate(Trajectories.empty(), what)
    with pytest.raises(DataError, match="tracks are what track"):
        evaluate(what, truth_frame())


def test_calibrate_takes_one_data_frame_as_one_recording():
    with pytest.raises(DataError, match="1 recordings and 2 truths"):
        calibrate(truth_frame(), [truth_frame()] * 2, image=(1920, 1080))
