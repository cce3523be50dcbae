"""Truth with metres in the columns of the picture's motion is said, and its motion is not judged."""

from __future__ import annotations

import json

import pytest

from jeat_graph import compare, evaluate
from jeat_graph.cli.main import main
from jeat_graph.data.errors import InputWarning

MOTION = "t,object_id,left,top,width,height,x,y,vx,vy,ax,ay\n"


@pytest.fixture
def files(tmp_path):
    """Detections of a vehicle at 300 px/s, its truth in px, and the same with metres for the motion."""
    lefts = [(k / 20, 100 + 15 * k) for k in range(40)]
    det = "t,sensor,left,top,width,height,score\n"
    (tmp_path / "det.csv").write_text(det + "".join(f"{t},rgb,{x},300,60,40,0.9\n" for t, x in lefts))
    px = "".join(f"{t},1,{x},300,60,40,{x + 30},320,300,0,0,0\n" for t, x in lefts)
    metres = "".join(f"{t},1,{x},300,60,40,{x / 50},6,6,0,0,0\n" for t, x in lefts)
    (tmp_path / "px.csv").write_text(MOTION + px)
    (tmp_path / "m.csv").write_text(MOTION + metres)
    return tmp_path


def test_compare_says_it_and_judges_positions_by_the_boxes(files, capsys):
    image = ["--image", "1280x720"]
    assert main(["track", str(files / "det.csv"), "--out", str(files / "run"), *image]) == 0
    found = {}
    for name in ("px", "m"):
        out = files / name
        assert (
            main(["compare", str(files / "run"), "--gt", f"{out}.csv", "--out", str(out), "--no-plots"]) == 0
        )
        found[name] = json.loads((out / "compare.json").read_text())["errors"]["full"]
        said = capsys.readouterr().err
        assert ("no px of the picture (metres?)" in said) == (name == "m")
    assert found["m"]["position_rmse"] == pytest.approx(found["px"]["position_rmse"], abs=1e-9)
    assert found["px"]["velocity_rmse"] > 0.0


def test_python_warns(files):
    tracks = files / "px.csv"
    with pytest.warns(InputWarning, match=r"m\.csv: x, y lie in 0 % of their boxes"):
        found = evaluate(tracks, files / "m.csv")
    assert "velocity_rmse" not in found["causal"]
    with pytest.warns(InputWarning, match="metres"):
        compare(files / "det.csv", "default", files / "m.csv", image=(1280, 720))
