"""A damaged file of any format is data or one line, and nothing in it is executed."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys

import h5py
import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError, JeatGraphError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph.io.streams.scan_lines import read_batches
from jeat_graph.io.tables.detections_io import read_detections, write_detections
from jeat_graph.io.tables.trajectories_io import read_trajectories, write_trajectories
from jeat_graph.io.tables.truth_io import read_truth, write_truth
from jeat_graph.live.manifest import read_manifest
from jeat_graph.tracking.tracker import Tracker

FULL = bool(os.environ.get("JEAT_GRAPH_FULL"))
MUTATIONS = 5_000 if FULL else 100
SEED = 7


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """Change a few bytes, cut out, double or cut off a stretch."""
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        at = int(rng.integers(len(out))) if out else 0
        stretch = int(rng.integers(1, 64))
        kind = rng.integers(5)
        if kind == 0 and out:
            out[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            out[at : at + stretch] = rng.bytes(stretch)
        elif kind == 2:
            del out[at : at + stretch]
        elif kind == 3:
            out[at:at] = out[at : at + stretch]
        else:
            del out[at:]
    return bytes(out)


def recording() -> Detections:
    t = np.repeat(np.arange(8) * 0.05, 2)
    boxes = np.column_stack([t * 10, t, np.full(16, 30.0), np.full(16, 20.0)])
    return Detections.from_rows(t, ["rgb"] * 16, boxes, np.full(16, 0.5), classes=["car"] * 16)


def csv(path):
    write_detections(recording(), path)


def npy(path):
    kinds = [
        ("t", "i8"),
        *((n, "f4") for n in ("x", "y", "w", "h")),
        ("class_id", "u1"),
        ("class_confidence", "f4"),
    ]
    np.save(path, np.array([(k * 50_000, 1, 2, 3, 4, 0, 0.5) for k in range(16)], dtype=kinds))


def coco(path):
    entry = '{"image_id": %d, "bbox": [1, 2, 3, 4], "score": 0.5, "category_id": 1}'
    path.write_text("[" + ",".join(entry % k for k in range(8)) + "]", encoding="utf-8")


def mot(path):
    path.write_text("".join(f"{k},-1,1,2,3,4,0.5,-1,-1,-1\n" for k in range(1, 16)), encoding="utf-8")


def kitti(path):
    line = "%d 1 Car 0 0 -1.5 1 2 30 40 -1 -1 -1 -1000 -1000 -1000 -10 0.5\n"
    path.write_text("".join(line % k for k in range(15)), encoding="utf-8")


def mot_of_eleven(path):
    lines = (f"{k},{k % 3},{10 * k},2,30,40,0.5,-1,-1,-1,2\n" for k in range(1, 16))
    path.write_text("".join(lines), encoding="utf-8")


def visdrone(path):
    lines = (f"{k},0,{10 * k},2,30,40,0.5,{4 + k % 3},{k % 2},{k % 3}\n" for k in range(1, 16))
    path.write_text("".join(lines), encoding="utf-8")


def darklabel(path):
    lines = (f"{k},2,1,{10 * k},2,{10 * k + 30},42,car,2,200,20,230,50,van\n" for k in range(15))
    path.write_text("".join(lines), encoding="utf-8")


def sink(path):
    box = '"x_min": %g, "y_min": 2, "x_max": %g, "y_max": 42, "class_id": 2, "confidence": 0.5'
    more = '"tracker_id": 1, "class_name": "car", "frame_index": %d, "video_fps": 20.0'
    rows = (("{" + box + ", " + more + "}") % (10 * k, 10 * k + 30, k) for k in range(15))
    path.write_text("[" + ",".join(rows) + "]", encoding="utf-8")


WRITERS = {"d.csv": csv, "d.parquet": csv, "d.npy": npy, "d.json": coco, "det.txt": mot, "k.txt": kitti}
WRITERS |= {"eleven.txt": mot_of_eleven, "v.txt": visdrone, "dark.txt": darklabel, "sink.json": sink}


@pytest.mark.parametrize("name", WRITERS)
def test_a_damaged_file_of_boxes_is_read_or_refused_in_one_line(tmp_path, name):
    rng = np.random.default_rng(SEED)
    path = tmp_path / name
    WRITERS[name](path)
    good = path.read_bytes()
    assert len(read_detections(path, rate_hz=20.0)) > 0
    said: list[str] = []
    for _ in range(MUTATIONS):
        path.write_bytes(mutated(good, rng))
        try:
            found = read_detections(path, rate_hz=20.0)
        except DataError as error:
            said.append(str(error))
        else:
            assert np.isfinite(found.boxes).all()
    assert said
    assert not any("\n" in text for text in said)


def truth(path):
    rows = [f"{0.1 * k:.1f},{k % 3},{10 * k},20,30,40,car,{k % 2}\n" for k in range(12)]
    path.write_text("t,object_id,left,top,width,height,class,ignore\n" + "".join(rows), encoding="utf-8")


def trajectories(path):
    found = Tracker("default").run(recording())
    write_trajectories(Trajectories.concatenate(list(found)), path)


def settings(path):
    path.write_text(
        "base: default\nimage: {width: 640, height: 480}\npaper:\n  jerk_px: 20\n", encoding="utf-8"
    )


def manifest(path):
    path.write_text("name,detections,config,rate\na,a.csv,default,25\nb,b.csv;c.csv,,\n", encoding="utf-8")


def checkpoint(path):
    tracker = Tracker("default")
    list(tracker.run(recording()))
    tracker.save(path)


def scan_lines(path):
    line = '{"t": %g, "sensor": "rgb", "boxes": [[1, 2, 30, 40]], "scores": [0.5]}\n'
    path.write_text("".join(line % (0.1 * k) for k in range(12)), encoding="utf-8")


def read_scan_lines(path):
    with path.open("rb") as file:
        return list(read_batches(file, str(path), joint=True, ordered=False))


OTHERS = {
    "gt.csv": (truth, read_truth),
    "gt.parquet": (lambda path: write_truth(read_truth(made(path, "t.csv", truth)), path), read_truth),
    "causal.csv": (trajectories, read_trajectories),
    "c.yaml": (settings, load_config),
    "m.csv": (manifest, read_manifest),
    "state.npz": (checkpoint, Tracker.load),
    "s.jsonl": (scan_lines, read_scan_lines),
}


def made(path, name, writer):
    """Another file beside it, written."""
    other = path.with_name(name)
    writer(other)
    return other


@pytest.mark.parametrize("name", OTHERS)
def test_any_other_damaged_file_is_read_or_refused_in_one_line(tmp_path, name):
    rng = np.random.default_rng(SEED)
    path = tmp_path / name
    writer, reader = OTHERS[name]
    writer(path)
    good = path.read_bytes()
    reader(path)
    said: list[str] = []
    for _ in range(MUTATIONS):
        path.write_bytes(mutated(good, rng))
        try:
            reader(path)
        except JeatGraphError as error:
            said.append(str(error))
    assert said
    assert not any("\n" in text for text in said)


@pytest.mark.skipif(not FULL, reason="a file of a gigabyte; make fuzz reads it")
@pytest.mark.parametrize("name", ["d.csv", "d.json", "det.txt"])
def test_a_line_of_a_gigabyte_is_one_line_in_bounded_memory(tmp_path, name):
    path, mib = tmp_path / name, 2**20
    with path.open("wb") as file:
        file.write(b"t,sensor,left,top,width,height,score\n" if name == "d.csv" else b"")
        for _ in range(1024):
            file.write(b"1" * mib)
    script = (
        "import resource, sys; from jeat_graph.io.tables.detections_io import read_detections\n"
        "try: read_detections(sys.argv[1], rate_hz=10.0)\n"
        "except Exception as error: print(type(error).__name__, len(str(error)))\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, path], capture_output=True, text=True, timeout=600, check=True
    )
    error, size, resident_mib = done.stdout.split()
    assert error == "DataError"
    assert int(size) < 1000
    assert int(resident_mib) < 6 * 1024


@pytest.mark.skipif(not FULL, reason="a gigabyte through a pipe; make fuzz sends it")
def test_stream_passes_over_a_line_of_a_gigabyte_in_bounded_memory():
    script = (
        "import resource, sys; from jeat_graph.cli.main import main\n"
        "code = main(['stream', '--on-error', 'skip'])\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024, file=sys.stderr); sys.exit(code)"
    )
    line = b'{"t": %d, "sensor": "rgb", "boxes": [[1, 2, 30, 40]], "scores": [0.5]}\n'
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    with subprocess.Popen([sys.executable, "-c", script], **pipes) as process:
        process.stdin.write(line % 1)
        for _ in range(1024):
            process.stdin.write(b"1" * 2**20)
        process.stdin.write(b"\n" + line % 2)
        out, err = process.communicate(timeout=600)
    assert process.returncode == 0
    assert len(out.splitlines()) == 2
    assert b"<stdin>:2: is a line of more than" in err
    assert int(err.split()[-1]) < 700


def test_a_damaged_event_file_is_read_or_refused_in_one_line(tmp_path):
    rng = np.random.default_rng(SEED)
    path = tmp_path / "e.h5"
    with h5py.File(path, "w", libver="earliest") as file:
        for column, kind in (("x", "u2"), ("y", "u2"), ("p", "u1"), ("t", "u4")):
            file.create_dataset(
                f"events/{column}", data=np.arange(500).astype(kind), chunks=(100,), compression=4
            )
        file["ms_to_idx"] = np.array([0, 500], dtype=np.uint64)
        file["t_offset"] = np.int64(0)
    good = path.read_bytes()
    said: list[str] = []
    for _ in range(MUTATIONS):
        path.write_bytes(mutated(good, rng))
        try:
            with EventFile(path) as events:
                events.rows(0, min(len(events), 1000))
        except DataError as error:
            said.append(str(error))
    assert said
    assert not any("\n" in text for text in said)


def test_a_pickle_in_an_array_is_not_executed(tmp_path):
    class Touch:
        def __reduce__(self):
            return (os.mkdir, (str(tmp_path / "executed"),))

    (tmp_path / "d.npy").write_bytes(pickle.dumps(Touch()))
    np.save(tmp_path / "o.npy", np.array([Touch()], dtype=object), allow_pickle=True)
    for name in ("d.npy", "o.npy"):
        with pytest.raises(DataError):
            read_detections(tmp_path / name)
    assert not (tmp_path / "executed").exists()
