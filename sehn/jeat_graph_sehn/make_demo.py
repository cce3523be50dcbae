"""Make the recording that `jeat-graph demo` tracks: `python -m jeat_graph_sehn.make_demo configs/demo`."""

from __future__ import annotations

import gzip
import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from jeat_graph.io.tables.detections_io import write_detections
from jeat_graph.io.tables.truth_io import write_truth
from jeat_graph.runs.demo_recording import DETECTIONS, PICTURE, TRUTH, DemoRecording
from jeat_graph_sehn.functions import record_demo

SCENARIO, DENSITY, DURATION_S, SEED = "night-nolight", "sparse", 8.0, 7
_DIGITS = 1  # of the markings (px), which are only drawn


def make_demo() -> DemoRecording:
    """Simulate the recording; it is the same each time."""
    return record_demo(SCENARIO, DENSITY, DURATION_S, SEED)


def write_demo(recording: DemoRecording, folder: Path) -> None:
    """Write a recording as `read_demo_recording` of jeat-graph reads it.

    Args:
        recording: what to write.
        folder: where to; made where it is missing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as name:
        plain = Path(name) / "plain.csv"
        write_detections(recording.detections, plain, declared=recording.declared)
        (folder / DETECTIONS).write_bytes(_packed(plain))
        write_truth(recording.truth, plain)
        (folder / TRUTH).write_bytes(_packed(plain))
    picture = {
        "scenario": recording.name,
        "width": recording.width,
        "height": recording.height,
        "lines": [line.round(_DIGITS).tolist() for line in recording.lines],
    }
    text = json.dumps(picture, separators=(",", ":")) + "\n"
    (folder / PICTURE).write_text(text, encoding="utf-8")


def _packed(path: Path) -> bytes:
    # Without the time, which would differ each time.
    return gzip.compress(path.read_bytes(), compresslevel=9, mtime=0)


if __name__ == "__main__":
    write_demo(make_demo(), Path(sys.argv[1]))
