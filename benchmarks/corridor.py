"""`python -m benchmarks corridor`: what a service of many cameras in one process costs, in real time.

Simulated streams of detections go through a broker to `jeat-graph serve` with one configuration of all
cameras, and the tracks and what is found of the corridor come back. Processor time and memory are those of
the service alone, once it has warmed up.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from benchmarks import common
from benchmarks.provenance import provenance
from jeat_graph.config.argument_types import counting, natural, positive
from jeat_graph.data.errors import ConfigError
from jeat_graph.eval.tables import Cell, Table
from jeat_graph.live.transport.brokers.record import Sink
from jeat_graph.live.transport.ends import open_sink
from jeat_graph.road.camera import RoadCamera, mounted
from jeat_graph.road.camera_file import write_camera

_GAP_M, _LINE_M, _SEEN_M = 300.0, 40.0, (22.0, 90.0)
_SPEED, _SPREAD = 27.0, 0.1
_WARM_S = 20.0
_PORTS = (20_000, 32_000)
_START_S = 120.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.declare(parser, "corridor", {})
    add = parser.add_argument
    add("--cameras", type=counting, default=30, metavar="N", help="streams (30)")
    add("--rate", type=positive, default=10.0, metavar="HZ", help="scans a second of each (10)")
    add("--flow", type=positive, default=1200.0, metavar="N", help="vehicles an hour (1200)")
    add("--duration", type=positive, default=120.0, metavar="S", help="so long is measured (120)")
    add("--broker", choices=("nats", "mqtt"), default="nats", help="nats-server or Mosquitto (nats)")
    add("--seed", type=natural, default=0, metavar="N", help="of the traffic (0)")


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return common.measure_or_read(args, "corridor", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Run the service and send it the streams."""
    settings = {
        "cameras": args.cameras,
        "rate_hz": args.rate,
        "flow_per_h": args.flow,
        "duration_s": args.duration,
        "broker": args.broker,
        "seed": args.seed,
    }
    with tempfile.TemporaryDirectory() as folder, _server(Path(folder), args.broker) as broker:
        found = _measured(Path(folder), broker, args)
    return {"benchmark": "corridor", **provenance(settings, {}), **found}


def _measured(folder: Path, broker: str, args: argparse.Namespace) -> dict[str, Any]:
    names = [f"c{k:02d}" for k in range(args.cameras)]
    web = _free_port()
    path = write_service(folder, names, broker, web)
    sinks = [open_sink(f"{broker}/scans.{name}") for name in names]
    command = [sys.executable, "-m", "jeat_graph", "serve", str(path)]
    with (folder / "log").open("w") as log:
        process = subprocess.Popen(command, stderr=log)
    try:
        _wait_until_running(folder / "log", process, len(names) + 1)
        return _sent(sinks, process.pid, web, args)
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(_START_S)
        for sink in sinks:
            sink.close()


def _sent(sinks: list[Sink], pid: int, web: int, args: argparse.Namespace) -> dict[str, Any]:
    """Send all streams in real time, and look at the service in between."""
    rng = np.random.default_rng(args.seed)
    total_s = _WARM_S + args.duration
    count = int((total_s + 60.0) * args.flow / 3600.0 * 1.5)
    vehicles = {
        "speed": _SPEED * np.exp(_SPREAD * rng.normal(size=count)),
        "start": np.cumsum(rng.exponential(3600.0 / args.flow, count)) - 60.0 - _GAP_M * len(sinks) / _SPEED,
        "x": rng.choice([-2.0, 2.0], count),
    }
    more = int(_GAP_M * len(sinks) / _SPEED * args.flow / 3600.0)
    vehicles = {name: np.concatenate([v, v[:more]]) for name, v in vehicles.items()}
    vehicles["start"][-more:] = vehicles["start"][-more - 1] + np.cumsum(
        rng.exponential(3600.0 / args.flow, more)
    )
    camera, origin = a_camera(), time.time()
    memory: list[float] = []
    cpu = begun = np.nan
    for k in range(int(total_s * args.rate)):
        t = k / args.rate
        time.sleep(max(origin + t - time.time(), 0.0))
        for place, sink in enumerate(sinks):
            boxes = boxes_seen(camera, vehicles, place * _GAP_M, t, rng)
            scan = {"t": origin + t, "sensor": "rgb", "boxes": boxes, "scores": [0.9] * len(boxes)}
            sink.send(json.dumps({"v": 1, "source": str(place), "seq": k, "scans": [scan]}).encode())
        if t >= _WARM_S and np.isnan(cpu):
            cpu = _cpu_s(pid)
            begun = time.time()
        if k % int(10 * args.rate) == 0:
            memory.append(_memory_mb(pid))
    cpu, wall = _cpu_s(pid) - cpu, time.time() - begun
    time.sleep(3.0)
    health = _health(web)
    answered = [one["messages"]["answered"] for one in health["cameras"].values()]
    return {
        "cpu_cores": cpu / wall,
        "memory_mb": memory,
        "sent": int(total_s * args.rate),
        "answered_least": min(answered),
        "answered_most": max(answered),
        "lag_s": max(one["lag_s"] for one in health["cameras"].values()),
        "passages": sum(one["passages"] for one in health["corridor"]["cameras"].values()),
        "followed": sum(one["followed"] for one in health["corridor"]["gaps"]),
        "problems": health["problems"],
    }


def a_camera() -> RoadCamera:
    """Return a camera 8 m over the road, as all of them are."""
    pose = mounted(np.radians(18.0), np.radians(5.0), 0.0)
    return RoadCamera(1920, 1080, 2000.0, 2000.0, 960.0, 540.0, 0.0, 0.0, pose, np.array([0.0, 0.0, 8.0]))


def boxes_seen(
    camera: RoadCamera, vehicles: Mapping[str, Any], place_m: float, t: float, rng: np.random.Generator
) -> list[list[float]]:
    """Boxes (left, top, width, height in px) of the vehicles that a camera sees at a time (s)."""
    y = _LINE_M + vehicles["speed"] * (t - vehicles["start"]) - place_m
    seen = (y > _SEEN_M[0]) & (y < _SEEN_M[1])
    size = 2000.0 / y[seen]
    foot = camera.project(np.c_[vehicles["x"][seen], y[seen], np.zeros(seen.sum())])[0]
    foot = foot + 0.02 * size[:, None] * rng.normal(size=foot.shape)
    boxes = np.c_[foot[:, 0] - 0.9 * size, foot[:, 1] - 1.5 * size, 1.8 * size, 1.5 * size]
    found: list[list[float]] = boxes.round(2).tolist()
    return found


def write_service(folder: Path, names: list[str], broker: str, web: int) -> Path:
    """Write the service's file, a camera, its line, and a corridor that was learnt."""
    camera = a_camera()
    write_camera(camera, folder / "camera.yaml")
    ends = camera.project(np.array([[-5.0, _LINE_M, 0.0], [5.0, _LINE_M, 0.0]]))[0].ravel()
    marks = {"lines": {"gate": ends.tolist()}, "lanes": {"1": [-4.0, 0.0], "2": [0.0, 4.0]}}
    (folder / "lines.yaml").write_text(yaml.safe_dump(marks))
    model = {
        "weights": [0.5, 0.5],
        "carry": 0.9,
        "speed_spread": 0.03,
        "length_shift": 0.0,
        "length_spread": 0.1,
        "slowness_sd": 0.0,
        "slowness_time_s": 60.0,
        "new_share": 0.1,
        "own_variance": _SPREAD**2,
    }
    numbers = {"offset_s": 0.0, "distance_m": _GAP_M, "slowness": 0.0, "spread": 0.02, "outliers": 0.01}
    gaps = [
        {
            "from": a,
            "to": b,
            **numbers,
            "matched": 0.9,
            "covariance": [[0.01, 0.0], [0.0, 1.0]],
            "model": model,
        }
        for a, b in itertools.pairwise(names)
    ]
    (folder / "corridor.yaml").write_text(yaml.safe_dump({"gaps": gaps}))
    service = {
        "name": "load",
        "corridor": {"learnt": "corridor.yaml", "interval_s": 60, "sinks": [{"url": f"{broker}/found"}]},
        "each": {
            "tracker": {"image": [camera.width, camera.height]},
            "sources": [{"url": f"{broker}/scans.{{camera}}"}],
            "sinks": [{"url": f"{broker}/tracks.{{camera}}"}],
            "road": {"camera": "camera.yaml", "lines": "lines.yaml", "direction": "left"},
        },
        "cameras": {name: {} for name in names},
        "state": {"folder": "state", "every_s": 10},
        "web": {"port": web},
    }
    path = folder / "service.yaml"
    path.write_text(yaml.safe_dump(service, sort_keys=False))
    return path


def tables(found: Mapping[str, Any]) -> dict[str, Table]:
    """Return the table."""
    settings, memory = found["settings"], found["memory_mb"]
    row: dict[str, Cell] = {
        "cameras": settings["cameras"],
        "broker": settings["broker"],
        "Hz": settings["rate_hz"],
        "vehicles/h": settings["flow_per_h"],
        "s": settings["duration_s"],
        "cores": found["cpu_cores"],
        "memory MB": memory[-1],
        "at the start": memory[1] if len(memory) > 1 else None,
        "scans sent": found["sent"],
        "answered": f"{found['answered_least']} to {found['answered_most']}",
        "followed of": f"{found['followed']} of {found['passages']}",
    }
    digits = {"cores": 2, "memory MB": 0, "at the start": 0, "s": 0, "Hz": 0, "vehicles/h": 0}
    return {"corridor-load": Table.from_records([row], title="One process, many cameras", digits=digits)}


def _wait_until_running(log: Path, process: subprocess.Popen[bytes], parts: int) -> None:
    """Wait for all cameras and the corridor: a broker keeps nothing for who has not subscribed yet."""
    end = time.monotonic() + _START_S
    while log.read_text().count('"text": "running"') < parts:
        if process.poll() is not None or time.monotonic() > end:
            raise ConfigError(f"the service does not run: {log.read_text()[-400:]}")
        time.sleep(0.1)


def _health(port: int) -> dict[str, Any]:
    import urllib.error
    import urllib.request

    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/health", timeout=_START_S) as answer:
            text = answer.read()
    except urllib.error.HTTPError as error:  # not ready: it says why
        text = error.read()
    found: dict[str, Any] = json.loads(text)
    return found


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _memory_mb(pid: int) -> float:
    rows = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(float(row.split()[1]) for row in rows if row.startswith("VmRSS")) / 1024.0


def _free_port() -> int:
    rng = np.random.default_rng()
    while True:
        port = int(rng.integers(*_PORTS))
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


@contextlib.contextmanager
def _server(folder: Path, kind: str) -> Iterator[str]:
    """Run a broker for as long as it is needed; yields the begin of its addresses."""
    name = "nats-server" if kind == "nats" else "mosquitto"
    beside = Path(sys.executable).with_name(name)
    program = str(beside) if beside.exists() else shutil.which(name)
    if program is None:
        raise ConfigError(f"this benchmark needs {name} on the path")
    port = _free_port()
    command = [program, "-a", "127.0.0.1", "-p", str(port), "-js", "-sd", str(folder / "broker")]
    if kind == "mqtt":
        settings = f"listener {port} 127.0.0.1\nallow_anonymous true\nmax_queued_messages 100000\n"
        (folder / "mosquitto.conf").write_text(settings)
        command = [program, "-c", str(folder / "mosquitto.conf")]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        end = time.monotonic() + _START_S
        while time.monotonic() < end:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.05)
        yield f"{kind}://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait()
