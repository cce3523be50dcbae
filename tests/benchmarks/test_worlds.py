"""`benchmarks worlds`: its table, what it refuses, and that seen worlds have other traffic."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.worlds import tables
from jeat_graph_sehn.simulation.imaging.config import load_imaging
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.scenario import load_scenario


def row(kind: str, world: str, seed: int, seen: float, unseen: float) -> dict[str, object]:
    return {"kind": kind, "world": world, "seed": seed, "seen": seen, "unseen": unseen, "minutes": 2.0}


def test_the_table_shows_the_fall_of_each_net_as_a_mean_over_seeds() -> None:
    rows = [row("frames", "varied", 1, 60.0, 56.0), row("frames", "varied", 2, 64.0, 62.0)]
    rows.append(row("events", "fixed", 1, 70.0, 30.0))
    text = tables({"rows": rows, "settings": {"scenarios": ["day"]}})["worlds"].render("markdown")
    assert "| pictures | varied worlds | 62.0 | 59.0 | -3.0 | 2.0 |" in text
    assert "| events | the fixed world | 70.0 | 30.0 | -40.0 | 2.0 |" in text


def test_other_traffic_is_in_the_same_world() -> None:
    imaging = load_imaging({"render": {"width": 64, "height": 48}})
    made = [RenderedSource(load_scenario("day"), imaging, 3, 4, "varied", "rgb", traffic=k) for k in (0, 1)]
    assert made[0].calibration_of(2) == made[1].calibration_of(2)
    scenes = [one.scene(2) for one in made]
    assert scenes[0].around == scenes[1].around
    assert scenes[0].road.config == scenes[1].road.config
    first, second = (scene.states_at(np.array([0.1]), far_m=230.0).pose for scene in scenes)
    assert first.shape != second.shape or not np.allclose(first, second)
    assert "traffic" not in made[0].settings()
    assert made[1].settings()["traffic"] == 1


def test_a_size_that_nets_do_not_take_is_refused(capsys) -> None:
    pytest.importorskip("torch")
    assert main(["worlds", "--size", "100x64"]) == 2
    assert "multiples of 16" in capsys.readouterr().err


def test_it_runs(full, tmp_path) -> None:
    if not full:
        pytest.skip("trains four nets, a minute: JEAT_GRAPH_FULL=1")
    pytest.importorskip("torch")
    out = tmp_path / "out"
    assert main(["worlds", "--quick", "--jobs", "1", "--out", str(out)]) == 0
    result = json.loads((out / "worlds.json").read_text())
    assert {(r["kind"], r["world"]) for r in result["rows"]} == {
        (kind, world) for kind in ("frames", "events") for world in ("varied", "fixed")
    }
