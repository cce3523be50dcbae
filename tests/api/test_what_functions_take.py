"""What the functions of one call take, and one line for what they do not."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from jeat_graph import (
    Detections,
    Tracker,
    Trajectories,
    calibrate,
    compare,
    evaluate,
    load_config,
    read_detections,
    read_run,
    track,
)
from jeat_graph.data.errors import DataError, InputWarning
from jeat_graph.data.truth_frames import truth_of_frame

pd = pytest.importorskip("pandas")


def truth_frame(n=5):
    left = 100.0 + 3 * np.arange(n)
    return pd.DataFrame({"time": np.arange(n) / 20, "id": 7, "x1": left, "y1": 100.0, "w": 60.0, "h": 40.0})


@pytest.mark.parametrize("recording", [np.zeros((3, 5)), ["det.csv"], None, {"t": [1.0]}, 3])
def test_what_is_no_recording_is_refused_with_what_is(recording):
    with pytest.raises(DataError, match="detections are Detections, a data frame, or the path"):
        track(recording)


def test_dates_as_text_are_read_from_a_data_frame_as_from_a_file():
    dates = [f"2024-05-01T12:00:00.{5 * k:02d}" for k in range(5)]
    found = Detections.from_pandas(truth_frame().assign(time=dates))
    assert found.scan_t == pytest.approx(1714564800.0 + 0.05 * np.arange(5), abs=1e-6)
    with pytest.raises(DataError, match="row 0: t must be a time, got '2024-05-32'"):
        track(truth_frame().assign(time="2024-05-32"))
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


def people_s_rows(n=40):
    """Boxes of a tracker in two videos, by frame number from 0, with classes by number."""
    left = 100.0 + 3 * np.arange(n)
    one = pd.DataFrame({"frame": np.arange(n), "x1": left, "y1": 100.0, "x2": left + 60.0, "y2": 140.0})
    both = pd.concat([one.assign(video=name, x2=one.x2 + wide) for name, wide in (("a", 0.0), ("b", 30.0))])
    return both.assign(class_id=[2] * n + [7] * n, tracker_id=1)


OPTIONS = {"rate_hz": 20.0, "video": "b", "class_names": {2: "car", 7: "truck"}, "first_frame": 0}


def test_data_frames_and_files_are_read_alike_with_the_options_of_the_commands(tmp_path):
    frame, path, names = people_s_rows(), tmp_path / "rows.csv", tmp_path / "names.yaml"
    frame.to_csv(path, index=False)
    names.write_text("names: {2: car, 7: truck}\n")
    with pytest.raises(DataError, match=r"only-video NAME .in Python video="):
        track(frame, rate_hz=20.0)
    read = [
        Detections.from_pandas(frame, **OPTIONS),
        read_detections(path, **OPTIONS),
    ]
    for found in read:
        assert found.classes.tolist() == ["truck"] * 40
        assert found.boxes[0].tolist() == [100.0, 100.0, 90.0, 40.0]
    runs = [
        track(source, image=(1280, 720), classes=["truck"], **(OPTIONS | {"class_names": said}))
        for source, said in ((frame, OPTIONS["class_names"]), (path, names), (frame, str(names)))
    ]
    assert all(np.array_equal(one.causal.mean, runs[0].causal.mean) for one in runs)
    assert set(runs[0].causal.classes) == {"truck"}
    for tracks, truth in ((frame, frame), (frame, path), (path, frame), (path, path)):
        scores = evaluate(tracks, truth, classes=["truck"], **OPTIONS)
        assert scores["causal"]["MOTA"] == 100.0
    assert len(read_run(path, **OPTIONS).causal) == 40
    assert len(evaluate(runs[0], path, **(OPTIONS | {"class_names": names}))) == 2
    assert compare(frame, truth=path, image=(1280, 720), lags_s=[0.0], **OPTIONS).values
    assert set(calibrate(path, image=(1280, 720), **OPTIONS).sensors) == {"rgb"}
    with pytest.raises(DataError, match="nothing is of class bus; there are: truck"):
        track(frame, classes=["bus"], **OPTIONS)


@pytest.mark.parametrize("make", ["pandas", "arrow", "polars", "lazy"])
def test_every_kind_of_data_frame_is_a_table(make):
    frame = people_s_rows(5)
    if make == "arrow":
        frame = pytest.importorskip("pyarrow").Table.from_pandas(frame)
    elif make in ("polars", "lazy"):
        frame = pytest.importorskip("polars").from_pandas(frame)
        frame = frame.lazy() if make == "lazy" else frame
    found = Detections.from_pandas(frame, **OPTIONS)
    assert found.scan_t.tolist() == [0.0, 0.05, 0.1, 0.15, 0.2]
    assert found.classes.tolist() == ["truck"] * 5
    assert truth_of_frame(frame, **OPTIONS).object_id.tolist() == [1] * 5
    assert Trajectories.from_pandas(frame, **OPTIONS).classes.tolist() == ["truck"] * 5


def test_frames_without_boxes_are_empty_scans_in_a_data_frame_as_in_a_file(tmp_path):
    frame = people_s_rows(9)[lambda rows: (rows.video == "a") & (rows.frame != 4)].drop(columns="video")
    frame.to_csv(tmp_path / "rows.csv", index=False)
    found = Detections.from_pandas(frame, rate_hz=20.0)
    assert found.scan_t.tolist() == read_detections(tmp_path / "rows.csv", rate_hz=20.0).scan_t.tolist()
    assert np.diff(found.scan_start).tolist() == [1] * 4 + [0] + [1] * 4
    assert Detections.from_pandas(frame, rate_hz=20.0, fill_empty=False).num_scans == 8


def test_times_in_ns_since_1970_are_read_from_whole_numbers(tmp_path):
    t = 1_700_000_000_000_000_000 + 50_000_000 * np.arange(3)
    frame = pd.DataFrame({"t": t, "left": 1.0, "top": 2.0, "width": 3.0, "height": 4.0})
    frame.assign(sensor="rgb").to_parquet(tmp_path / "ns.parquet")
    for found in (
        Detections.from_pandas(frame, time_unit="ns"),
        read_detections(tmp_path / "ns.parquet", time_unit="ns"),
    ):
        assert found.scan_t == pytest.approx(1.7e9 + 0.05 * np.arange(3), abs=1e-6)


def test_a_result_as_a_data_frame_is_checked_as_a_file_of_it_is():
    frame = people_s_rows(3)[lambda rows: rows.video == "a"]
    with pytest.raises(DataError, match=r"row 2: track 1 is there twice at t = 0\.05"):
        Trajectories.from_pandas(frame.assign(frame=[0, 1, 1]), rate_hz=20.0)
    with pytest.raises(DataError, match="row 1: width and height must not be negative"):
        Trajectories.from_pandas(frame.assign(x2=[200.0, 50.0, 200.0]), rate_hz=20.0)
    with pytest.raises(DataError, match="need the column object_id"):
        Trajectories.from_pandas(frame.drop(columns="tracker_id"), rate_hz=20.0)


def test_the_picture_is_as_large_as_a_file_beside_the_recording_says(tmp_path):
    lines = [f"{k + 1},-1,{40 + k},60,30,20,0.9,-1,-1,-1\n" for k in range(30)]
    (tmp_path / "det.txt").write_text("".join(lines))
    (tmp_path / "seqinfo.ini").write_text("[Sequence]\nframeRate=20\nimWidth=66\nimHeight=720\n")
    with pytest.warns(InputWarning, match="lie outside the picture of 66 x 720 px"):
        track(tmp_path / "det.txt")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        track(tmp_path / "det.txt", image=(1280, 720))
        track(tmp_path / "det.txt", load_config("default", ["image.width=1280", "image.height=720"]))


def test_a_column_of_several_kinds_is_text_and_what_is_missing_stays_missing():
    frame = truth_frame(5).assign(label=["car", None, 3, float("nan"), True]).drop(columns="id")
    assert Detections.from_pandas(frame).classes.tolist() == ["car", "", "3", "", "True"]
    with pytest.raises(DataError, match="row 0: score must be a number, got 'high'"):
        Detections.from_pandas(frame.assign(score=["high", 1.0, 0.5, 1, 0]))


def test_detections_that_are_given_as_truth_are_asked_about(tmp_path):
    frame = truth_frame(5).assign(id=-1, time=[0.0, 0.0, 0.1, 0.1, 0.2])
    frame.to_csv(tmp_path / "gt.csv", index=False)
    for source in (frame, tmp_path / "gt.csv"):
        with pytest.raises(DataError, match=r"object -1 is there twice at t = 0; are these detections"):
            evaluate(Trajectories.empty(), source)


def test_one_class_may_stand_alone_and_what_is_no_list_of_names_is_refused():
    frame = people_s_rows()
    alone, listed = (
        track(frame, image=(1280, 720), classes=one, **OPTIONS).causal for one in ("truck", ["truck"])
    )
    assert np.array_equal(alone.mean, listed.mean)
    assert evaluate(frame, frame, classes="truck", **OPTIONS)["causal"]["MOTA"] == 100.0
    for wrong in (7, {"x": "car"}):
        with pytest.raises(DataError, match="class_names are names in order, or by number"):
            Detections.from_pandas(frame, **(OPTIONS | {"class_names": wrong}))
    with pytest.raises(DataError, match=r"the frame rate must be a number .Hz., not '20'"):
        Detections.from_pandas(frame, **(OPTIONS | {"rate_hz": "20"}))


@pytest.mark.filterwarnings("error::UserWarning")
def test_a_lazy_frame_is_taken_wherever_a_data_frame_is():
    rows = people_s_rows(9)[lambda r: r.video == "a"].assign(
        t=lambda r: r.frame / 20.0, sensor="rgb", score=0.9
    )
    rows = rows.drop(columns=["video", "frame"])

    def as_lazy(frame):
        return pytest.importorskip("polars").from_pandas(frame).lazy()

    lazy = as_lazy(rows)
    options = {"image": (1280, 720), "class_names": OPTIONS["class_names"]}
    tracks, lazily = track(rows, **options), track(lazy, **options)
    assert lazily.causal.t.tolist() == tracks.causal.t.tolist()
    truth = rows.assign(object_id=1)
    said = {"class_names": options["class_names"]}
    assert evaluate(lazily, as_lazy(truth), **said) == evaluate(tracks, truth, **said)
    one = rows.head(1)[["x1", "y1", "x2", "y2", "score"]]
    taken = [Tracker(image=(1280, 720)).update(boxes, t=0.0, sensor="rgb") for boxes in (one, as_lazy(one))]
    assert len(taken[0]) == len(taken[1])
