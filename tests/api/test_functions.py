"""What people call from Python."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import jeat_graph
from jeat_graph import Scan, Tracker, evaluate, load_config, read_run, simulate, track
from jeat_graph.data.errors import ConfigError, DataError


@pytest.fixture(scope="module")
def night():
    return simulate("night", duration_s=3.0, seed=7)


def test_every_name_is_there_and_completed_by_tab():
    names = "Tracker Scan Detections Trajectories load_config read_detections read_truth read_run track"
    wanted = [*names.split(), "evaluate", "compare", "calibrate", "simulate"]
    assert set(wanted) <= set(dir(jeat_graph))
    assert all(callable(getattr(jeat_graph, name)) for name in wanted)
    assert set(jeat_graph.__all__) <= set(dir(jeat_graph))


def test_the_import_brings_no_library_along():
    code = (
        "import sys, jeat_graph; print([m for m in ('numba', 'pandas', 'gtsam', 'cv2') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_tracker_without_arguments_tracks():
    tracker = Tracker()
    for k in range(30):
        tracks = tracker.update([[600 + 3 * k, 300, 80, 60]], t=k / 20, sensor="rgb", scores=[0.9])
    assert len(tracks) == 1
    assert tracks.xyxy[0] == pytest.approx([687, 300, 767, 360], abs=2.0)


def test_a_preset_by_name_takes_another_picture():
    tracker = Tracker("default", image=(1920, 1080))
    assert (tracker.config.image.width, tracker.config.image.height) == (1920.0, 1080.0)


def test_results_of_detectors_and_corners_are_the_same_scan():
    corners = np.array([[10.0, 20.0, 50.0, 80.0]])
    result = SimpleNamespace(boxes=SimpleNamespace(xyxy=corners, conf=np.array([0.9]), cls=None), names={})
    a, b = Tracker(), Tracker()
    first = a.update(result, t=0.0, sensor="rgb")
    second = b.step(Scan.from_xyxy(0.0, "rgb", corners, [0.9]))
    assert np.array_equal(first.mean, second.mean)
    assert a.num_tracks == b.num_tracks == 1


def test_boxes_that_a_detector_has_clipped_to_nothing_are_left_out():
    boxes, looks = [[100.0, 200.0, 0.0, 30.0], [100.0, 200.0, 40.0, 30.0]], [[1.0, 0.0], [0.0, 1.0]]
    tracker = Tracker(image=(1920, 1080))
    tracker.update(boxes, t=0.0, sensor="rgb", embeddings=looks)
    assert tracker.num_tracks == 1
    with pytest.raises(DataError, match="must be positive"):  # a scan made by hand is taken at its word
        tracker.step((0.1, "rgb", boxes, [1.0, 1.0]))


def test_tracking_and_judging_take_objects_or_files(night, tmp_path):
    from jeat_graph.io.tables.detections_io import write_detections
    from jeat_graph.io.tables.truth_io import write_truth

    detections, truth = night
    tracks = track(detections, load_config("default"))
    write_detections(detections, tmp_path / "detections.csv")
    write_truth(truth, tmp_path / "gt.csv")
    again = track(tmp_path / "detections.csv", "default")
    assert len(again.causal) == len(tracks.causal)
    scores = evaluate(tracks, truth)
    assert set(scores) == {"causal", "smoothed"}
    assert scores["causal"]["MOTA"] > 50.0
    assert evaluate(tracks.causal, tmp_path / "gt.csv") == {"causal": scores["causal"]}


def test_a_run_is_read_back(night, tmp_path):
    from jeat_graph.cli.main import main
    from jeat_graph.io.tables.detections_io import write_detections

    write_detections(night[0], tmp_path / "detections.csv")
    assert main(["track", str(tmp_path / "detections.csv"), "--out", str(tmp_path / "run")]) == 0
    run = read_run(tmp_path / "run")
    assert len(run.causal) > 0
    assert len(run.smoothed) > 0
    assert run.record["version"] == jeat_graph.__version__


def test_filter_and_smoother_are_compared(night):
    detections, truth = night
    comparison = jeat_graph.compare(detections, "default", truth, lags_s=(0.0, 0.05, 0.3))
    errors = {row["lag_s"]: row for row in comparison.values["lag_curve"]}
    assert errors[0.05]["position_rmse"] < errors[0.0]["position_rmse"]
    assert errors[0.3]["velocity_rmse"] < errors[0.05]["velocity_rmse"] < errors[0.0]["velocity_rmse"]


def test_a_recording_calibrates_a_configuration(night):
    config = jeat_graph.calibrate(night[0], base="default")
    assert set(config.sensors) == {"rgb", "evt"}
    with pytest.raises(DataError, match="one for each"):
        jeat_graph.calibrate([night[0]], [night[1], night[1]])


def test_one_override_may_stand_alone():
    assert load_config("default", "image.width=1920").image.width == 1920.0


def test_the_size_of_the_picture_may_be_written_as_on_the_command_line():
    assert Tracker("default", image="1920x1080").config.image == Tracker(image=(1920, 1080)).config.image


@pytest.mark.parametrize("size", ["large", "1920", (1920,), 1920, (1, 2, 3), ("a", "b")])
def test_what_is_no_size_of_a_picture_is_said_to_be_none(size):
    with pytest.raises(ConfigError, match="image must be"):
        Tracker("default", image=size)


def test_a_data_frame_is_tracked_as_it_is_and_times_in_ms_are_refused():
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame({"t": np.arange(40) / 20, "left": 100.0 + 3 * np.arange(40)})
    frame = frame.assign(top=100.0, width=60.0, height=40.0, score=0.9)
    assert len(track(frame).causal) >= 38
    with pytest.raises(DataError, match="are the times in ms"):
        track(frame.assign(t=1e3 * frame["t"]))
