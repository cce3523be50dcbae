"""Writes a simulation of detections into a folder: tables, truth, settings, manifest."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from jeat_graph.data.trajectories import GroundTruth
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
    RIG,
    RIG_CAMERA,
    RIG_TRUTH,
    SCENARIO,
    TRUTH,
    TRUTH_ROAD,
)
from jeat_graph_sehn.simulation.scenario import Scenario, kinds_of, scenario_to_yaml
from jeat_graph_sehn.simulation.simulate import RIG_SENSOR, SimulatedRecording, record
from jeat_graph_sehn.simulation.world.rig import Rig, RigConfig

STEPS = 3  # calls of `on_step`


def write_detection_set(
    scenario: Scenario,
    name: str,
    out: Path,
    seed: int,
    duration_s: float,
    on_step: Callable[[], object],
    rig: RigConfig | str | None = None,
) -> dict[str, Any]:
    """Simulate a recording and write detections, truth in the picture and on the road, settings, manifest.

    Args:
        scenario: the settings.
        name: what the user calls them.
        out: the folder; files of these names in it are replaced.
        seed: not negative.
        duration_s: length (s).
        on_step: called three times on the way.
        rig: the second camera (see `record`); the true rig, its pose and its own truth are then written too.

    Returns:
        The manifest.

    Raises:
        ConfigError: a seed, a duration or a rig that is not valid.
        DataError: another process is writing into the folder, or the two cameras see different roads.
    """
    recording = record(scenario, seed, duration_s, rig)
    true_rig = None
    if recording.rig is not None:
        true_rig = recording.rig.text((scenario.truth_sensor, RIG_SENSOR))
    on_step()
    out.mkdir(parents=True, exist_ok=True)
    with hold_folder(out):
        asked: dict[str, Any] = {"seed": seed, "duration_s": duration_s}
        if recording.rig is not None:
            asked["rig"] = dataclasses.asdict(recording.rig.config)
        return _write(recording, name, out, asked, on_step, true_rig)


def _write(
    recording: SimulatedRecording,
    name: str,
    out: Path,
    asked: dict[str, Any],
    on_step: Callable[[], object],
    true_rig: str | None,
) -> dict[str, Any]:
    detections, truth, scenario = recording.detections, recording.truth, recording.scenario
    write_detections(detections, out / DETECTIONS, declared=kinds_of(scenario))
    on_step()
    write_truth(truth, out / TRUTH)
    write_columns(road_truth(recording), out / TRUTH_ROAD)
    on_step()
    with open_atomic(out / SCENARIO) as file:
        file.write(scenario_to_yaml(scenario))
    with open_atomic(out / CAMERA) as file:
        file.write(yaml.safe_dump(recording.scene.camera.to_dict(), sort_keys=False))
    files = [DETECTIONS, TRUTH, TRUTH_ROAD, SCENARIO, CAMERA]
    for file_name in (RIG, RIG_CAMERA, RIG_TRUTH):
        (out / file_name).unlink(missing_ok=True)  # of an earlier recording
    if recording.rig is not None and recording.own_truth is not None and true_rig is not None:
        _write_rig(recording.rig, recording.own_truth, true_rig, out)
        files += [RIG, RIG_CAMERA, RIG_TRUTH]
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
        "sha256": {name: sha256_of(out / name) for name in files},
    }
    with open_atomic(out / MANIFEST) as file:
        file.write(json.dumps(manifest, indent=2) + "\n")
    return manifest


def _write_rig(rig: Rig, own_truth: GroundTruth, text: str, out: Path) -> None:
    with open_atomic(out / RIG) as file:
        file.write(text)
    with open_atomic(out / RIG_CAMERA) as file:
        file.write(yaml.safe_dump(rig.own.to_dict(), sort_keys=False))
    write_truth(own_truth, out / RIG_TRUTH)


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
