"""What jeat-graph itself calls here; its entry points lead to these functions."""

from __future__ import annotations

from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.runs.demo_recording import DemoRecording
from jeat_graph_sehn.simulation.scenario import kinds_of, load_scenario
from jeat_graph_sehn.simulation.simulate import record
from jeat_graph_sehn.simulation.simulate import simulate as simulate_scenario
from jeat_graph_sehn.simulation.world.markings import marking_lines


def simulate(
    scenario: str = "night-nolight", *, duration_s: float = 30.0, seed: int = 0
) -> tuple[Detections, GroundTruth]:
    """Simulate the detections of a highway's sensors, with their truth.

    Args:
        scenario: a name (`day`, `night`, `night-nolight`, …) or a YAML file.
        duration_s: length (s).
        seed: another seed, other traffic.

    Raises:
        ConfigError: no such scenario, or values that are not valid.
    """
    return simulate_scenario(load_scenario(scenario), seed, duration_s)


def record_demo(scenario: str, density: str | None, duration_s: float, seed: int) -> DemoRecording:
    """Simulate what `jeat-graph demo` shows: a recording, and the road's markings as they are seen.

    Args:
        scenario: a name or a YAML file.
        density: of the traffic: sparse, normal or dense; None for the scenario's own.
        duration_s: length (s).
        seed: another seed, other traffic.

    Raises:
        ConfigError: no such scenario, or values that are not valid.
    """
    recording = record(load_scenario(scenario, density), seed, duration_s)
    camera = recording.scene.camera
    return DemoRecording(
        name=scenario,
        detections=recording.detections,
        truth=recording.truth,
        width=camera.width,
        height=camera.height,
        lines=marking_lines(recording.scene),
        declared=kinds_of(recording.scenario),
    )
