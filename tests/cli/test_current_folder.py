"""No command, and no process that it starts, runs what lies in the current folder."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from jeat_graph.cli.main import COMMANDS

# Named like what Python, the package and its libraries import; each says that it was run, and fails.
PACKAGES = ("cv2", "gtsam", "h5py", "matplotlib", "numpy", "pandas", "pyarrow", "scipy")
TRAP = "with open({mark!r}, 'a') as file:\n    file.write(__name__ + '\\n')\nraise SystemExit(77)\n"
# Each command in turn, all in one process: what is loaded once is loaded from elsewhere already.
RUN = """
import json, sys
from jeat_graph.cli.main import main
for line in sys.stdin.read().splitlines():
    try:
        code = main(json.loads(line))
    except SystemExit as end:
        code = end.code
    print(json.dumps([json.loads(line)[0], code]), flush=True)
"""
MANIFEST = "name,detections\na,{det}\nb,{det}\n"
NO_PICTURES = ["detect", "train", "render", "frame", "draw", "view", "camera", "calibrate", "register"]
#: `demo` simulates, tracks, judges and draws, as others do here; `serve` runs until it is ended.
SERVED_ELSEWHERE = {"demo", "serve"}


@pytest.fixture
def trap(tmp_path) -> tuple[Path, Path]:
    """A folder with modules that leave a mark, and the file of the marks."""
    folder, mark = tmp_path / "data", tmp_path / "marks"
    folder.mkdir()
    for name in sorted({*sys.stdlib_module_names, *PACKAGES}):
        (folder / f"{name}.py").write_text(TRAP.format(mark=str(mark)))
    return folder, mark


def environment() -> dict[str, str]:
    """This process's, without what would say where to look for modules, but for the package itself."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}


def test_every_command_from_a_folder_of_strange_modules(trap):
    folder, mark = trap
    detections = "sim/detections.csv"
    (folder / "many.csv").write_text(MANIFEST.format(det=detections))
    (folder / "det.jsonl").write_text('{"t": 0.0, "sensor": "rgb", "boxes": [], "scores": []}\n')
    truth = ["--gt", "sim/gt.csv"]
    pictures = ["--sensors", "rgb", "--segments", "2", "--frames", "2", "--size", "64x48", "--video", "png"]
    commands = [
        ["simulate", "night", "--out", "sim", "--duration", "0.6"],
        ["simulate", "night", "--out", "clips", *pictures, "--workers", "2"],
        ["track", detections, "--out", "run"],
        ["batch", "many.csv", "--out", "many", "--workers", "2", "--smoother", "none"],
        ["eval", "run", *truth],
        ["count", "run", "--line", "0,300,2000,300"],
        ["export", "run", "--to", "cvat", "--out", "run.zip", "--output-rate", "20"],
        ["report", "run", "--out", "run.html"],
        ["compare", "run", *truth, "--detections", detections],
        ["events", "info", "run/run.json"],
        ["explain", "run", "--detections", detections, "--track", "1"],
        ["stream", "--help"],
        ["road", "run", "--camera", "none.yaml", "--out", "road"],
        ["detectors", "--no-speed"],
        *([name, "--help"] for name in (*NO_PICTURES, "handover", "recount", "conflicts", "teach")),
    ]
    assert {command[0] for command in commands} | SERVED_ELSEWHERE == set(COMMANDS)
    done = subprocess.run(
        [sys.executable, "-P", "-c", RUN],
        cwd=folder,
        input="\n".join(map(json.dumps, commands)),
        capture_output=True,
        text=True,
        env=environment(),
        timeout=300,
        check=False,
    )
    assert not mark.exists(), mark.read_text()
    said = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('["')]
    expected = [0] * len(commands)
    expected[9] = expected[12] = 2  # no events, no camera
    assert said == [[command[0], code] for command, code in zip(commands, expected, strict=True)], done.stderr


def test_python_m_does_not_look_there_either(trap, recording):
    folder, mark = trap
    # What Python itself loads before the package can say anything is out of its reach.
    for path in folder.iterdir():
        if path.stem not in ("numpy", "pandas", "pyarrow", "scipy", "csv", "decimal", "queue"):
            path.unlink()
    run = ["track", str(recording / "detections.csv"), "--out", "run", "--smoother", "none"]
    done = subprocess.run(
        [sys.executable, "-m", "jeat_graph", *run],
        cwd=folder,
        capture_output=True,
        text=True,
        env=environment(),
        timeout=300,
        check=False,
    )
    assert (done.returncode, mark.exists()) == (0, False), done.stderr


@pytest.mark.slow
def test_workers_on_ray_do_not_look_there(trap, recording):
    """Ray gives the folder that it is started in to its workers, as a place to look for modules."""
    pytest.importorskip("ray", reason="Ray is not installed")
    folder, mark = trap
    (folder / "many.csv").write_text(MANIFEST.format(det=recording / "detections.csv"))
    on_ray = ["--engine", "ray", "--workers", "1", "--smoother", "none"]
    command = ["batch", "many.csv", "--out", "many", *on_ray]
    done = subprocess.run(
        [sys.executable, "-P", "-c", RUN],
        cwd=folder,
        input=json.dumps(command),
        capture_output=True,
        text=True,
        env=environment(),
        timeout=300,
        check=False,
    )
    assert not mark.exists(), mark.read_text()
    assert '["batch", 0]' in done.stdout, done.stderr
    assert (folder / "many" / "runs" / "b" / "causal.csv").is_file()
