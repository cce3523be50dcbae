"""Who decides who is who of a recording if nobody has said it: the recording, or a rule says why not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from jeat_graph import Detections, Scan, Tracker, load_config, track
from jeat_graph.cli.main import main
from jeat_graph.data.errors import InputWarning
from jeat_graph.runs import offline_identities
from jeat_graph.runs.offline_identities import with_identities

ROWS = [f"{k / 20:.2f},rgb,{100 + 3 * k},200,60,40,.9" for k in range(30)]


@pytest.fixture
def command(tmp_path: Path) -> list[str]:
    (tmp_path / "d.csv").write_text("\n".join(["t,sensor,left,top,width,height,score", *ROWS]) + "\n")
    return ["track", str(tmp_path / "d.csv"), "--image", "1280x720", "--out", str(tmp_path / "run")]


def recorded(command: list[str]) -> dict:
    return json.loads((Path(command[-1]) / "run.json").read_text())


@pytest.mark.parametrize(
    ("config", "changes", "used", "why"),
    [
        ("default", [], "whole", ""),
        ("highway", ["tracker.engine=reference"], "whole", ""),
        ("default", ["smoother.identities=causal"], "causal", ""),
        ("default", ["smoother.identities=lag", "smoother.road=fixed-lag"], "lag", ""),
        ("default", ["smoother.engine=none"], "auto", ""),  # there is no smoothed table
        ("default", ["smoother.road=fixed-lag"], "causal", "smoother.road=fixed-lag"),
        ("paper", [], "causal", "tracker.engine=paper"),
    ],
)
def test_the_whole_recording_decides_unless_a_setting_says_otherwise(config, changes, used, why):
    found, said = with_identities(load_config(config, changes), 100)
    assert found.smoother.identities == used
    assert bool(said) == bool(why)
    assert why in said


def test_a_recording_that_is_too_large_keeps_causal_identities_and_says_so(command, monkeypatch, capsys):
    monkeypatch.setattr(offline_identities, "MOST_DETECTIONS", 29)
    assert main(command) == 0
    err = capsys.readouterr().err
    assert "smoothed identities are causal: of more than 29 detections" in err
    assert "smoother.identities=whole decides all the same" in err
    smoother = recorded(command)["smoother"]
    assert smoother["identities"] == "causal"
    assert "more than 29 detections" in smoother["identities_why"]
    assert not (Path(command[-1]) / "links.csv").exists()
    with pytest.warns(InputWarning, match="identities are causal"):
        assert track(Path(command[1]), image=(1280, 720)).smoothed.causal_id is None


def test_run_json_says_what_was_asked_for_and_what_was_used(command):
    assert main(command) == 0
    record = recorded(command)
    assert record["config"]["smoother"]["identities"] == "auto"
    assert record["smoother"]["identities"] == "whole"
    assert "identities_why" not in record["smoother"]
    assert (Path(command[-1]) / "links.csv").exists()
    assert main([*command, "--config", "paper"]) == 0
    assert recorded(command)["smoother"]["identities_why"].startswith("tracker.engine=paper")


def test_a_tracker_alone_has_causal_identities():
    tracker = Tracker("default", image=(1280, 720))
    assert not tracker.keeps_recording
    scans = [
        Scan(k / 20, "rgb", np.array([[100.0 + 3 * k, 200, 60, 40]]), np.array([0.9])) for k in range(30)
    ]
    for scan in scans:
        tracker.step(scan)
    assert tracker.finish().causal_id is None
    decided = track(Detections.from_scans(scans), image=(1280, 720)).smoothed
    assert decided.causal_id.tolist() == decided.track_id.tolist() != []


def test_a_bar_shows_how_far_the_decision_is(command, capsys, monkeypatch):
    shown = []
    monkeypatch.setattr("jeat_graph.runs.run_steps.progress_to", _listening(shown))
    assert main(command) == 0
    assert shown == sorted(shown)
    assert shown[0] == 0.0
    assert shown[-1] == 1.0
    assert len(set(shown)) > 2 * len(ROWS)


def _listening(shown: list[float]):
    from jeat_graph.data.progress import progress_to

    return lambda _: progress_to(shown.append)
