"""What the road costs while it is tracked: as shares of a tracker's step, and of the time that passes."""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.config.reading import load_config
from jeat_graph.data.arrays import FloatArray, RecordArray

_VEHICLES, _RATES_HZ = 30, (20.0, 100.0)
_LEAVE_OUT_S = 1.0
_CHUNK = 64
_PX = 0.7


def road_costs(duration_s: float) -> list[dict[str, Any]]:
    """Measure in this process: causal columns by day, and the fixed lag of 30 vehicles at 20 and 100 Hz."""
    causal, lag = causal_cost(duration_s), lag_cost(duration_s)
    return [{"what": "causal columns", **causal}, {"what": "fixed lag", **lag}]


def causal_cost(duration_s: float) -> dict[str, Any]:
    """Share that causal columns of the road take of a step without them; CPU time, medians over steps."""
    from jeat_graph.io.tables.detections_io import read_detections
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.causal import RoadFilter
    from jeat_graph.tracking.tracker import Tracker
    from jeat_graph_sehn.simulation.dataset.detection_set import write_detection_set
    from jeat_graph_sehn.simulation.scenario import load_scenario

    config = load_config("default")
    alone = replace(config, smoother=replace(config.smoother, engine="none"))
    with tempfile.TemporaryDirectory() as folder:
        write_detection_set(load_scenario("day"), "day", Path(folder), 21, duration_s, lambda: None)
        camera, detections = (
            read_camera(Path(folder) / "camera.yaml"),
            read_detections(Path(folder) / "detections.csv"),
        )
    tracker = Tracker(alone, image=(camera.width, camera.height), diagnostics=True)
    road, times, tables, taken = RoadFilter(camera), list[tuple[float, float]](), list[float](), []
    for scan in detections.scans():
        begin = time.thread_time()
        table = tracker.step(scan)
        stepped = time.thread_time()
        rows = tracker.last_measurements()[0]
        done = time.thread_time()
        taken.append(road.step(scan.t, rows, table.track_id))
        now = time.thread_time()
        if scan.t > _LEAVE_OUT_S:
            times.append((stepped - begin, now - done))
        if len(taken) == _CHUNK:
            begin = time.thread_time()
            road.columns(taken)
            tables.append((time.thread_time() - begin) / _CHUNK)
            taken = []
    step, of_road = np.median(np.array(times), axis=0).tolist()
    columns = float(np.median(tables)) if tables else 0.0
    return {"share": (of_road + columns) / step, "vehicles": None, "real_time": None}


def lag_cost(duration_s: float) -> dict[str, Any]:
    """Seconds of a recording per second of CPU time, for the fixed lag on the road."""
    from jeat_graph.road.fixed_lag import RoadFixedLag

    camera, log = many_vehicles(duration_s)
    smoother = RoadFixedLag(camera)
    begin, cut = 0.0, _LEAVE_OUT_S  # what is compiled and imported first is not counted
    for rows in np.split(log, np.flatnonzero(np.diff(log["t"])) + 1):
        t = float(rows["t"][0])
        if t > cut and not begin:
            begin = time.process_time()
        smoother.step(t, rows)
    spent = time.process_time() - begin
    return {"share": None, "vehicles": _VEHICLES, "real_time": (duration_s - cut) / spent}


def many_vehicles(duration_s: float) -> tuple[Any, RecordArray]:
    """A camera, and what a tracker would give to its tracks of 30 vehicles that two sensors always see.

    Every vehicle drives towards the camera from 95 to 25 m and is then another one, in six lanes.
    """
    from jeat_graph.filters.measurement import MEASUREMENT
    from jeat_graph.road.camera import RoadCamera, mounted
    from jeat_graph.road.cuboid import sides

    pose = mounted(np.radians(10.0), 0.0, 0.0)
    camera = RoadCamera(1280, 720, 1400.0, 1400.0, 640.0, 360.0, 0.0, 0.0, pose, np.array([0.0, 0.0, 8.0]))
    rng, size = np.random.default_rng(0), np.array([4.4, 1.8, 1.5])
    parts = []
    for sensor, rate in enumerate(_RATES_HZ):
        t: FloatArray = np.arange(0.0, duration_s, 1.0 / rate)
        for k in range(_VEHICLES):
            speed = 18.0 + 2.0 * (k % 6)
            way = 70.0 * (k // 6) / 5.0 + speed * t
            xy = np.c_[np.full(len(t), 3.5 * (k % 6) - 8.75), 95.0 - way % 70.0]
            box = sides(camera, xy, np.zeros(len(t)), size)[0]
            box = box + _PX * rng.standard_normal(box.shape)
            extent = box[:, 2:] - box[:, :2]
            rows = np.zeros(len(t), dtype=MEASUREMENT)
            rows["t"], rows["sensor"], rows["scale"] = t, sensor, 1.0
            rows["track_id"] = 1 + k + _VEHICLES * (way // 70.0).astype(np.int64)
            rows["z"], rows["log_size"] = (box[:, :2] + box[:, 2:]) / 2.0, np.log(extent)
            rows["r"], rows["coloured_std"] = _PX**2 / 4.0, _PX / 2.0
            rows["size_var"] = 2.0 * _PX**2 / extent**2
            parts.append(rows)
    log = np.concatenate(parts)
    return camera, log[np.argsort(log["t"], kind="stable")]
