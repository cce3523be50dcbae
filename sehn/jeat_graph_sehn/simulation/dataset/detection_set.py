"""Writes a simulation of detections into a folder: tables, truth, settings, manifest."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.io.files.hashing import sha256_of
from jeat_graph.io.files.locking import hold_folder
from jeat_graph.io.tables.detections_io import write_detections
from jeat_graph.io.tables.rounding import round_decimals
from jeat_graph.io.tables.table_writer import write_columns
from jeat_graph.io.tables.truth_io import write_truth
from jeat_graph.version import __version__
from jeat_graph_sehn.simulation.dataset.layout import (
    CAMERA,
    DETECTIONS,
    MANIFEST,
    SCENARIO,
    TRUTH,
    TRUTH_ROAD,
)
from jeat_graph_sehn.simulation.scenario import Scenario, scenario_to_yaml
from jeat_graph_sehn.simulation.simulate import SimulatedRecording, record

STEPS = 3  # calls of `on_step`


def write_detection_set(
    scenario: Scenario, name: str, out: Path, seed: int, duration_s: float, on_step: Callable[[], object]
) -> dict[str, Any]:
    """Simulate a recording and write detections, truth in the picture and on the road, settings, manifest.

    Args:
        scenario: the settings.
        name: what the user calls them.
        out: the folder; files of these names in it are replaced.
        seed: not negative.
        duration_s: length (s).
        on_step: called three times on the way.

    Returns:
        The manifest.

    Raises:
        ConfigError: a seed or a duration that is not valid.
        DataError: another process is writing into the folder.
    """
    recording = record(scenario, seed, duration_s)
    on_step()
    out.mkdir(parents=True, exist_ok=True)
    with hold_folder(out):
        return _write(recording, name, out, {"seed": seed, "duration_s": duration_s}, on_step)


def _write(
    recording: SimulatedRecording, name: str, out: Path, asked: dict[str, Any], on_step: Callable[[], object]
) -> dict[str, Any]:
    detections, truth, scenario = recording.detections, recording.truth, recording.scenario
    write_detections(detections, out / DETECTIONS)
    on_step()
    write_truth(truth, out / TRUTH)
    write_columns(road_truth(recording), out / TRUTH_ROAD)
    on_step()
    with open_atomic(out / SCENARIO) as file:
        file.write(scenario_to_yaml(scenario))
    with open_atomic(out / CAMERA) as file:
        file.write(yaml.safe_dump(recording.scene.camera.to_dict(), sort_keys=False))
    boxes = np.diff(detections.scan_start)
    sensors = {
        sensor: {
            "scans": int((detections.scan_sensor == k).sum()),
            "detections": int(boxes[detections.scan_sensor == k].sum()),
        }
        for k, sensor in enumerate(detections.sensors)
    }
    manifest: dict[str, Any] = {
        "version": __version__,
        "scenario": name,
        **asked,
        "density": scenario.traffic.density,
        "sensors": sensors,
        "truth": {
            "frames": len(truth.frame_times()),
            "boxes": len(truth),
            "ignored": int(truth.ignore.sum()),
            "objects": len(np.unique(truth.object_id)),
        },
        "sha256": {file: sha256_of(out / file) for file in (DETECTIONS, TRUTH, TRUTH_ROAD, SCENARIO, CAMERA)},
    }
    with open_atomic(out / MANIFEST) as file:
        file.write(json.dumps(manifest, indent=2) + "\n")
    return manifest


def road_truth(recording: SimulatedRecording) -> dict[str, Any]:
    """Columns of the truth on the road: where every vehicle's middle is, how fast it is and how large.

    Rows are those vehicles and times that the truth in the picture has, too. Metres along the camera's road
    axes (x right, y along the road), km/h, degrees from y towards x.
    """
    truth, scene = recording.truth, recording.scene
    states = scene.states_at(truth.frame_times(), far_m=recording.scenario.truth.horizon_m)
    t = truth.frame_times()[states.frame]
    asked = set(zip(truth.t.tolist(), truth.object_id.tolist(), strict=True))
    rows = np.array(
        [key in asked for key in zip(t.tolist(), states.object_id.tolist(), strict=True)], dtype=bool
    )
    vx, vy = states.velocity[rows, 0], states.velocity[rows, 1]
    numbers = {
        "x": states.pose[rows, 0],
        "y": states.pose[rows, 1],
        "speed_kmh": np.hypot(vx, vy) * 3.6,
        "heading_deg": np.degrees(np.arctan2(vx, vy)),
        **{name: states.size[rows, k] for k, name in enumerate(("length", "width", "height"))},
    }
    return {
        "t": t[rows],
        "object_id": states.object_id[rows],
        **{name: round_decimals(values, 6) for name, values in numbers.items()},
    }
