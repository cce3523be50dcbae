"""What `deploy/` draws and alerts of is what a service measures; promtool takes the rules."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from jeat_graph.corridor.corridor_file import read_learnt_gaps
from jeat_graph.corridor.live_corridor import LiveCorridor
from jeat_graph.live.service.corridor_metrics import CorridorMetrics
from jeat_graph.live.service.status import Status

DEPLOY = Path(__file__).parents[2] / "deploy"
RULES, DASHBOARD = DEPLOY / "prometheus" / "jeat-graph.rules.yml", DEPLOY / "grafana" / "jeat-graph.json"


class Camera:
    starts = 1

    def __init__(self):
        self.status = Status("A", 10.0)
        self.status.lag_s, self.status.saved = 0.1, 0.0


class Measured:
    """A service of two cameras that has seen nothing yet."""

    def __init__(self, folder):
        from live_tests.corridor_scene import learnt

        (folder / "corridor.yaml").write_text(yaml.safe_dump(learnt()))
        self.cameras = {"A": Camera(), "B": Camera()}
        self._live = LiveCorridor(read_learnt_gaps(folder / "corridor.yaml"), 300.0)

    def health(self):
        return {"ready": True, "checkpoint_age_s": 1.0, "corridor": self._live.shown()}


@pytest.fixture
def measured(tmp_path):
    """Names of all metrics, as they are asked for."""
    pytest.importorskip("prometheus_client", reason="the extra `serve` is not installed")
    found = set()
    for one in CorridorMetrics(Measured(tmp_path)).collect():
        found.add(f"{one.name}_total" if one.type == "counter" else one.name)
    return found


def expressions():
    groups = yaml.safe_load(RULES.read_text())["groups"]
    rules = [rule["expr"] for group in groups for rule in group["rules"]]
    board = json.loads(DASHBOARD.read_text())
    panels = [target["expr"] for panel in board["panels"] for target in panel["targets"]]
    asked = [one["query"]["query"] for one in board["templating"]["list"] if isinstance(one["query"], dict)]
    return rules + panels + asked


def test_every_metric_that_is_named_is_measured(measured):
    named = {name for text in expressions() for name in re.findall(r"\bjeat_graph_\w+", text)}
    assert len(named) > 20
    assert named - measured == set()


def test_panels_do_not_lie_on_each_other():
    places = [one["gridPos"] for one in json.loads(DASHBOARD.read_text())["panels"]]
    cells = [
        (x, y) for p in places for x in range(p["x"], p["x"] + p["w"]) for y in range(p["y"], p["y"] + p["h"])
    ]
    assert len(cells) == len(set(cells))
    assert max(x for x, _ in cells) < 24


def test_promtool_takes_the_rules():
    if shutil.which("promtool") is None:
        pytest.skip("promtool (Debian: prometheus) is not installed")
    done = subprocess.run(["promtool", "check", "rules", str(RULES)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
