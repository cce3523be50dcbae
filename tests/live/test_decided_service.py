"""`serve` with identities that are decided with a lag: killed or not, it writes the same rows."""

from __future__ import annotations

import json
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from live_tests import brokers
from live_tests.test_service import Running, answers_until, wait_for

from jeat_graph import Scan, Tracker, load_config
from jeat_graph.io.streams.track_lines import csv_header, csv_rows
from jeat_graph.live.late import LiveTracker
from jeat_graph.live.transport.ends import open_sink, open_source

SETTINGS = ["smoother.lag_s=0.6", "smoother.identities=lag"]
HIDDEN_S = (2.0, 4.6)


def scene():
    """Two who meet, and one who is hidden for longer than a causal track lives."""
    rng = np.random.default_rng(1)
    for k in range(160):
        t = k / 20.0
        left = [(300.0 + 25.0 * t, 400.0), (600.0 - 25.0 * t, 420.0)]
        if not HIDDEN_S[0] < t < HIDDEN_S[1]:
            left.append((40.0 + 45.0 * t, 150.0))
        corner = np.array(left) + rng.normal(0, 0.6, (len(left), 2))
        yield Scan(
            100.0 + t, "rgb", np.column_stack([corner, np.full((len(left), 2), 36.0)]), [0.9] * len(left)
        )


def uninterrupted():
    """The rows of a tracker that was never stopped, in any order."""
    live, rows = LiveTracker(Tracker(load_config("default", SETTINGS), image=(1280, 720))), []
    for scan in scene():
        live.step(scan)
        rows += csv_rows(live.drain_smoothed(), False).splitlines()
    return sorted([*rows, *csv_rows(live.finish(), False).splitlines()])


def newest(path):
    """Time of the newest scan that a checkpoint holds."""
    return LiveTracker.load(path)[0].time if path.is_file() else None


def test_killed_and_back_identities_that_were_written_stay(tmp_path):
    pytest.importorskip("prometheus_client", reason="the extra `serve` is not installed")
    pytest.importorskip("nats", reason="the client is not installed")
    (tmp_path / "broker").mkdir()
    server, web = brokers.nats_server(tmp_path / "broker"), brokers.free_port()
    if server is None:
        pytest.skip("this machine has no nats-server")
    begin, path, rows = f"nats://127.0.0.1:{server.port}", tmp_path / "service.yaml", tmp_path / "s.csv"
    path.write_text(f"""\
name: gantry7
tracker: {{image: [1280, 720], set: [{", ".join(SETTINGS)}]}}
sources: [{{url: "{begin}/scans"}}]
sinks: [{{url: "{begin}/tracks"}}]
state: {{checkpoint: state.npz, every_s: 1, smoothed: s.csv}}
web: {{port: {web}}}
""")
    answers = open_source(f"{begin}/tracks")
    written, found, scans = set(), [], list(scene())
    service = Running(path, web)
    try:
        wait_for(lambda: service.said("running"), "the service runs", service)
        sink = open_sink(f"{begin}/scans")
        for low, high in pairwise((0, 70, 160)):  # one is hidden from 41 to 91
            for k in range(low, high):
                one = {"t": scans[k].t, "sensor": "rgb", "boxes": scans[k].boxes.tolist()}
                one["scores"] = scans[k].scores.tolist()
                sink.send(json.dumps({"v": 1, "source": "gantry7", "seq": k, "scans": [one]}).encode())
            sink.flush()
            answers_until(answers, high - 20, found)
            service.process.kill()
            service.process.wait()
            written |= set(rows.read_text().splitlines()[:-1])
            service = Running(path, web)
            saved_s = partial(newest, tmp_path / "state.npz")
            wait_for(lambda t=scans[high - 1].t, at=saved_s: at() == t, "it saves what came again", service)
        assert service.end() == 0
    finally:
        service.process.kill()
        answers.close()
        server.stop()
    text = rows.read_text()
    assert text.startswith(csv_header(identities=True))
    assert written
    assert sorted(text.splitlines()[1:]) == uninterrupted()
    assert written <= set(text.splitlines())
    identity, causal = ({row.split(",")[column] for row in text.splitlines()[1:]} for column in (1, -2))
    assert (len(identity), len(causal)) == (3, 4)
