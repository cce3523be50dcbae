"""A sensor whose scans come, but are all passed over, is no healthy one."""

from __future__ import annotations

import io
import json
import sys

import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.live.late import LiveTracker
from jeat_graph.live.messages import decode_scans
from jeat_graph.live.service.config import read_service
from jeat_graph.live.service.ends import OpenedSource
from jeat_graph.live.service.log import Log
from jeat_graph.live.service.metrics import Metrics
from jeat_graph.live.service.run import Service, _Running
from jeat_graph.live.service.status import RUNNING, EndStatus
from jeat_graph.live.session import Ends, Session
from jeat_graph.live.session_warnings import BadLines
from jeat_graph.live.transport.notices import Notices

HZ, BEHIND_S = 10.0, 30.0


class Source:
    """Gives the payloads of a list."""

    most_open = 1000

    def __init__(self):
        self.payloads = []

    def receive(self, timeout_s):
        return self.payloads.pop(0) if self.payloads else None


@pytest.fixture
def world(tmp_path, monkeypatch):
    """(service, its clock, a function that has it take scans of sensors and their times)."""
    now = [1000.0]
    monkeypatch.setattr("jeat_graph.live.service.status.time.monotonic", lambda: now[0])
    path = tmp_path / "service.yaml"
    path.write_text("sources: [{url: 'mqtt://host/t'}]\nsinks: [{url: '-'}]\nsilent_s: 10\n")
    service = Service(read_service(path)[0], Log("x", io.StringIO()))
    service.status.phase = RUNNING
    source = Source()
    opened = OpenedSource(source, EndStatus("fake", Notices()))
    live = LiveTracker(Tracker(load_config("default", ["smoother.engine=none"])))
    session = Session(live, Ends(tracks=lambda *_: None, warn=lambda _: None))
    running = _Running(session, [opened], None, None, BadLines(lambda _: None))

    def take(**times):
        now[0] += 1.0 / HZ
        for sensor, t in times.items():
            scan = {"t": t, "sensor": sensor, "boxes": [[20, 100, 40, 30]], "scores": [0.9]}
            source.payloads.append(json.dumps(scan).encode())
            service._take_from(opened, running, 0.0)

    return service, take


def test_a_sensor_of_which_nothing_is_taken_is_a_problem_until_something_is(world):
    service, take = world
    status = service.status
    take(rgb=100.0, evt=100.0)
    for k in range(1, 95):
        take(rgb=100.0 + k / HZ, evt=100.0 + k / HZ - BEHIND_S)
    assert status.problems() == []  # nothing for 9.4 s
    for k in range(95, 125):
        take(rgb=100.0 + k / HZ, evt=100.0 + k / HZ - BEHIND_S)
    assert status.problems() == ["sensor 'evt': none of its scans has been taken for 12 s"]
    shown = status.health()["sensors"]
    assert shown["evt"]["passed_over"] == 123  # the last one waits to be confirmed or refuted
    assert shown["evt"]["taken_age_s"] == pytest.approx(12.4)
    assert shown["rgb"]["passed_over"] == 0
    take(rgb=112.5, evt=112.5)
    assert status.problems() == []


def test_the_metric_has_a_value_for_each_sensor(world):
    pytest.importorskip("prometheus_client", reason="the extra `serve` is not installed")
    service, take = world
    take(rgb=100.0, evt=100.0)
    for k in range(1, 8):
        take(rgb=100.0 + k / HZ, evt=100.0 + k / HZ - BEHIND_S)
    rows = Metrics(service.status).text().decode().splitlines()
    found = sorted(row for row in rows if row.startswith("jeat_graph_passed_over_total"))
    assert found == [
        'jeat_graph_passed_over_total{sensor="evt"} 6.0',  # and one waits
        'jeat_graph_passed_over_total{sensor="rgb"} 0.0',
    ]


def test_without_messagepack_garbage_is_skipped_and_counted(world, monkeypatch):
    service, take = world
    monkeypatch.setitem(sys.modules, "msgpack", None)
    take(rgb=100.0)
    monkeypatch.setattr(json, "dumps", lambda _: "\0garbage")
    take(rgb=100.1)
    monkeypatch.undo()
    take(rgb=100.2)
    assert (service.status.counted.unreadable, service.status.counted.taken) == (1, 2)


def test_times_since_1970_are_told_to_the_millisecond():
    said = []
    live = LiveTracker(Tracker(load_config("default", ["smoother.engine=none"])))
    session = Session(live, Ends(tracks=lambda *_: None, warn=said.append))
    begin = 1_795_860_000.25
    for t in (begin, begin + 0.05, begin + 900.0, begin + 0.1):
        scan = {"t": t, "sensor": "rgb", "boxes": [[20, 100, 40, 30]], "scores": [0.9]}
        session.accept(decode_scans(json.dumps(scan).encode(), "x", 1), "x:1: ")
    assert any("gave the time 1795860900.250 s, which no" in text for text in said)
