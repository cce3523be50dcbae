"""The command `eval`, from files to scores."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph.cli.main import main

from ..eval.data import DATA, need

TRUTH = "t,object_id,left,top,width,height,x,y,vx,vy,ax,ay,class\n"
TABLE = (
    "t,track_id,left,top,width,height,existence,x,y,vx,vy,ax,ay,"
    "var_x,var_y,var_vx,var_vy,var_ax,var_ay,sensors\n"
)
CONTRACT = ("MOTA", "MOTP", "HOTA", "DetA", "AssA", "IDF1", "FP", "FN", "IDSW")
MOTION = ("position_rmse", "velocity_rmse", "acceleration_rmse", "nees")


@pytest.fixture
def truth(tmp_path):
    rows = [f"{t:.2f},1,{100 * t:.3f},0,40,20,{100 * t + 20:.3f},10,100,0,0,0,Car" for t in times()]
    path = tmp_path / "gt.csv"
    path.write_text(TRUTH + "\n".join(rows) + "\n")
    return path


def times():
    return np.arange(40) * 0.05


def table_text(t, shift=0.0, track=1):
    rows = [
        f"{s:.2f},{track},{100 * s + shift:.3f},0,40,20,0.99,{100 * s + 20 + shift:.3f},10,100,0,0,0,"
        "1,1,4,4,9,9,rgb|evt"
        for s in t
    ]
    return TABLE + "\n".join(rows) + "\n"


@pytest.fixture
def run(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "causal.csv").write_text(table_text(np.arange(200) * 0.01, shift=2.0))
    (folder / "smoothed.csv").write_text(table_text(times()[::3]))
    return folder


def call(capsys, *arguments):
    code = main(["eval", *map(str, arguments)])
    out = capsys.readouterr()
    return code, out.out, out.err


def test_a_run_directory_gives_the_keys_of_the_contract(run, truth, capsys):
    code, out, err = call(capsys, run, "--gt", truth, "--json", "-")
    assert (code, err) == (0, "")
    result = json.loads(out)
    assert list(result) == ["causal", "smoothed"]
    for kind in result:
        assert set(CONTRACT + MOTION) <= set(result[kind])
    assert result["causal"]["MOTA"] == 100.0
    assert result["causal"]["position_rmse"] == pytest.approx(2.0)
    assert result["causal"]["nees"] == pytest.approx(4.0)
    # The last row of the smoothed table is at 1.95 s, so interpolation reaches every frame of the truth.
    assert (result["smoothed"]["FN"], result["smoothed"]["position_rmse"]) == (
        0,
        pytest.approx(0.0, abs=1e-9),
    )


def test_without_motion_in_the_truth_there_are_no_motion_errors(run, tmp_path, capsys):
    plain = tmp_path / "plain.csv"
    plain.write_text("t,object_id,left,top,width,height\n0,1,0,0,40,20\n0.05,1,5,0,40,20\n")
    result = json.loads(call(capsys, run, "--gt", plain, "--json", "-")[1])
    assert not set(MOTION) & set(result["causal"])


def test_the_table_is_printed_in_the_form_asked_for(run, truth, capsys):
    text = call(capsys, run, "--gt", truth)[1].splitlines()
    assert text[0].split()[:4] == ["table", "MOTA", "MOTP", "HOTA"]
    assert text[2].split()[:2] == ["causal", "100.00"]
    assert call(capsys, run, "--gt", truth, "--format", "markdown")[1].startswith("| table | MOTA |")
    assert call(capsys, run, "--gt", truth, "--format", "csv")[1].startswith("table,MOTA,MOTP,HOTA")
    assert "\\begin{tabular}" in call(capsys, run, "--gt", truth, "--format", "latex")[1]


def test_json_goes_to_a_file_beside_the_table(run, truth, tmp_path, capsys):
    target = tmp_path / "out" / "scores.json"
    code, out, _ = call(capsys, run, "--gt", truth, "--json", target)
    assert code == 0
    assert out.startswith("table")
    assert json.loads(target.read_text())["causal"]["FP"] == 0


def test_several_runs_are_pooled(run, truth, capsys):
    one = json.loads(call(capsys, run, "--gt", truth, "--json", "-")[1])
    two = json.loads(call(capsys, run, run, "--gt", truth, truth, "--json", "-")[1])
    assert two["causal"]["truth_boxes"] == 2 * one["causal"]["truth_boxes"]
    assert two["causal"]["sequences"] == 2


def test_rows_that_pool_different_runs_say_so(run, truth, capsys):
    message = call(capsys, run, run / "causal.csv", "--gt", truth, truth, "--json", "-")[2]
    assert "rows pool different RUNs" in message
    assert "causal 2, smoothed 1" in message
    assert "different" not in call(capsys, run, run, "--gt", truth, truth, "--json", "-")[2]


def test_classes_not_asked_for_are_ignored(run, truth, tmp_path, capsys):
    mixed = tmp_path / "mixed.csv"
    more = [f"{t:.2f},2,500,0,80,40,540,20,0,0,0,0,Truck" for t in times()]
    mixed.write_text(truth.read_text() + "\n".join(more) + "\n")
    assert json.loads(call(capsys, run, "--gt", mixed, "--json", "-")[1])["causal"]["FN"] == 40
    cars = json.loads(call(capsys, run, "--gt", mixed, "--json", "-", "--class", "Car")[1])
    assert (cars["causal"]["FN"], cars["causal"]["truth_boxes"]) == (0, 40)


def test_breakdown_and_detections_are_added_when_asked_for(run, truth, tmp_path, capsys):
    detections = tmp_path / "detections.csv"
    rows = [f"{t:.2f},rgb,{100 * t:.3f},0,40,20,0.9" for t in times()]
    detections.write_text("t,sensor,left,top,width,height,score\n" + "\n".join(rows) + "\n")
    arguments = (run, "--gt", truth, "--breakdown", "--detections", detections)
    out = call(capsys, *arguments)[1]
    assert "moving" in out
    assert "confirmation" in out
    result = json.loads(call(capsys, *arguments, "--json", "-")[1])
    assert result["detections"]["rgb"]["AP"] == 100.0


def test_detections_that_name_no_sensor_are_named_as_for_track(run, truth, tmp_path, capsys):
    detections = tmp_path / "detections.csv"
    head, *rows = truth.read_text().splitlines()
    detections.write_text("\n".join([head, *rows]) + "\n")  # no sensor
    assert main(["eval", str(run), "--gt", str(truth), "--detections", str(detections), "--json", "-"]) == 2
    assert "NAME=path" in capsys.readouterr().err
    named = ["--detections", f"cam={detections}"]
    assert main(["eval", str(run), "--gt", str(truth), *named, "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["detections"]["cam"]["AP"] == 100.0


def test_truth_and_detections_may_be_in_another_unit_of_time(run, truth, tmp_path, capsys):
    detections = tmp_path / "detections.csv"
    rows = [f"{t:.2f},rgb,{100 * t:.3f},0,40,20,0.9" for t in times()]
    detections.write_text("t,sensor,left,top,width,height,score\n" + "\n".join(rows) + "\n")
    arguments = (run, "--gt", truth, "--detections", detections, "--json", "-")
    seconds = call(capsys, *arguments)[1]
    for path in (truth, detections):
        head, *lines = path.read_text().splitlines()
        fields = [line.split(",") for line in lines]
        scaled = [",".join([f"{round(1000 * float(first))}", *rest]) for first, *rest in fields]
        path.write_text("\n".join([head, *scaled]) + "\n")
    assert call(capsys, *arguments, "--time-unit", "ms") == (0, seconds, "")
    assert call(capsys, *arguments)[0] == 2


def test_a_motchallenge_result_has_its_known_scores(capsys):
    folder = need(DATA / "tud" / "TUD-Campus")
    out = call(capsys, folder / "test.txt", "--gt", folder / "gt.txt", "--json", "-")[1]
    scores = json.loads(out)["causal"]
    assert scores["MOTA"] == pytest.approx(52.6462, abs=1e-4)
    assert (scores["FP"], scores["FN"], scores["IDSW"]) == (13, 150, 7)


def test_the_same_input_gives_the_same_bytes(run, truth, capsys):
    assert len({call(capsys, run, "--gt", truth, "--json", "-")[1] for _ in range(2)}) == 1


@pytest.mark.parametrize(
    ("break_it", "sentence"),
    [
        (lambda run, truth: (run / "nothing", truth), "no such run directory or table"),
        (lambda run, truth: (run.parent, truth), "neither causal.csv nor smoothed.csv"),
        (lambda run, truth: (run, run.parent / "gone.csv"), "gone.csv"),
        (lambda run, truth: (in_milliseconds(run), truth), "different units of time"),
        (lambda run, truth: (much_later(run), truth), "no common timestamps"),
        (lambda run, truth: (run, with_columns(truth, relative)), "different units: the boxes of the truth"),
        (lambda run, truth: (with_columns(run / "causal.csv", relative), truth), "the boxes of the tracks"),
        (lambda run, truth: (run, with_columns(truth, numbered)), "the truth has no identities"),
        (lambda run, truth: (run, with_columns(truth, nameless)), "column 'object_id' is missing"),
        (
            lambda run, truth: (run / "causal.csv", with_columns(truth, early_and_late)),
            "no track is there at",
        ),
    ],
)
def test_wrong_pairs_end_with_code_2_and_one_line(break_it, sentence, run, truth, capsys):
    a, b = break_it(run, truth)
    code, out, err = call(capsys, a, "--gt", b)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert sentence in err


def with_columns(path, change):
    header, *lines = path.read_text().splitlines()
    rows = [
        change(k, dict(zip(header.split(","), line.split(","), strict=True))) for k, line in enumerate(lines)
    ]
    path.write_text(
        "\n".join([",".join(rows[0]), *(",".join(map(str, row.values())) for row in rows)]) + "\n"
    )
    return path


def relative(_, row):
    return row | {name: float(row[name]) / 1280 for name in ("left", "top", "width", "height")}


def numbered(k, row):
    return row | {"object_id": k}


def nameless(_, row):
    return {name: value for name, value in row.items() if name != "object_id"}


def early_and_late(_, row):
    """Frames before the tracks' first row and long after their last one."""
    return row | {"t": float(row["t"]) + (-1.0 if float(row["t"]) < 1.0 else 5.0)}


def test_a_run_that_found_nothing_at_the_truths_frames_is_judged_if_it_says_that_it_looked(
    run, truth, capsys
):
    frames = [row.split(",")[0] for row in with_columns(truth, early_and_late).read_text().splitlines()[1:]]
    (run / "scans.csv").write_text("t,sensor,detections\n" + "".join(f"{t},rgb,0\n" for t in frames))
    (run / "smoothed.csv").unlink()
    code, out, _ = call(capsys, run, "--gt", truth, "--json", "-")
    assert (code, json.loads(out)["causal"]["FN"]) == (0, 40)


def in_milliseconds(run):
    path = run / "causal.csv"
    lines = path.read_text().splitlines()
    rows = [f"{1000 * float(line.split(',')[0]):.0f}," + line.split(",", 1)[1] for line in lines[1:]]
    path.write_text("\n".join([lines[0], *rows]) + "\n")
    return run


def much_later(run):
    (run / "causal.csv").write_text(table_text(np.arange(200) * 0.01 + 500))
    return run


def test_the_number_of_truths_must_be_one_or_that_of_the_runs(run, truth, capsys):
    code, _, err = call(capsys, run, run, run, "--gt", truth, truth)
    assert code == 2
    assert "3 RUN and 2 --gt given; give one truth for each run, or one for all of them" in err


@pytest.fixture
def bytetrack(tmp_path):
    """Another tracker's result at every second frame of the truth, with a new identity half-way."""
    lines = [f"{k + 1},{1 + (k >= 20)},{5 * k},0,40,20,0.9,-1,-1,-1" for k in range(0, 40, 2)]
    path = tmp_path / "bytetrack.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_trackers_on_one_recording_have_a_row_each_with_the_scores_that_they_have_alone(
    run, bytetrack, truth, capsys
):
    code, out, err = call(capsys, run, bytetrack, "--gt", truth, "--json", "-")
    assert (code, err) == (0, "")
    scores = json.loads(out)["runs"]
    assert list(scores) == ["run", "bytetrack.txt"]
    for path in (run, bytetrack):
        assert scores[path.name] == json.loads(call(capsys, path, "--gt", truth, "--json", "-")[1])
    theirs = scores["bytetrack.txt"]["causal"]
    assert (theirs["FN"], theirs["FP"], theirs["IDSW"]) == (20, 0, 1)

    table = call(capsys, run, bytetrack, "--gt", truth, "--format", "csv")[1].splitlines()
    assert table[0].startswith("run,table,MOTA,")
    assert [row.split(",")[:2] for row in table[1:]] == [
        ["run", "causal"],
        ["run", "smoothed"],
        ["bytetrack.txt", "causal"],
    ]


def test_runs_of_one_name_in_two_folders_are_called_by_their_paths(bytetrack, truth, tmp_path, capsys):
    (tmp_path / "other").mkdir()
    other = tmp_path / "other" / bytetrack.name
    other.write_text(bytetrack.read_text())
    scores = json.loads(call(capsys, bytetrack, other, "--gt", truth, "--json", "-")[1])["runs"]
    assert list(scores) == [str(bytetrack), str(other)]
    code, _, err = call(capsys, other, other, "--gt", truth)
    assert (code, err.strip().splitlines()) == (2, [f"jeat-graph eval: {other}: this RUN is given twice"])


def test_each_tracker_on_one_recording_has_its_own_breakdown(run, bytetrack, truth, capsys):
    code, out, _ = call(capsys, run, bytetrack, "--gt", truth, "--breakdown")
    assert code == 0
    assert "run: Waiting times" in out
    assert "bytetrack.txt: Waiting times" in out
    both = json.loads(call(capsys, run, bytetrack, "--gt", truth, "--breakdown", "--json", "-")[1])["runs"]
    alone = json.loads(call(capsys, bytetrack, "--gt", truth, "--breakdown", "--json", "-")[1])
    assert both["bytetrack.txt"]["breakdown"] == alone["breakdown"]


def test_detections_and_roads_go_with_the_truth_and_not_with_its_runs(run, bytetrack, truth, capsys):
    for option in ("--detections", "--road"):
        code, _, err = call(capsys, run, bytetrack, "--gt", truth, option, truth, truth)
        assert code == 2
        assert f"1 --gt and 2 {option} given" in err
