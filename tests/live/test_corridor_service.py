"""Several cameras in one process: vehicles that pass all of them, and one that fails and is back."""

from __future__ import annotations

import io
import json
import threading
import time

import numpy as np
import pytest
import yaml
from live_tests import corridor_scene as scene

from jeat_graph.cli.main import main
from jeat_graph.corridor import live_appearance
from jeat_graph.live.service import corridor_run, ends
from jeat_graph.live.service.corridor_config import read_corridor_service
from jeat_graph.live.service.corridor_metrics import CorridorMetrics
from jeat_graph.live.service.corridor_run import CorridorService
from jeat_graph.live.service.log import Log

PATIENCE_S = 60.0


def wait_for(true, what):
    end = time.monotonic() + PATIENCE_S
    while not (found := true()):
        assert time.monotonic() < end, what
        time.sleep(0.01)
    return found


@pytest.fixture
def broker(monkeypatch):
    found = scene.Broker()
    monkeypatch.setattr(ends, "open_source", found.open_source)
    monkeypatch.setattr(ends, "open_sink", found.open_sink)
    monkeypatch.setattr(corridor_run, "_DECIDE_S", 0.05)
    return found


class Running:
    """A service in a thread, as a signal would end it."""

    def __init__(self, path):
        config, _ = read_corridor_service(path)
        self.said = io.StringIO()
        self.service = CorridorService(config, Log("road", self.said))
        self.code = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        self.code = self.service.run()

    def end(self):
        self.service.interrupts.seen = 15
        self._thread.join(PATIENCE_S)
        return self.code

    def problem(self, words):
        return any(words in text for text in self.service.health()["problems"])


def play(broker, until_s):
    """Let time go on, as fast as the cameras follow."""
    while broker.clock_s < until_s:
        broker.clock_s += 1.0
        wait_for(lambda: all(come_to(broker, name) for name in scene.NAMES), "the cameras follow")


def come_to(broker, name):
    """Whether a camera has answered all that its broker has given so far."""
    due = sum(t <= broker.clock_s for t, _ in broker.waiting[f"{name}/scans"])
    return len(broker.answered.get(f"{name}/tracks", ())) >= due


def test_vehicles_are_followed_whatever_happens_to_one_camera(broker, tmp_path, monkeypatch):
    monkeypatch.setattr(live_appearance, "_LEAST", 5)
    pytest.importorskip("nats", reason="the client is not installed")
    vehicles = scene.traffic(12, 2.0, 4)
    end_s = float(vehicles["t"].max()) + 8.0
    for k, name in enumerate(scene.NAMES):
        broker.waiting[f"{name}/scans"] = scene.messages(vehicles, k, end_s)
    path = scene.written(tmp_path)
    running = Running(path)
    play(broker, 0.45 * end_s)

    broker.broken.add("B/scans")
    wait_for(lambda: running.problem("camera B: its connection is gone"), "the camera that failed is told of")
    assert not running.problem("camera A")
    assert not running.problem("camera C")
    broker.clock_s += 1.0
    for name in "AC":
        wait_for(lambda: come_to(broker, name), "the others go on")  # noqa: B023
    wait_for(lambda: running.service.health()["cameras"]["B"]["starts"] == 2, "it begins again")
    play(broker, 0.7 * end_s)
    assert running.end() == 0

    running = Running(path)
    play(broker, end_s)
    wait_for(
        lambda: sum(running.service.corridor()["cameras"][name]["passages"] for name in scene.NAMES) == 36,
        "all have passed all cameras",
    )
    shown = running.service.health()
    families = {
        (row.name, *row.labels.values()): row.value
        for one in CorridorMetrics(running.service).collect()
        for row in one.samples
    }
    assert running.end() == 0

    # Each message is answered, and answers that come again after a fault have the same bytes.
    for name in scene.NAMES:
        answers = [json.loads(one) for one in broker.sent[f"{name}/tracks"]]
        assert {one["of"] for one in answers} == set(range(int(end_s * scene.HZ)))
        assert len({json.dumps(one) for one in answers}) == int(end_s * scene.HZ)
    found = [json.loads(one) for one in broker.sent["found"]]
    passages = [one for one in found if one["event"] == "passage"]
    told = [(one["identity"], one["to"]) for one in passages]
    assert len(told) == len(set(told)) >= 23
    for one in passages:  # each is of one true vehicle
        k = scene.NAMES.index(one["to"])
        off = np.abs(vehicles["t"][:, k] - one["t"]) + 0.1 * np.abs(
            vehicles["speed"] - one["speed_kmh"] / 3.6
        )
        who = int(off.argmin())
        assert abs(vehicles["t"][who, k] - one["t"]) < 0.1
        true = vehicles["t"][who, k] - vehicles["t"][who, k - 1]
        assert one["travel_time_s"] == pytest.approx(true, abs=0.2)
    assert any(one["event"] == "travel-time" and one["vehicles"] > 3 for one in found)
    assert [one["seq"] for one in found] == list(range(len(found)))
    assert shown["corridor"]["gaps"][0]["followed"] >= 11
    assert families["jeat_graph_passages_total", "C"] == 12.0
    assert families["jeat_graph_followed_total", "A", "B"] >= 11.0
    assert shown["corridor"]["gaps"][1]["d_prime"] == 3.0, "looks came with the messages"
    assert families["jeat_graph_appearance_d_prime", "B", "C"] == 3.0
    assert families["jeat_graph_ready", "B"] == 1.0
    assert len(families) > 60


@pytest.fixture
def checked(tmp_path, capsys):
    """Write the file of a service with changes, and check it; code and what is said."""

    def check(old, new):
        path = scene.written(tmp_path)
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))
        code = main(["serve", "--check", str(path)])
        told = capsys.readouterr()
        return code, told.out + told.err

    return check


def test_a_good_file_is_valid_and_nothing_is_made(checked, tmp_path):
    pytest.importorskip("nats", reason="the client is not installed")
    code, said = checked("name: road", "name: road")
    assert (code, said) == (0, f"{tmp_path / 'road.yaml'}: valid: 3 cameras, 3 sources, 4 sinks\n")
    assert not (tmp_path / "state").exists()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("name: road", "nam: road", ":1: unknown key nam"),
        ("learnt: corridor.yaml", "learnt: nothing.yaml", "nothing.yaml: cannot be read"),
        ("  learnt: corridor.yaml\n", "", "corridor.learnt: give the corridor.yaml"),
        ("C: }", "D: }", "its cameras are not those of the service"),
        ("direction: left", "direction: up", "road.direction: 'up' is not one of left, right"),
        (", direction: left", "", "cameras.A.road: give camera, lines and direction"),
        ("camera: camera.yaml", "camera: lines.yaml", "lines.yaml"),
        ("lines: lines.yaml", "lines: lines.yaml, line: north", "cameras.A.road.line: "),
        ("image: [1920, 1080]", "config: defautl", "cameras.A: "),
        ("B: ,", "B: {sinks: [{url: '-'}]},", "cameras.B.sinks: standard output"),
        ("B: ,", "B: {sources: [{url: 'nats://broker'}]},", "cameras.B.sources[0].url"),
        ("A: , B: , C: ", "A: ", "cameras: a corridor has two or more"),
        ("folder: state", "folder: lines.yaml/x", "state.checkpoint: "),
        ("interval_s: 30", "clocks: own", "corridor.clocks: 'own'"),
        ("{camera}/scans", "scans", "cameras.B.sources[0]: nats://broker/scans is that of camera A, too"),
        ("B: ,", "B: {sinks: [{url: 'nats://broker/C/scans'}]},", "would come back as scans"),
        ("nats://broker/found", "nats://broker/B/scans", "cameras.B.sources[0].url, corridor.sinks[0]: "),
    ],
)
def test_what_would_end_a_start_is_said_before(old, new, words, checked):
    pytest.importorskip("nats", reason="the client is not installed")
    code, said = checked(old, new)
    assert code == 2
    assert words in said
    assert said.count("\n") == 1


def test_a_camera_without_the_embedder_that_was_learnt_with_is_told_of(checked):
    pytest.importorskip("nats", reason="the client is not installed")
    source = "B: {sources: [{frames: 'rtsp://cam/road', detector: motion%s}]},"
    code, said = checked("B: ,", source % "")
    assert code == 0
    assert "cameras.B.sources[0]: names no embedder, and " in said
    assert "cameras.A" not in said
    assert "embedder" not in checked("B: ,", source % ", embedder: colour")[1]


def test_lanes_of_other_names_than_learnt_are_refused(tmp_path, capsys):
    pytest.importorskip("nats", reason="the client is not installed")
    path = scene.written(tmp_path)
    tree = scene.learnt()
    for gap in tree["gaps"]:
        gap["model"]["lane_ratios"] = {"slow": {"slow": 2.0, "fast": 0.1}, "fast": {"slow": 0.1, "fast": 2.0}}
    (tmp_path / "corridor.yaml").write_text(yaml.safe_dump(tree))
    assert main(["serve", "--check", str(path)]) == 2
    assert "cameras.A.road.lines: has the lanes 1, 2, and those learnt of A-B are fast, slow" in (
        capsys.readouterr().err
    )
    marks = (tmp_path / "lines.yaml").read_text().replace("'1'", "slow").replace("'2'", "fast")
    (tmp_path / "lines.yaml").write_text(marks)
    assert main(["serve", "--check", str(path)]) == 0


def test_a_damaged_state_is_refused_or_renamed(tmp_path, broker):
    pytest.importorskip("nats", reason="the client is not installed")
    path = scene.written(tmp_path)
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "corridor.json").write_text("{")
    assert main(["serve", str(path)]) == 2
    config, _ = read_corridor_service(path)
    service = CorridorService(config, Log("road", io.StringIO()), sets_aside_damaged=True)
    service.interrupts.seen = 15
    assert service.run() == 0
    assert (tmp_path / "state" / "corridor.json.damaged-1").read_text() == "{"
