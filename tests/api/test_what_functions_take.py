"""What the functions of one call take, and one line for what they do not."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Detections, Trajectories, calibrate, compare, evaluate, track
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


def test_frame_numbers_take_the_rate_that_the_message_asks_for():
    frame = truth_frame(40).drop(columns="time").assign(frame=np.arange(40), confidence=0.9)
    detections = frame.drop(columns="id")
    with pytest.raises(DataError, match="rate_hz"):
        track(detections, image=(1280, 720))
    causal = track(detections, image=(1280, 720), rate_hz=20.0).causal
    assert causal.t.max() == pytest.approx(39 / 20)
    with pytest.raises(DataError, match="rate_hz"):
        evaluate(causal, frame)
    assert evaluate(causal, frame, rate_hz=20.0)["causal"]["FN"] == 0
    assert compare(detections, truth=frame, rate_hz=20.0, image=(1280, 720), lags_s=[0.0]).values
    assert calibrate(detections, rate_hz=20.0, image=(1280, 720)).sensors["rgb"].rate_hz == pytest.approx(20)


def test_files_of_frame_numbers_take_it_too(tmp_path):
    path = tmp_path / "det.txt"
    path.write_text("".join(f"{k},-1,{100 + 3 * k},100,60,40,0.9,-1,-1,-1\n" for k in range(1, 41)))
    assert track(path, image=(1280, 720), rate_hz=10.0).causal.t.max() == pytest.approx(3.9)
