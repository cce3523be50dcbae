"""From which number frames count is decided once, for truth and result together, whatever their formats."""

from __future__ import annotations

import json
from itertools import product

import numpy as np
import pandas as pd
import pytest

from jeat_graph import compare, evaluate
from jeat_graph.cli.main import main
from jeat_graph.data.frame_numbers import FrameCount, first_frames

HZ = 25.0
TRUTH = [(frame, 1, 40 + 15 * frame) for frame in range(5, 40)]
#: The tracker reports something false in frame 0, and the object as it is.
RESULT = [(0, 9, 1100), *TRUTH]


def text(rows, header=""):
    return header + "".join(f"{frame},{number},{left},200,24,20,1\n" for frame, number, left in rows)


def mot(path, rows):
    path.write_text(text(rows))
    return path


def csv(path, rows):
    path = path.with_suffix(".csv")
    path.write_text(text(rows, "frame,id,left,top,width,height,conf\n"))
    return path


def parquet(path, rows):
    frame = pd.DataFrame(rows, columns=["frame", "id", "left"])
    frame = frame.assign(top=200, width=24, height=20, conf=1.0)
    frame.to_parquet(path.with_suffix(".parquet"))
    return path.with_suffix(".parquet")


def coco(path, rows):
    path = path.with_suffix(".json")
    boxes = [
        {"image_id": frame, "track_id": number, "category_id": 0, "bbox": [left, 200, 24, 20], "score": 1.0}
        for frame, number, left in rows
    ]
    path.write_text(json.dumps(boxes))
    return path


def yolo(path, rows):
    path.mkdir()
    for frame in range(min(row[0] for row in rows), max(row[0] for row in rows) + 1):
        lines = [
            f"0 {(left + 12) / 2000} {210 / 1000} {24 / 2000} {20 / 1000} 1 {number}\n"
            for one, number, left in rows
            if one == frame
        ]
        (path / f"a_{frame}.txt").write_text("".join(lines))
    return path


# What is decided is said in a warning, which `test_python_says_it_in_a_warning` looks at.
pytestmark = [
    pytest.mark.filterwarnings("ignore:.*lie before or after the truth"),
    pytest.mark.filterwarnings("ignore:.*frames count from 0, as those of"),
]
OPEN = (mot, csv, parquet, coco, yolo)


@pytest.mark.parametrize(("result", "truth"), list(product(OPEN, OPEN)))
def test_a_frame_0_in_the_result_alone_makes_the_truth_count_from_0(tmp_path, result, truth):
    """35 boxes, one false: (35 - 1) / 35; a shift by a frame makes 35 missed and 36 false."""
    found = evaluate(
        result(tmp_path / "res", RESULT), truth(tmp_path / "gt", TRUTH), rate_hz=HZ, image=(2000, 1000)
    )
    assert found["causal"]["MOTA"] == pytest.approx(100.0 * 34 / 35)


@pytest.mark.parametrize("result", OPEN)
@pytest.mark.parametrize("said", [None, 0])
def test_a_frame_0_in_the_truth_alone_makes_the_result_count_from_0(tmp_path, result, said):
    found = evaluate(
        result(tmp_path / "res", TRUTH),
        mot(tmp_path / "gt.txt", RESULT),
        rate_hz=HZ,
        image=(2000, 1000),
        first_frame=said,
    )
    assert found["causal"]["FP"] == 0


@pytest.mark.parametrize("option", [[], ["--first-frame", "0"]])
@pytest.mark.parametrize("truth", [mot, csv])
def test_the_command_says_it_in_one_line_and_its_option_does_the_same(tmp_path, capsys, truth, option):
    paths = [str(csv(tmp_path / "res", RESULT)), "--gt", str(truth(tmp_path / "gt", TRUTH))]
    assert main(["eval", *paths, "--rate", "25", *option]) == 0
    told = capsys.readouterr()
    assert "97.14" in told.out
    lines = [line for line in told.err.splitlines() if "frames count" in line]
    assert len(lines) == (0 if option else 1)


def test_data_frames_are_decided_together_too(tmp_path):
    tables = [
        pd.DataFrame(rows, columns=["frame", "track_id", "left"]).assign(top=200, width=24, height=20)
        for rows in (RESULT, TRUTH)
    ]
    found = evaluate(*tables, rate_hz=HZ)
    assert found["causal"]["MOTA"] == pytest.approx(100.0 * 34 / 35)
    mixed = evaluate(tables[0], mot(tmp_path / "gt.txt", TRUTH), rate_hz=HZ)
    assert mixed["causal"]["MOTA"] == found["causal"]["MOTA"]


@pytest.mark.parametrize(
    ("files", "truth", "expected"),
    [
        # (lowest, highest) numbers of each file; which is the truth; first frames.
        ([(1, 50), (0, 49)], 1, [1, 0]),  # a result of 1 to N beside a truth of 0 to N - 1
        ([(1, 49), (0, 49)], 1, [0, 0]),  # a tracker reports nothing in its first frame
        ([(0, 49), (1, 50)], 1, [0, 1]),  # and the other way round
        ([(0, 40), (5, 50)], 1, [0, 0]),  # a result may end before its truth
        ([(3, 50), (1, 50)], 1, [1, 1]),
        ([(0, 50), (4, 50), (7, 33)], None, [0, 0, 0]),
        ([(0, 49), (1, 50)], None, [0, 1]),
    ],
)
def test_first_frames_of_several_files(files, truth, expected):
    counts = [FrameCount(0 if low == 0 else 1, low, high) for low, high in files]
    assert first_frames([*counts, None], truth) == [*expected, None]


@pytest.fixture
def run(tmp_path):
    """Detections of a vehicle from frame 5 on, tracked: their file has no frame 0."""
    path = mot(tmp_path / "det.txt", [(frame, -1, left) for frame, _, left in TRUTH])
    assert (
        main(["track", str(path), "--out", str(tmp_path / "run"), "--rate", "25", "--image", "1280x720"]) == 0
    )
    return tmp_path / "run"


def test_a_run_that_was_tracked_before_is_judged_on_the_clock_of_its_input(run, tmp_path):
    """Truth with an ignored object in frame 0: the same numbers, though the run's input counted from 1."""
    truth = tmp_path / "gt.txt"
    truth.write_text("0,7,1100,600,24,20,0\n" + text(TRUTH))
    alone = evaluate(run, mot(tmp_path / "same.txt", TRUTH), rate_hz=HZ)
    found = evaluate(run, truth, rate_hz=HZ)
    assert found["smoothed"]["MOTP"] == pytest.approx(alone["smoothed"]["MOTP"], abs=0.2)
    assert found["smoothed"]["MOTP"] > 90.0


def test_compare_decides_them_together(run, tmp_path, capsys):
    truth = tmp_path / "gt.txt"
    truth.write_text("0,7,1100,600,24,20,0\n" + text(TRUTH))
    assert main(["compare", str(run), "--gt", str(truth), "--no-plots", "--out", str(tmp_path / "c")]) == 0
    assert "frames count from 0, as those of the truth do" in capsys.readouterr().err
    errors = json.loads((tmp_path / "c" / "compare.json").read_text())["errors"]
    assert errors["full"]["position_rmse"] < 1.0  # a shift by a frame is 15 px
    values = compare(tmp_path / "det.txt", "default", truth, rate_hz=HZ, image=(1280, 720)).values
    assert values["errors"]["full"]["position_rmse"] < 1.0


def test_calibrate_decides_them_together(tmp_path):
    rows = [(k, 1, 40 + 3 * k) for k in range(1, 60)]
    detections = mot(tmp_path / "det.txt", [(0, -1, 40), *((k, -1, left) for k, _, left in rows)])
    truth, out = csv(tmp_path / "gt", rows), tmp_path / "c.yaml"
    options = ["--rate", "25", "--image", "1280x720", "--no-tune"]
    assert main(["calibrate", str(detections), "--gt", str(truth), "--out", str(out), *options]) == 0
    assert "latency_s" not in out.read_text() or abs(_latency(out)) < 0.5 / HZ


def _latency(path):
    import yaml

    sensors = yaml.safe_load(path.read_text())["sensors"]
    return float(np.max([abs(one.get("latency_s", 0.0)) for one in sensors.values()]))


def test_python_says_it_in_a_warning(tmp_path):
    from jeat_graph.data.errors import InputWarning

    with pytest.warns(InputWarning, match="frames count from 0, as those of the run do"):
        evaluate(csv(tmp_path / "res", RESULT), csv(tmp_path / "gt", TRUTH), rate_hz=HZ)
