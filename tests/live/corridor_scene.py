"""Three cameras along a road and a broker in memory, for the tests of a service with several cameras."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import numpy as np
import yaml

from jeat_graph.live.transport.address import parse_address
from jeat_graph.road.camera import RoadCamera, mounted
from jeat_graph.road.camera_file import write_camera

GAPS_M = {"A-B": 150.0, "B-C": 200.0}
NAMES = "ABC"
HZ = 10.0
NUMBERS = 8  # of an embedding
LINE_M, FROM_M, TO_M = 40.0, 22.0, 75.0


def a_camera() -> RoadCamera:
    pose = mounted(np.radians(18.0), np.radians(5.0), 0.0)
    return RoadCamera(1920, 1080, 2000.0, 2000.0, 960.0, 540.0, 0.0, 0.0, pose, np.array([0.0, 0.0, 8.0]))


def learnt(offsets_s=(0.0, 0.0)) -> dict:
    """A `corridor.yaml`, as handover would write it."""
    gaps = []
    for (name, metres), offset in zip(GAPS_M.items(), offsets_s, strict=True):
        first, second = name.split("-")
        model = {"weights": [0.5, 0.5], "carry": 0.9, "speed_spread": 0.03, "length_shift": 0.0}
        model |= {"length_spread": 0.1, "slowness_sd": 0.0, "slowness_time_s": 60.0}
        model |= {"new_share": 0.1, "own_variance": 0.02}
        model |= {"appearance": {"same": 0.9, "other": 0.0, "sigma": 0.3, "numbers": NUMBERS}}
        gaps.append(
            {"from": first, "to": second, "offset_s": offset, "distance_m": metres}
            | {"covariance": [[0.01, 0.0], [0.0, 1.0]], "slowness": 0.0, "spread": 0.02}
            | {"outliers": 0.01, "matched": 0.9, "model": model}
        )
    return {"gaps": gaps}


def written(folder: Path, more: str = "", corridor: str = "") -> Path:
    """Write the files of the service; the path of its own."""
    camera = a_camera()
    write_camera(camera, folder / "camera.yaml")
    ends = camera.project(np.array([[-5.0, LINE_M, 0.0], [5.0, LINE_M, 0.0]]))[0].ravel()
    marks = {"lines": {"gate": ends.tolist()}, "lanes": {"1": [-4.0, 0.0], "2": [0.0, 4.0]}}
    (folder / "lines.yaml").write_text(yaml.safe_dump(marks))
    (folder / "corridor.yaml").write_text(yaml.safe_dump(learnt()))
    path = folder / "road.yaml"
    path.write_text(
        f"""\
name: road
corridor:
  learnt: corridor.yaml
  interval_s: 30
  sinks: [{{url: "nats://broker/found"}}]
{corridor}each:
  tracker: {{image: [1920, 1080]}}
  sources: [{{url: "nats://broker/{{camera}}/scans"}}]
  sinks: [{{url: "nats://broker/{{camera}}/tracks"}}]
  road: {{camera: camera.yaml, lines: lines.yaml, direction: left}}
cameras: {{A: , B: , C: }}
state: {{folder: state, every_s: 5}}
web: {{port: 0}}
{more}"""
    )
    path.chmod(0o600)
    return path


def traffic(count: int, headway_s: float, seed: int) -> dict[str, np.ndarray]:
    """Vehicles that drive evenly through all cameras: `t` (N, 3), `speed` (N,), `x` (N,), `looks` (N, 8)."""
    rng = np.random.default_rng(seed)
    speed = 25.0 * np.exp(0.12 * rng.normal(size=count))
    start = 6.0 + np.cumsum(headway_s * rng.uniform(0.4, 1.6, count))
    way = np.cumsum([0.0, *GAPS_M.values()])
    return {
        "t": start[:, None] + way / speed[:, None],
        "speed": speed,
        "x": rng.choice([-2.0, 2.0], count),
    } | {"looks": rng.normal(size=(count, NUMBERS))}


def messages(vehicles: dict[str, np.ndarray], camera: int, end_s: float) -> list[tuple[float, bytes]]:
    """What a camera's detector sends, with the time of each message (s)."""
    view, rng = a_camera(), np.random.default_rng([camera, 1])
    found = []
    for k in range(int(end_s * HZ)):
        t = k / HZ
        y = LINE_M + vehicles["speed"] * (t - vehicles["t"][:, camera])
        seen = (y > FROM_M) & (y < TO_M)
        foot = view.project(np.c_[vehicles["x"][seen], y[seen], np.zeros(seen.sum())])[0]
        size = 2000.0 / y[seen]
        foot = foot + 0.01 * size[:, None] * rng.normal(size=foot.shape)
        boxes = np.c_[foot[:, 0] - 0.9 * size, foot[:, 1] - 1.5 * size, 1.8 * size, 1.5 * size]
        scan = {"t": t, "sensor": "rgb", "boxes": boxes.round(2).tolist(), "scores": [0.9] * len(boxes)}
        if len(boxes):
            shown = vehicles["looks"][seen] + 0.2 * rng.normal(size=(len(boxes), NUMBERS))
            scan["embeddings"] = shown.round(3).tolist()
        found.append((t, json.dumps({"v": 1, "source": NAMES[camera], "seq": k, "scans": [scan]}).encode()))
    return found


class Broker:
    """Keeps messages until they are committed; gives none before its clock has come to their time."""

    def __init__(self) -> None:
        self.clock_s = 0.0
        self.waiting: dict[str, list[tuple[float, bytes]]] = {}
        self.committed: dict[str, int] = {}
        self.sent: dict[str, list[bytes]] = {}
        self.broken: set[str] = set()
        self.answered: dict[str, set[int]] = {}

    def open_source(self, url, _overdue, notices):
        return MemorySource(self, url, notices)

    def open_sink(self, url, _overdue, notices):
        return MemorySink(self, url, notices)


class MemorySource:
    most_open = 1000

    def __init__(self, broker, url, notices):
        self.address, self._broker = parse_address(url, ()), broker
        self._topic = self.address.topic
        self._next = broker.committed.get(self._topic, 0)
        notices.connected = True

    def receive(self, timeout_s):
        if self._topic in self._broker.broken:
            self._broker.broken.discard(self._topic)
            raise OSError("its connection is gone for good")
        messages = self._broker.waiting[self._topic]
        if self._next < len(messages) and messages[self._next][0] <= self._broker.clock_s:
            self._next += 1
            return messages[self._next - 1][1]
        threading.Event().wait(min(timeout_s, 0.01))
        return None

    def commit(self):
        self._broker.committed[self._topic] = self._next

    def close(self):
        pass


class MemorySink:
    too_large = 0

    def __init__(self, broker, url, notices):
        self.address = parse_address(url, ())
        self._sent = broker.sent.setdefault(self.address.topic, [])
        self._answered = broker.answered.setdefault(self.address.topic, set())
        notices.connected = True

    def send(self, message):
        self._sent.append(message)
        self._answered.add(json.loads(message).get("of"))

    def flush(self):
        pass

    def close(self):
        pass
