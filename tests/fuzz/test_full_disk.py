"""Every command that writes, on a disk that is full: one line, exit code 2, and nothing half written."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

FULL = bool(os.environ.get("JEAT_GRAPH_FULL"))
#: Sizes of the disk: the larger one is enough for a part of what is written.
SIZES_KIB = (4, 40, 400) if FULL else (4,)
#: What may be there after an end: rows that were final, and whole files of a set that goes on where it was.
GROWS = {"smoothed.csv"}
COMMANDS = {
    "track": ("track", "{sim}/detections.csv", "--out", "{disk}/run"),
    "simulate": ("simulate", "night", "--duration", "3", "--out", "{disk}/sim"),
    "report": ("report", "{run}", "--gt", "{sim}/gt.csv", "--out", "{disk}/page.html"),
    "render": ("render", "{run}", "--out", "{disk}/film.mp4"),
    "compare": ("compare", "{run}", "--gt", "{sim}/gt.csv", "--out", "{disk}/compared"),
    "stream": ("stream", "--smoothed", "{disk}/smoothed.csv"),
    "benchmarks": ("benchmarks", "events", "--out", "{disk}/events"),
}
QUICK = ("track", "render", "stream")


@pytest.fixture(scope="module")
def work(tmp_path_factory, call) -> dict[str, Path]:
    """Detections with their truth, and the run of them; a few rows, or a simulated recording."""
    folder = tmp_path_factory.mktemp("work")
    sim, run = folder / "sim", folder / "run"
    if FULL:
        assert call("simulate", "night", "--duration", "3", "--out", sim).returncode == 0
    else:
        sim.mkdir()
        rows = "".join(f"{k * 0.05:.2f},rgb,{100 + 2 * k},200,40,30,0.95\n" for k in range(60))
        (sim / "detections.csv").write_text("t,sensor,left,top,width,height,score\n" + rows)
    assert call("track", sim / "detections.csv", "--out", run).returncode == 0
    return {"sim": sim, "run": run}


@pytest.fixture
def small_disk(tmp_path):
    """A function that makes a disk of so many KiB, if this process may."""
    made: list[Path] = []

    def make(size_kib: int) -> Path:
        place = tmp_path / f"disk-{size_kib}"
        place.mkdir()
        mount = shutil.which("mount")
        if mount is None or os.name == "nt" or os.geteuid() != 0:
            pytest.skip("only root can make a small disk")
        options = ("-t", "tmpfs", "-o", f"size={size_kib}k", "tmpfs")
        if subprocess.run([mount, *options, place], capture_output=True, check=False).returncode:
            pytest.skip("this container may not mount anything")
        made.append(place)
        return place

    yield make
    for place in made:
        subprocess.run(["umount", "-l", place], check=True)


@pytest.mark.parametrize("name", COMMANDS if FULL else QUICK)
@pytest.mark.parametrize("size_kib", SIZES_KIB)
def test_a_full_disk_is_one_line_and_nothing_unfinished_is_there(work, small_disk, call, name, size_kib):
    disk = small_disk(size_kib)
    arguments = [text.format(disk=disk, **work) for text in COMMANDS[name]]
    rows = (work["sim"] / "detections.csv").read_bytes()
    done = call(*arguments, given=rows)
    said = done.stderr.splitlines()
    assert not any("Traceback" in line for line in said)
    there = {path for path in disk.rglob("*") if path.is_file()}
    if FULL and done.returncode == 0:
        return  # it had room enough
    assert done.returncode == 2
    assert "disk" in said[-1]
    assert not [path for path in there if path.name.startswith(".")]
    assert all(path.stat().st_size for path in there)
    # Progress and warnings may stand before it, but the video library's own complaints may not.
    assert len(said) <= 4
    if name not in ("simulate", "compare", "benchmarks"):
        assert {path.name for path in there} <= GROWS
