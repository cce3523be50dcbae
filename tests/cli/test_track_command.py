"""`track`: from files of detections to a run directory."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.config.reading import config_from_dict, load_config
from jeat_graph.eval.resampling import predict_to
from jeat_graph.io.files.hashing import sha256_of
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.io.tables.trajectories_io import read_trajectories
from jeat_graph.tracking.whole import track

STEADY = [f"{k * 0.05:.2f},rgb,{100 + 2 * k},200,40,30,0.95" for k in range(30)]
#: What a user writes who knows the sensors and the picture: nothing is found out from the recording.
DECLARED = (
    "sensors={rgb: {rate_hz: 20}, evt: {rate_hz: 100}}",
    "input={undeclared: refuse, clocks: as_given, picture: given}",
)
KNOWN = tuple(word for setting in DECLARED for word in ("--set", setting))


def run_json(folder):
    return json.loads((folder / "run.json").read_text())


@pytest.fixture(scope="module")
def run(recording, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "deep" / "er"
    formats = [*KNOWN, "--format", "parquet", "motchallenge", "kitti"]
    assert main(["track", str(recording / "detections.csv"), "--out", str(folder), *formats]) == 0
    return folder


def test_the_causal_table_is_what_the_tracker_reports_in_memory(run, recording):
    written = read_trajectories(run / "causal.csv")
    expected = track(load_config("default", DECLARED), read_detections(recording / "detections.csv"))
    np.testing.assert_array_equal(written.t, expected.t)
    np.testing.assert_array_equal(written.track_id, expected.track_id)
    np.testing.assert_allclose(written.boxes, expected.boxes, atol=5.1e-4)
    assert written.sensor_text() == expected.sensor_text()
    assert len(written) > 100


def test_scans_csv_lists_every_scan_with_its_count(run, recording):
    detections = read_detections(recording / "detections.csv")
    lines = (run / "scans.csv").read_text().splitlines()
    assert lines[0] == "t,sensor,detections"
    assert len(lines) == 1 + detections.num_scans
    t, sensor, count = lines[7].split(",")
    scan = detections.scan(6)
    assert (float(t), sensor, int(count)) == (scan.t, scan.sensor, len(scan))


def test_run_json_says_what_the_run_was_made_from(run, recording):
    record = run_json(run)
    assert record["inputs"][0]["sha256"] == sha256_of(recording / "detections.csv")
    assert config_from_dict(record["config"]) == load_config("default", DECLARED)
    table = read_trajectories(run / "causal.csv")
    assert record["counts"]["causal_rows"] == len(table)
    assert record["counts"]["tracks_reported"] == len(np.unique(table.track_id))
    assert record["files"]["causal.csv"]["sha256"] == sha256_of(run / "causal.csv")


def test_repetition_gives_the_same_bytes_in_every_table(run, recording, tmp_path):
    formats = [*KNOWN, "--format", "parquet", "motchallenge", "kitti"]
    main(["track", str(recording / "detections.csv"), "--out", str(tmp_path / "again"), *formats])
    first, second = run_json(run), run_json(tmp_path / "again")
    assert first["files"] == second["files"]
    for record in (first, second):
        del record["timings"]
    assert first == second


def test_order_of_rows_and_split_into_files_do_not_matter(run, recording, tmp_path):
    lines = (recording / "detections.csv").read_text().splitlines()
    for name in ("rgb", "evt"):
        chosen = [line for line in lines[:0:-1] if line.split(",")[1] == name]
        # Rows of one scan keep their order within the file: only the scans are shuffled.
        chosen.sort(key=lambda line: float(line.split(",")[0]), reverse=True)
        scans: dict[str, list[str]] = {}
        for line in chosen[::-1]:
            scans.setdefault(line.split(",")[0], []).append(line)
        body = [line for t in reversed(scans) for line in scans[t]]
        (tmp_path / f"{name}.csv").write_text("\n".join([lines[0], *body]) + "\n")
    out = tmp_path / "out"
    assert (
        main(["track", str(tmp_path / "evt.csv"), str(tmp_path / "rgb.csv"), "--out", str(out), *KNOWN]) == 0
    )
    assert (out / "causal.csv").read_bytes() == (run / "causal.csv").read_bytes()


def test_parquet_holds_the_same_table_as_csv(run):
    a, b = read_trajectories(run / "causal.csv"), read_trajectories(run / "causal.parquet")
    np.testing.assert_array_equal(a.boxes, b.boxes)
    np.testing.assert_array_equal(a.mean, b.mean)


@pytest.mark.parametrize("name", ["causal.mot.txt", "causal.kitti.txt"])
def test_results_by_frame_hold_the_tracks_predicted_to_the_frames(run, recording, name):
    result = read_trajectories(run / name, rate_hz=20.0)
    causal = read_trajectories(run / "causal.csv")
    instants = np.unique(read_detections(recording / "detections.csv").scan_t)
    frames = np.unique(result.t)
    expected = predict_to(causal, frames, instants=instants)
    np.testing.assert_array_equal(result.track_id, expected.track_id)
    np.testing.assert_allclose(result.boxes, expected.boxes, atol=2e-3)
    np.testing.assert_allclose(frames * 20, np.round(frames * 20), atol=1e-9)


def test_a_vehicle_seen_steadily_is_one_track(write, tmp_path):
    assert main(["track", write(*STEADY), "--out", str(tmp_path / "run")]) == 0
    table = read_trajectories(tmp_path / "run" / "causal.csv")
    assert set(table.track_id) == {1}
    assert table.t[-1] == pytest.approx(1.45)

    never = ["--set", "output.min_existence=1"]
    assert main(["track", write(*STEADY), "--out", str(tmp_path / "run"), *never]) == 0
    assert len(read_trajectories(tmp_path / "run" / "causal.csv")) == 0


def test_a_least_existence_that_leaves_out_most_rows_is_said_with_their_number(write, tmp_path, capsys):
    assert main(["track", write(*STEADY), "--out", str(tmp_path / "all")]) == 0
    existence = read_trajectories(tmp_path / "all" / "causal.csv").existence
    assert "min_existence" not in capsys.readouterr().err
    levels = np.unique(existence)
    for name, level in (("few", 0), ("most", len(levels) - 2)):
        least = (levels[level] + levels[level + 1]) / 2.0
        below = int((existence < least).sum())
        setting = ["--set", f"output.min_existence={least:.9f}"]
        assert main(["track", write(*STEADY), "--out", str(tmp_path / name), *setting]) == 0
        line = f"leaves out {below} of {len(existence)} rows that would be reported"
        assert (line in capsys.readouterr().err) == (below > len(existence) / 2) == (name == "most")
        assert any(line in one for one in run_json(tmp_path / name)["warnings"]) == (name == "most")
        assert len(read_trajectories(tmp_path / name / "causal.csv")) == len(existence) - below


def test_settings_reach_the_tracker(write, tmp_path):
    known = ["--set", "sensors.rgb.even_score=0.99", "--set", "smoother.lag_s=0.5"]
    tables = []
    for name, settings in (("plain", []), ("set", known)):
        assert main(["track", write(*STEADY), "--out", str(tmp_path / name), *settings]) == 0
        tables.append(read_trajectories(tmp_path / name / "causal.csv"))
    assert run_json(tmp_path / "set")["config"]["smoother"]["lag_s"] == 0.5
    assert len(tables[0]) == 30
    assert len(tables[1]) == 0, "boxes whose scores are below are more likely false than real"


def test_empty_scans_make_a_run_with_empty_tables_and_a_warning(write, tmp_path, capsys):
    assert main(["track", write("0,rgb,,,,,", "0.05,rgb,,,,,"), "--out", str(tmp_path / "run")]) == 0
    assert "nothing to track" in capsys.readouterr().err
    assert len(read_trajectories(tmp_path / "run" / "causal.csv")) == 0
    assert "nothing to track" in run_json(tmp_path / "run")["warnings"][0]


def test_a_file_without_rows_is_refused(write, tmp_path, fails):
    assert "det.csv" in fails("track", write(), "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_undeclared_sensors_are_refused_together_with_the_way_to_declare_them(write, tmp_path, fails):
    lines = [line.replace("rgb", name) for line in STEADY for name in ("radar", "sonar")]
    message = fails("track", write(*lines), "--out", tmp_path / "run", *KNOWN)
    assert "sensors 'radar', 'sonar' are not declared (declared: evt, rgb)" in message
    settings = [part.split("'")[0] for part in message.split("--set '")[1:]]
    assert settings == ["sensors.radar={rate_hz: 20}", "sensors.sonar={rate_hz: 20}"]
    declared = [word for setting in settings for word in ("--set", setting)]
    assert main(["track", write(*lines), "--out", str(tmp_path / "run"), *KNOWN, *declared]) == 0


def test_the_default_declares_sensors_by_what_is_seen_of_them_and_says_so(write, tmp_path, capsys):
    lines = [line.replace("rgb", "radar") for line in STEADY]
    assert main(["track", write(*lines), "--out", str(tmp_path / "run")]) == 0
    assert "'radar' is not declared: taken for a detector; it scans at 20 Hz" in capsys.readouterr().err
    config = run_json(tmp_path / "run")["config"]
    assert config["sensors"].keys() == {"radar"}
    assert config["sensors"]["radar"]["rate_hz"] == pytest.approx(20.0)


def test_the_default_takes_the_picture_to_reach_as_far_as_the_boxes(write, tmp_path, capsys):
    lines = [f"{k * 0.05:.2f},rgb,{1500 + k},800,40,30,0.9" for k in range(20)]
    assert main(["track", write(*lines), "--out", str(tmp_path / "run")]) == 0
    image = run_json(tmp_path / "run")["config"]["image"]
    assert (image["width"], image["height"]) == (1559.0, 830.0)
    assert len(read_trajectories(tmp_path / "run" / "causal.csv")) > 0


def test_boxes_without_area_are_counted(write, tmp_path, capsys):
    assert main(["track", write(*STEADY, "0.0,rgb,5,5,0,9,0.9"), "--out", str(tmp_path / "run")]) == 0
    assert "1 box(es) without area left out" in capsys.readouterr().err


def test_boxes_of_another_picture_are_warned_of_with_their_extent(write, tmp_path, capsys):
    lines = [f"{k * 0.05:.2f},rgb,{1500 + k},800,40,30,0.9" for k in range(20)]
    assert main(["track", write(*lines), "--out", str(tmp_path / "run"), *KNOWN]) == 0
    message = capsys.readouterr().err
    assert "20 of 20 box centres lie outside the picture of 1280 x 720 px, up to 259 px beyond" in message
    assert "1520, 815 to 1539, 815" in message
    assert "--image WIDTHxHEIGHT" in message
    assert run_json(tmp_path / "run")["counts"]["tracks_reported"] == 1


def test_a_few_boxes_outside_the_picture_are_a_warning(write, tmp_path, capsys):
    lines = [*STEADY, "1.45,rgb,2000,100,10,10,0.5"]
    assert main(["track", write(*lines), "--out", str(tmp_path / "run"), *KNOWN]) == 0
    assert "1 of 31 box centres" in capsys.readouterr().err
    assert "1 of 31 box centres" in run_json(tmp_path / "run")["warnings"][0]


def test_a_clock_unlike_the_declared_one_is_a_warning(write, tmp_path, capsys):
    lines = [f"{k * 0.2:.2f},rgb,100,200,40,30,0.9" for k in range(10)]
    assert main(["track", write(*lines), "--out", str(tmp_path / "run"), *KNOWN]) == 0
    assert "'rgb' scans at 5 Hz, but is declared with 20 Hz" in capsys.readouterr().err


def test_a_wrong_line_is_named_and_nothing_is_written(write, tmp_path, fails):
    message = fails("track", write(*STEADY, "2.0,rgb,1,2,-3,4,0.5"), "--out", tmp_path / "run")
    assert "det.csv:32:" in message
    assert not (tmp_path / "run").exists()


def test_an_error_leaves_an_earlier_run_as_it_was(write, tmp_path, fails):
    out = tmp_path / "run"
    main(["track", write(*STEADY), "--out", str(out)])
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    # Frames before frame 0 cannot be written: the error comes at the very end of the run.
    early = [f"{k * 0.05 - 5:.2f},{line.split(',', 1)[1]}" for k, line in enumerate(STEADY)]
    fails("track", write(*early, name="early.csv"), "--out", out, "--format", "kitti", *KNOWN)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_a_new_run_replaces_all_files_of_the_old_one_and_no_others(write, tmp_path):
    out, file = tmp_path / "run", write(*STEADY)
    main(["track", file, "--out", str(out), "--format", "parquet"])
    (out / "notes.txt").write_text("mine")
    main(["track", file, "--out", str(out)])
    assert sorted(path.name for path in out.iterdir() if path.name != "smoothed.csv") == [
        "causal.csv",
        "links.csv",
        "notes.txt",
        "run.json",
        "scans.csv",
    ]


def test_an_input_is_never_replaced(write, tmp_path, fails):
    file = write(*STEADY, name="causal.csv")
    assert "would be replaced" in fails("track", file, "--out", tmp_path)
    assert len(read_detections(file)) == 30


def test_out_must_not_be_a_file(write, fails):
    file = write(*STEADY)
    assert "is a file" in fails("track", file, "--out", file)


def test_an_unknown_preset_is_refused_with_the_nearest_name(write, tmp_path, fails):
    message = fails("track", write(*STEADY), "--out", tmp_path / "run", "--config", "defautl")
    assert "did you mean default?" in message


def test_eval_knows_from_scans_csv_that_there_was_no_track(write, tmp_path, capsys):
    # Tracks end at 0.5 s; the scans go on, empty. Without scans.csv the last rows would be predicted on.
    det = write(*STEADY[:11], *(f"{k * 0.01:.2f},rgb,,,,," for k in range(51, 120)))
    truth = tmp_path / "gt.csv"
    # Between the rows' times: a table on the truth's own clock is taken for a result frame by frame.
    rows = [f"{k * 0.05 + 0.003:.3f},1,{100 + 2 * k},200,40,30" for k in range(24)]
    truth.write_text("t,object_id,left,top,width,height\n" + "\n".join(rows) + "\n")
    main(["track", det, "--out", str(tmp_path / "run")])
    capsys.readouterr()

    def misses():
        assert main(["eval", str(tmp_path / "run"), "--gt", str(truth), "--json", "-"]) == 0
        return json.loads(capsys.readouterr().out)["causal"]["FN"]

    with_scans = misses()
    (tmp_path / "run" / "scans.csv").unlink()
    assert with_scans == misses() + 3


def test_a_known_latency_is_taken_off_the_times_of_a_sensor(tmp_path, write):
    """As if the file had the times of the measurements."""
    times = [0.05 * k for k in range(40)]
    rows = {late: [] for late in (0.0, 0.08)}
    for late, lines in rows.items():
        for t in times:
            lines.append(f"{t + late},rgb,{100 + 40 * t},200,40,30,0.95")
            lines.append(f"{t + 0.02},evt,{100 + 40 * t},200,40,30,0.95")
    true, stamped = (write(*lines, name=f"d{late}.csv") for late, lines in rows.items())
    assert main(["track", true, "--out", str(tmp_path / "a")]) == 0
    late = ["--set", "sensors.rgb.latency_s=0.08"]
    assert main(["track", stamped, "--out", str(tmp_path / "b"), *late]) == 0
    one, other = (read_trajectories(tmp_path / name / "causal.csv") for name in "ab")
    np.testing.assert_allclose(other.t, one.t, atol=1e-12)
    np.testing.assert_array_equal(other.track_id, one.track_id)
    np.testing.assert_allclose(other.boxes, one.boxes, atol=2e-3)
