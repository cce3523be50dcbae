"""The notebooks of the documentation run from beginning to end."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs" / "notebooks").glob("*.ipynb"))
LARGEST_BYTES = 60_000


def test_there_are_three():
    assert [path.stem for path in NOTEBOOKS] == [
        "calibrate-your-sensors",
        "filter-and-smoother",
        "first-steps",
    ]


def numbers(text: str) -> list[float]:
    """All numbers in a text, in their order."""
    return [float(found) for found in re.findall(r"-?\d+(?:\.\d+)?", text)]


#: The shortest is run each time, the others with the slow tests.
QUICK = "first-steps"


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=() if path.stem == QUICK else pytest.mark.slow) for path in NOTEBOOKS],
    ids=lambda path: path.stem,
)
def test_every_cell_runs_and_prints_what_is_kept(path, tmp_path, monkeypatch, capsys):
    """What is kept in the notebook is about what it prints now: the tracker may have become better."""
    pytest.importorskip("supervision")
    mpl = pytest.importorskip("matplotlib")
    mpl.use("Agg")
    monkeypatch.chdir(tmp_path)
    space: dict[str, object] = {"__name__": "notebook"}
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), path.name, "exec"), space)
            kept = ["".join(one["text"]) for one in cell["outputs"] if one["output_type"] == "stream"]
            assert numbers(capsys.readouterr().out) == pytest.approx(
                numbers("".join(kept)), rel=0.05, abs=0.1
            )


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_outputs_are_kept_and_small(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    assert any(cell.get("outputs") for cell in cells)
    assert not any(output["output_type"] == "error" for cell in cells for output in cell.get("outputs", []))
    assert path.stat().st_size < LARGEST_BYTES


def test_five_lines_lead_from_a_detector_to_tracks_on_the_picture():
    """Beside the line that is the user's own camera and detector."""
    cells = json.loads(NOTEBOOKS[2].read_text(encoding="utf-8"))["cells"]
    source = next(
        "".join(c["source"]) for c in cells if "from jeat_graph import Tracker" in "".join(c["source"])
    )
    lines = [line for line in source.splitlines() if line.strip() and "picture_and_detections" not in line]
    assert len(lines) == 5
    assert lines[-1].startswith("tracks.plot(picture=picture)")
