"""`benchmarks detection` and `benchmarks raw`, in small: a set of two segments, one of which is for tests."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.detection import only_moved, only_stopped
from benchmarks.raw_segments import segments_in
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.io.events.dsec_writer import EventWriter
from jeat_graph.io.tables.truth_io import write_truth

from ..detection.moving import SIZE, box_at, events_of, picture_of

FRAMES, RATE_HZ = 40, 20.0
CAR = ((10, 60), (60, 8), (40, 20))


def write_segment(folder) -> None:
    """Pictures, events and truth of one thing that moves."""
    import cv2

    rng = np.random.default_rng(0)
    background = rng.uniform(40, 120, (SIZE[1], SIZE[0]))
    (folder / "frames").mkdir(parents=True)
    times = np.arange(FRAMES) / RATE_HZ
    for k, t in enumerate(times.tolist()):
        cv2.imwrite(str(folder / "frames" / f"{k:06d}.png"), picture_of([(CAR, 200)], t, background, rng))
    rows = "".join(f"{k},{round(t * 1e6)}\n" for k, t in enumerate(times))
    (folder / "frames.csv").write_text("index,t_us\n" + rows, encoding="utf-8")
    write_truth(
        GroundTruth(
            t=times,
            object_id=np.ones(FRAMES, dtype=np.int64),
            boxes=np.array([box_at(*CAR, t) for t in times]),
            motion=None,
            ignore=np.zeros(FRAMES, dtype=bool),
        ),
        folder / "gt.csv",
    )
    end_us = round(FRAMES / RATE_HZ * 1e6)
    with EventWriter(folder / "events.h5", SIZE, "none") as writer:
        writer.append(events_of([CAR], FRAMES / RATE_HZ, noise_hz_px=0.05), end_us)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    root = tmp_path_factory.mktemp("raw") / "small"
    for segment in range(2):
        write_segment(root / "segments" / f"{segment:06d}")
    (root / "test.txt").write_text("segments/000001\n", encoding="utf-8")
    return root


@pytest.fixture(scope="module")
def of_both(tmp_path_factory):
    """A network of both sensors that always sees the same box."""
    pytest.importorskip("onnx", reason="pip install onnx")
    from ..detection.models.tiny import telling_net

    path = tmp_path_factory.mktemp("net") / "both.onnx"
    return str(telling_net(path, SIZE, 20, np.array([[10, 60, 50, 80, 0.9, 0]])))


def test_only_segments_for_tests_are_judged(small):
    assert [s.name for s in segments_in([small])] == ["000001"]
    with pytest.raises(DataError, match="2 data sets are called small"):
        segments_in([small, small])


def test_one_sensor_may_be_left_out_where_a_set_lacks_it(small, tmp_path, capsys):
    """Sets of `simulate --sensors rgb` have a file of events with none in it."""
    blind = tmp_path / "blind"
    shutil.copytree(small, blind)
    for segment in (blind / "segments").iterdir():
        with EventWriter(segment / "events.h5", SIZE, "none"):
            pass
    judge = ["detection", str(blind), "--jobs", "1"]
    assert main([*judge, "--events", "none", "--out", str(tmp_path)]) == 0
    found = json.loads((tmp_path / "detection.json").read_text())
    assert [one["sensor"] for one in found["records"]] == ["rgb"]
    assert found["settings"]["detectors"] == {"rgb": [{"name": "motion"}], "evt": []}
    capsys.readouterr()
    assert main([*judge, "--events", "none", "--frames", "none"]) == 2
    assert "no detectors" in capsys.readouterr().err


def test_detectors_are_judged_by_light_motion_and_size(small, tmp_path, capsys):
    assert main(["detection", str(small), "--jobs", "1", "--out", str(tmp_path)]) == 0
    assert "AP50 ± over segments" in capsys.readouterr().out
    found = json.loads((tmp_path / "detection.json").read_text())
    assert found["settings"]["detectors"] == {"rgb": [{"name": "motion"}], "evt": [{"name": "motion"}]}
    by_sensor = {one["sensor"]: one["groups"] for one in found["records"]}
    for groups in by_sensor.values():
        assert groups["all"]["boxes"] == groups["small"]["boxes"]
        sizes = [groups[name]["boxes"] for name in ("below 12 px", "12 to 32 px", "above 32 px")]
        assert sum(sizes) == groups["all"]["boxes"]
    # One thing that moves, on a ground that does not: what the detectors without weights are for.
    assert by_sensor["rgb"]["all"]["boxes"] == FRAMES
    assert by_sensor["rgb"]["all"]["AP50"] > 90.0
    assert by_sensor["evt"]["that moved"]["AP50"] > 90.0


def test_a_network_of_both_sensors_has_a_row_of_its_own(small, of_both, tmp_path, capsys):
    args = ["detection", str(small), "--jobs", "1", "--fused", of_both, "--out", str(tmp_path)]
    assert main(args) == 0
    found = json.loads((tmp_path / "detection.json").read_text())
    assert [(one["sensor"], one["detector"]) for one in found["records"]] == [
        ("rgb", "motion"),
        ("evt", "motion"),
        ("fused", "both.onnx"),
    ]
    assert found["settings"]["detectors"]["fused"][0]["name"] == "both.onnx"
    assert found["records"][2]["scans"] > 10
    assert "both.onnx" in capsys.readouterr().out


def test_from_raw_to_scores(small, of_both, tmp_path, capsys):
    args = ["raw", str(small), "--jobs", "1", "--no-peers", "--out", str(tmp_path)]
    args += ["--fused", of_both]
    assert main(args) == 0
    found = json.loads((tmp_path / "raw.json").read_text())
    rows = {one["row"]: one["scores"] for one in found["records"] if one["source"] == "small"}
    both = "rgb motion + evt motion"
    assert set(rows) == {
        f"paper, {both}",
        *(
            f"default, {what}{how}"
            for what in ("rgb motion", "evt motion", both, "fused both.onnx")
            for how in ("", ", smoothed")
        ),
    }
    assert rows[f"default, {both}, smoothed"]["IDF1"] > 80.0
    honest = {one["row"]: one["nees"] for one in found["records"] if one["source"] == "all"}
    assert honest[f"paper, {both}"] == {}
    assert honest[f"default, {both}, smoothed"]["matched"] > FRAMES / 2
    assert set(found["configs"]) == {"default", "paper"}
    again = tmp_path / "page.md"
    again.write_text("<!-- table: raw -->\n<!-- end -->\n", encoding="utf-8")
    assert main(["raw", "--from", str(tmp_path / "raw.json"), "--readme", str(again)]) == 0
    tracks, _, _ = (tmp_path / "raw.md").read_text().partition("**Errors of position")
    assert tracks.strip() in again.read_text()
    capsys.readouterr()


@pytest.mark.parametrize(
    ("more", "line"),
    [
        (["--frames", "sehm"], "'sehm' is no detector of frames"),
        (["--events", "none.onnx"], "no such file of a network"),
    ],
)
def test_detectors_that_are_not_there_are_named(small, capsys, more, line):
    assert main(["detection", str(small), *more]) == 2
    assert line in capsys.readouterr().err


def test_files_of_one_name_are_told_of(small, tmp_path, capsys):
    paths = [tmp_path / name / "net.onnx" for name in "ab"]
    for path in paths:
        path.parent.mkdir()
        path.touch()
    assert main(["detection", str(small), "--frames", *map(str, paths)]) == 2
    assert "net.onnx is the name of two files" in capsys.readouterr().err


def test_data_must_be_named(capsys):
    assert main(["raw"]) == 2
    assert "give DATA" in capsys.readouterr().err


def two_vehicles(times, boxes):
    """Truth of vehicles 1 and 2 at times (T,); boxes (2 T, 4), of both at each time."""
    return GroundTruth(
        t=np.repeat(times, 2),
        object_id=np.tile([1, 2], len(times)),
        boxes=np.array(boxes),
        motion=None,
        ignore=np.zeros(2 * len(times), dtype=bool),
    )


def test_who_stands_is_not_asked_of_those_who_see_motion():
    """Vehicle 1 goes 20 px/s, so 1 px within 50 ms; vehicle 2 stands."""
    times = np.arange(5) * 0.05
    boxes = [[x, 0.0, 10.0, 10.0] for t in times for x in (20.0 * t, 50.0)]
    truth = two_vehicles(times, boxes)
    ignored = only_moved(truth).ignore.reshape(5, 2)
    assert ignored[:, 1].all()
    assert ignored[:, 0].tolist() == [True, False, False, False, False]


def test_who_has_stopped_is_told_from_who_never_went():
    """Vehicle 1 goes 40 px/s for 0.2 s and stands then; vehicle 2 always stands."""
    times = np.arange(12) * 0.05
    boxes = [[x, 0.0, 10.0, 10.0] for t in times for x in (40.0 * min(t, 0.2), 50.0)]
    truth = two_vehicles(times, boxes)
    asked = ~only_stopped(truth).ignore.reshape(12, 2)
    assert not asked[:, 1].any()
    assert asked[:, 0].tolist() == [bool(t > 0.4 - 1e-9) for t in times]
