"""Time compared with time: a peer's, that of a simpler way to the same, or of the same at another size."""

import csv
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks.speed_scene import make_frames
from benchmarks.speed_subjects import installed_peers
from benchmarks.speed_timing import summarise, time_side_by_side
from jeat_graph import Tracker, load_config
from jeat_graph.data.events import EventArray
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.metrics import evaluate
from jeat_graph.io.events.evt3_writer import Evt3Writer
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.io.tables.trajectories_io import read_trajectories, write_trajectories
from tests.performance.jobs import OneVehicle


def frames(num, objects=50):
    """True boxes and tracks of `num` frames."""
    rng = np.random.default_rng(0)
    t, ids = np.repeat(np.arange(num) * 0.05, objects), np.tile(np.arange(objects), num)
    boxes = np.column_stack((rng.uniform(0, 1200, (len(t), 2)), rng.uniform(30, 60, (len(t), 2))))
    found = boxes + rng.normal(0, 3, boxes.shape)
    rest = {
        "existence": np.ones(len(t)),
        "mean": np.zeros((len(t), 6)),
        "var": np.ones((len(t), 6)),
        "used": np.ones(len(t), dtype=np.int64),
        "sensors": ("rgb",),
    }
    truth = GroundTruth(t=t, object_id=ids, boxes=boxes, motion=None, ignore=np.zeros(len(t), dtype=bool))
    return truth, Trajectories(t=t, track_id=ids, boxes=found, **rest)


def test_our_step_takes_less_than_a_quarter_of_bytetracks():
    """Undisturbed it is a seventh, by processor; with others at work cold caches cost us more."""
    if not installed_peers():
        pytest.skip("the package trackers is not installed")
    names, faster = ["default", "bytetrack"], []
    while len(faster) < 8 and max(faster, default=0.0) < 4.0:
        run = time_side_by_side(names, 50, frames=30, warm_up=20, seed=len(faster), clock="cpu")
        faster.append(summarise([run])[0]["times_faster"])
    assert max(faster) >= 4.0


def test_a_step_grows_hardly_faster_than_linearly_to_500_tracks():
    """In the same picture a track has five times as many neighbours too: six measured, 25 if square."""
    least = {100: np.inf, 500: np.inf}
    for _ in range(8):
        for num, seconds in least.items():
            timed = time_side_by_side(["default"], num, frames=30, warm_up=20, seed=0, clock="cpu")
            least[num] = min(seconds, np.quantile(timed["default"][0], 0.25))
        if least[500] <= 7.5 * least[100]:
            return
    pytest.fail(f"{least[500]:.6f} s at 500 tracks, {least[100]:.6f} s at 100")


def test_a_window_costs_no_more_after_a_minute(least):
    young, old = [OneVehicle() for _ in range(9)], OneVehicle()
    for one in young:
        one.drive()
    for _ in range(13):
        old.drive()
    early, late = least(
        lambda: young.pop().drive(), old.drive, until=lambda early, late: late < 1.5 * early, most=8
    )
    assert late < 1.5 * early
    assert old.tracker.smoother_counts["fallbacks"] == 0


def test_deciding_with_the_whole_recording_takes_less_than_six_times_as_long_as_smoothing(least):
    """4 to 5 measured: four passes of the model, of which two are smoothed, and the decision itself."""
    frames = make_frames(30, 200, 20.0, seed=0)
    # Nobody is seen for two seconds, so that there is something to be joined.
    scans = [(one.t, "rgb", one.boxes, one.scores) for k, one in enumerate(frames) if not 90 <= k < 130]

    def run(identities):
        tracker = Tracker(load_config("default", [f"smoother.identities={identities}"]), image=(3840, 2160))
        for scan in scans:
            tracker.step(scan)
        assert len(tracker.finish()) > 0

    causal, whole = least(
        lambda: run("causal"), lambda: run("whole"), until=lambda causal, whole: whole < 6.0 * causal
    )
    assert whole < 6.0 * causal


def test_judging_takes_no_longer_per_frame_where_there_are_more(least):
    short, long = frames(100), frames(400)
    one, four = least(
        lambda: evaluate([short]), lambda: evaluate([long]), until=lambda one, four: four < 6.0 * one, turns=3
    )
    assert four < 6.0 * one


def test_a_table_is_read_faster_than_by_pythons_own_reader_and_conversion(tmp_path, least):
    path, n = tmp_path / "long.csv", 100_000
    path.write_text("a,b,name\n" + "0.1,2.25,rgb\n" * n, encoding="utf-8")

    def ours():
        table = read_table(path, ("a", "b", "name"))
        return table.number("a"), table.number("b"), table.text("name")

    def plain():
        with path.open(newline="") as file:
            rows = list(csv.reader(file))[1:]
        return [float(row[0]) for row in rows], [float(row[1]) for row in rows], [row[2] for row in rows]

    fast, slow = least(ours, plain, until=lambda fast, slow: fast < slow)
    assert fast < slow


def write_plainly(table: Trajectories, path: Path) -> None:
    """As many numbers, by Python's own writer."""
    columns = np.column_stack([table.t, table.track_id, table.boxes, table.existence, table.mean, table.var])
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([f"{value:.6f}" for value in row] for row in columns.tolist())


def test_trajectories_are_written_faster_than_by_pythons_own_writer(tmp_path, least):
    _, table = frames(400)
    ours, plain = least(
        lambda: write_trajectories(table, tmp_path / "ours.csv"),
        lambda: write_plainly(table, tmp_path / "plain.csv"),
        until=lambda ours, plain: ours < plain,
    )
    assert ours < plain
    assert len(read_trajectories(tmp_path / "ours.csv")) == len(table)


def write_boxes(folder: Path, n: int) -> tuple[Path, Path]:
    """The same boxes as CSV and as results of COCO."""
    rng = np.random.default_rng(0)
    boxes = rng.uniform(1, 1000, (n, 4)).round(2).tolist()
    lines = [f"{0.05 * (k // 5)},rgb,{l},{t},{w},{h},0.5\n" for k, (l, t, w, h) in enumerate(boxes)]  # noqa: E741
    (folder / "d.csv").write_text("t,sensor,left,top,width,height,score\n" + "".join(lines), encoding="utf-8")
    entries = [
        {"image_id": k // 5, "category_id": 1, "bbox": box, "score": 0.5} for k, box in enumerate(boxes)
    ]
    (folder / "d.json").write_text(json.dumps(entries), encoding="utf-8")
    return folder / "d.csv", folder / "d.json"


def test_boxes_are_read_about_as_fast_as_pandas_reads_their_columns(tmp_path, least):
    path, _ = write_boxes(tmp_path, 50_000)
    table, plain = least(
        lambda: read_detections(path),
        lambda: pd.read_csv(path),
        until=lambda table, plain: table < 2.2 * plain,
    )
    assert table < 2.2 * plain  # 1.25 measured; three times where all columns are text first


def test_boxes_of_coco_are_read_faster_than_by_pythons_own_reader_and_conversion(tmp_path, least):
    _, results = write_boxes(tmp_path, 50_000)

    def plain():
        entries = json.loads(results.read_bytes())
        image, category, score = (
            np.array([entry[key] for entry in entries]) for key in ("image_id", "category_id", "score")
        )
        return image, category, score, np.array([entry["bbox"] for entry in entries])

    # .3 to .7 measured, by how warm Python's memory is; 3 where entries are checked one by one.
    coco, tree = least(
        lambda: read_detections(results, rate_hz=20.0), plain, until=lambda coco, tree: coco < tree
    )
    assert coco < tree


@pytest.mark.parametrize(("columns", "times"), [(1, 1.4), (12, 2.0)])
def test_events_of_evt3_are_read_faster_than_by_the_package_evt3(tmp_path, least, columns, times):
    """Events anywhere, and groups of neighbours, for which one word stands."""
    evt3 = pytest.importorskip("evt3", reason="pip install evt3")
    n, rng = 1_000_000, np.random.default_rng(0)
    groups = n // columns
    t = np.sort(rng.integers(0, n, groups))
    x, y = rng.integers(0, 1280 - columns, groups), rng.integers(0, 720, groups)
    x = (x[:, None] + np.arange(columns)).reshape(-1).astype(np.uint16)
    t, y, p = (np.repeat(column, columns) for column in (t, y, rng.integers(0, 2, groups)))
    with Evt3Writer(tmp_path / "e.raw", (1280, 720)) as writer:
        writer.append(EventArray(t, x, y.astype(np.uint16), p.astype(np.uint8)))

    def ours():
        with open_events(tmp_path / "e.raw") as reader:
            assert sum(len(piece) for piece in reader.pieces()) == len(t)

    def theirs():
        assert len(evt3.decode_file(str(tmp_path / "e.raw"))) == len(t)

    fast, slow = least(ours, theirs, until=lambda fast, slow: times * fast < slow)
    assert times * fast < slow


@pytest.mark.slow
def test_a_vehicle_that_stays_for_minutes_costs_no_more_at_its_end(measure):
    found = measure("long_track")
    assert found["born"] == 1
    assert found["fallbacks"] == 0
    memory = found["memory"]
    assert memory[-1] - memory[len(memory) // 4] < 0.5  # over 13,000 steps
    # A vehicle of 3 to 4 minutes against one of half a minute to one.
    assert found["late"] < 1.5 * found["early"]
