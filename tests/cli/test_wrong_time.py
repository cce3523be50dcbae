"""One wrong time in a file: what would make a row, picture or interval per step says so in one line."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.io.tables.trajectories_io import read_trajectories

HEADER = "t,sensor,left,top,width,height,score\n"


def detections(folder, wrong: float):
    path = folder / "det.csv"
    times = [[wrong if (k, x) == (39, 0) else k / 20 for k in range(40)] for x in range(2)]
    rows = [f"{times[x][k]},rgb,{100 + 4 * k + 300 * x},200,40,30,.9\n" for k in range(40) for x in range(2)]
    path.write_text(HEADER + "".join(rows))
    return path


@pytest.fixture(scope="module", params=[1e9, 1e18], ids=["1e9", "1e18"])
def run(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("wrong")
    path = detections(folder, request.param)
    assert main(["track", str(path), "--out", str(folder / "run"), "--image", "1280x720"]) == 0
    return folder


@pytest.mark.parametrize(
    "command",
    [
        ("render", "RUN", "--out", "OUT.mp4"),
        ("count", "RUN", "--line", "0,100,1000,300", "--interval", "1"),
        ("export", "RUN", "--to", "coco", "--output-rate", "20", "--out", "OUT.json"),
    ],
    ids=lambda command: command[0],
)
def test_what_goes_through_a_run_in_steps_says_how_long_it_lasts(run, fails, command):
    names = [word.replace("RUN", str(run / "run")).replace("OUT", str(run / "out")) for word in command]
    assert " h, and at " in fails(*names)


def test_formats_that_count_frames_say_how_long_the_run_lasts(run, capsys):
    known = ["--image", "1280x720", "--set", "sensors.rgb.rate_hz=20"]
    options = [*known, "--format", "motchallenge", "--rate", "20"]
    assert main(["track", str(run / "det.csv"), "--out", str(run / "mot"), *options]) == 2
    warning, error = capsys.readouterr().err.splitlines()
    assert "is a time of sensor 'rgb' wrong" in warning
    assert "20 Hz" in error


@pytest.mark.parametrize("engine", ["full", "gtsam-full"])
def test_engines_over_whole_tracks_have_a_row_at_each_scan_and_none_between(tmp_path, engine):
    """However long nothing comes: a track ends there, and is not carried on to the wrong time."""
    path = detections(tmp_path, 1e18)
    options = ["--image", "1280x720", "--smoother", engine]
    assert main(["track", str(path), "--out", str(tmp_path / "run"), *options]) == 0
    table = read_trajectories(tmp_path / "run" / "smoothed.csv")
    assert len(table) <= 80
    lasting = [np.ptp(table.t[table.track_id == one]) for one in np.unique(table.track_id)]
    assert max(lasting) < 2.0


def test_a_rate_that_no_film_has_is_refused(tmp_path, capsys):
    for name in ("--output-rate", "--frames-per-second"):
        with pytest.raises(SystemExit) as end:
            main(["export", str(tmp_path), "--to", "coco", "--out", "x.json", name, "1e9"])
        assert end.value.code == 2
        assert "must be at most 1000 Hz" in capsys.readouterr().err
