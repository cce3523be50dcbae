"""`jeat-graph detect`, and `track` of raw recordings: one command from raw to tracks."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jeat_graph.cli.main import main
from jeat_graph.config.reading import load_config
from jeat_graph.detection.declared import known_of_networks
from jeat_graph.io.events.evt3_writer import Evt3Writer
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.io.tables.sensor_columns import as_settings

from ..detection.moving import SIZE, box_at, events_of, iou, picture_of

CAR = ((10, 60), (60, 8), (40, 20))
SECONDS = 3
STREET = Path(__file__).parents[3] / "shared" / "data" / "davis346" / "street.aedat4"


@pytest.fixture(scope="module")
def raw(tmp_path_factory):
    """A folder of pictures with its times, and a RAW file, of one thing that moves."""
    import cv2

    folder = tmp_path_factory.mktemp("raw")
    rng = np.random.default_rng(0)
    background = rng.uniform(40, 120, (SIZE[1], SIZE[0]))
    (folder / "frames").mkdir()
    times = np.arange(SECONDS * 20) * 50_000
    for k, t in enumerate(times):
        cv2.imwrite(
            str(folder / "frames" / f"{k:06d}.png"), picture_of([(CAR, 200)], t / 1e6, background, rng)
        )
    lines = "".join(f"{k},{t}\n" for k, t in enumerate(times))
    (folder / "frames.csv").write_text("index,t_us\n" + lines, encoding="utf-8")
    with Evt3Writer(folder / "events.raw", SIZE) as writer:
        writer.append(events_of([CAR], SECONDS, noise_hz_px=0.05))
    return folder


def test_tracks_of_events_do_not_depend_on_the_kind_of_file(raw, tmp_path):
    """A table of events gives the tracks of the RAW file that has the same events."""
    from jeat_graph.io.events.opening import open_events

    with open_events(raw / "events.raw") as reader:
        columns = [np.c_[p.t_us, p.x, p.y, p.polarity] for p in reader.pieces()]
    table = tmp_path / "events.txt"
    np.savetxt(table, np.concatenate(columns), fmt="%d", header=f"{SIZE[0]} {SIZE[1]}", comments="")
    for name, events in (("raw", raw / "events.raw"), ("table", table)):
        assert main(["track", "--events", str(events), "--out", str(tmp_path / name)]) == 0
    causal = [(tmp_path / name / "causal.csv").read_bytes() for name in ("raw", "table")]
    assert causal[0] == causal[1]


def test_events_without_a_size_have_that_of_the_frames_beside_them(raw, tmp_path, capsys):
    from jeat_graph.io.events.opening import open_events

    with open_events(raw / "events.raw") as reader:
        rows = np.concatenate([np.c_[p.t_us, p.x, p.y, p.polarity] for p in reader.pieces()])
    table = tmp_path / "events.npy"
    np.save(table, rows[rows[:, 1] < SIZE[0] - 5])  # they reach less far than the frames
    both = ["--frames", str(raw / "frames"), "--events", str(table), "--out", str(tmp_path / "run")]
    assert main(["track", *both]) == 0
    assert f"{SIZE[0]} x {SIZE[1]} px, those of the frames, were taken" in capsys.readouterr().err


def test_detect_writes_the_boxes_of_both_cameras(raw, tmp_path, capsys):
    out = tmp_path / "detections.csv"
    command = [
        "detect",
        "--frames",
        str(raw / "frames"),
        "--events",
        str(raw / "events.raw"),
        "--out",
        str(out),
    ]
    assert main(command) == 0
    assert f"wrote {out}" in capsys.readouterr().out
    found = read_detections(out)
    assert found.sensors == ("evt", "rgb")
    for scan in found.scans():
        if scan.t > 0.1:
            assert len(scan) == 1
            assert iou(scan.boxes[0], box_at(*CAR, scan.t)) > 0.7
    first = out.read_bytes()
    assert main(command) == 0
    assert out.read_bytes() == first


def test_track_goes_from_raw_to_tracks(raw, tmp_path):
    out = tmp_path / "run"
    files = ["--frames", str(raw / "frames"), "--events", str(raw / "events.raw")]
    assert main(["track", *files, "--out", str(out)]) == 0
    for name in ("causal.csv", "smoothed.csv"):
        table = pd.read_csv(out / name)
        assert table.track_id.nunique() == 1
        rows = table[table.t > 0.2]
        truth = np.array([box_at(*CAR, t) for t in rows.t])
        assert np.abs(rows.x - truth[:, 0] - truth[:, 2] / 2).mean() < 1.5
    assert len(read_detections(out / "detections.csv")) > 100


def test_one_camera_is_enough(raw, tmp_path):
    assert main(["track", "--events", str(raw / "events.raw"), "--out", str(tmp_path / "e")]) == 0
    assert main(["track", "--frames", str(raw / "frames"), "--out", str(tmp_path / "f")]) == 0
    for name in "ef":
        assert pd.read_csv(tmp_path / name / "causal.csv").track_id.nunique() == 1


def test_a_delay_moves_the_events(raw, tmp_path):
    times = []
    for delay in ("0", "0.2"):
        out = tmp_path / "d.csv"
        command = ["detect", "--events", str(raw / "events.raw"), "--event-delay", delay, "--out", str(out)]
        assert main(command) == 0
        times.append(read_detections(out).scan_t)
    np.testing.assert_allclose(times[1] - times[0], 0.2, atol=1e-9)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["detect", "--out", "d.csv"], "nothing to detect in: give --frames, --events or both"),
        (["track", "--out", "r"], "nothing to track: give files of detections, or --frames"),
        (
            ["track", "d.csv", "--events", "e.raw", "--out", "r"],
            "--events is detected in where no DETECTIONS",
        ),
        (["detect", "--events", "absent.raw", "--out", "d.csv"], "absent.raw: no such file"),
        (["detect", "--events", "e.raw", "--out", "d.txt"], "must end in .csv or .parquet"),
        (["detect", "--events", "e.raw", "--event-rate", "30", "--out", "d.csv"], "rate_hz: 30 gives"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not STREET.is_file(), reason=f"{STREET} is not there")
def test_a_real_street_from_one_file(tmp_path):
    pytest.importorskip("aedat", reason="pip install 'aedat>=2.2,<3'")
    assert main(["track", "--frames", str(STREET), "--events", str(STREET), "--out", str(tmp_path)]) == 0
    table = pd.read_csv(tmp_path / "smoothed.csv")
    # Three cars: near and white all the time, far and white all the time, dark from the shadow at 1.2 s.
    lives = table.groupby("track_id").t.agg(["min", "max"])
    long = lives[lives["max"] - lives["min"] > 1.0]
    assert len(long) == 3
    np.testing.assert_allclose(sorted(long["min"]), [0.0, 0.0, 1.2], rtol=0, atol=0.2)
    assert (long["max"] > 2.3).all()
    # The parked van does not move, so nobody sees it.
    assert not ((table.x - 170).abs() + (table.y - 171).abs() < 10).any()


def test_track_takes_a_networks_boxes_for_what_is_known_of_them(tmp_path, raw, monkeypatch, capsys):
    """Without --config; --set counts over it, and another configuration instead of it."""
    from jeat_graph.data.detections import Detections
    from jeat_graph.data.scan import Scan

    boxes, scores = np.array([[10.0, 60.0, 40.0, 20.0]]), np.array([0.9])
    found = Detections.from_scans(Scan(k / 20, "rgb", boxes + 0.5 * k, scores) for k in range(20))
    monkeypatch.setattr("jeat_graph.cli.detect_command.detect_with_bar", lambda *_: found)
    frames = ["track", "--frames", str(raw / "frames"), "--detector-frames", "sehn"]
    used = {}
    for name, more in {
        "plain": [],
        "set": ["--set", "sensors.rgb.even_score=0.7"],
        "paper": ["--config", "paper"],
    }.items():
        assert main([*frames, "--out", str(tmp_path / name), *more]) == 0
        used[name] = json.loads((tmp_path / name / "run.json").read_text())["config"]["sensors"]["rgb"]
        assert ("sehn-frames.tracking.yaml" in capsys.readouterr().err) == (name != "paper")
    known = load_config("default", as_settings(known_of_networks({"rgb": "sehn"}))).sensors["rgb"]
    again = tmp_path / "again"
    assert (
        main(["track", str(tmp_path / "plain" / "detections.csv"), "--image", "320x200", "--out", str(again)])
        == 0
    )
    for table in ("causal.csv", "smoothed.csv"):  # a table knows as much as who has just detected
        assert (again / table).read_bytes() == (tmp_path / "plain" / table).read_bytes()
    assert used["plain"]["even_score"] == known.even_score is not None
    assert used["set"]["even_score"] == 0.7
    assert used["set"]["rate_hz"] == used["plain"]["rate_hz"]
    assert used["paper"]["even_score"] is None
