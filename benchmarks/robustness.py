"""Detectors that no preset was made for, on the simulated highway: what is lost when an assumption fails."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from benchmarks.recordings import JudgedRecording
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth

SCENARIO, DARK = "day", "night-nolight"
_LATE_S = 0.05
_SWAY_PX, _SWAY_HZ = 6.0, 0.7
_POOR = "third"


@dataclass(frozen=True)
class Variation:
    """One change of the detectors.

    Attributes:
        name: in the table.
        scenario: nested settings laid over each sensor of the scenario.
        sensors: the same by sensor.
        world: name of the scenario.
        change: what is done to the recording afterwards.
    """

    name: str
    scenario: Mapping[str, Any] = field(default_factory=dict)
    sensors: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    world: str = SCENARIO
    change: Callable[[JudgedRecording], JudgedRecording] | None = None


def variations() -> list[Variation]:
    """All of them, the recording as it is first."""
    return [
        Variation("as it is"),
        Variation("white noise", {"noise": {"correlated_share": 0.0}}),
        Variation(
            "noise doubled",
            sensors={
                "rgb": {"noise": {"sigma_px": 1.0, "rho": 0.04, "sigma_log_size": 0.1}},
                "evt": {"noise": {"sigma_px": 1.8, "rho": 0.07, "sigma_log_size": 0.16}},
            },
        ),
        Variation("half of the vehicles found", {"detect": {"p_max": 0.5}}),
        Variation(
            "five times the clutter",
            sensors={"rgb": {"clutter": {"per_scan": 1.5}}, "evt": {"clutter": {"per_scan": 2.0}}},
        ),
        *(Variation(f"both at {rate} Hz", {"timing": {"rate_hz": float(rate)}}) for rate in (5, 10, 25, 50)),
        Variation("meaningless scores", change=_meaningless_scores),
        Variation(f"events {_LATE_S * 1e3:g} ms late", change=_late),
        Variation("gantry swaying", change=_sway),
        Variation("with a third, poor detector", change=_third),
        Variation("two poor detectors alone", change=_two_poor),
        Variation("no light", world=DARK),
        Variation("no light, half of the vehicles found", {"detect": {"p_max": 0.5}}, world=DARK),
    ]


@lru_cache(maxsize=2)
def varied(name: str, seed: int, duration_s: float) -> JudgedRecording:
    """Simulate the recording of a variation."""
    import dataclasses

    from jeat_graph.config.section_tree import merge, plain
    from jeat_graph_sehn.simulation.scenario import load_scenario, scenario_from_dict
    from jeat_graph_sehn.simulation.simulate import simulate

    one = next(v for v in variations() if v.name == name)
    tree = plain(dataclasses.asdict(load_scenario(one.world)))
    for sensor in tree["sensors"]:
        for change in (one.scenario, one.sensors.get(sensor, {})):
            tree["sensors"][sensor] = merge(tree["sensors"][sensor], change)
    detections, truth = simulate(scenario_from_dict(tree), seed=seed, duration_s=duration_s)
    recording = JudgedRecording(f"{name}/{seed}", detections, truth)
    return recording if one.change is None else one.change(recording)


def _meaningless_scores(one: JudgedRecording) -> JudgedRecording:
    rng = np.random.default_rng(0)
    return replace(one, detections=replace(one.detections, scores=rng.random(len(one.detections))))


def _late(one: JudgedRecording) -> JudgedRecording:
    """Give the events the times at which they would arrive."""
    t, sensor, boxes, scores, empty, _ = one.detections.to_rows()
    late = t + np.where(sensor == "evt", _LATE_S, 0.0)
    return replace(one, detections=Detections.from_rows(late, sensor, boxes, scores, empty))


def _sway(one: JudgedRecording) -> JudgedRecording:
    """Move the whole picture to and fro, truth and all."""

    def shift(t: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        phase = 2.0 * np.pi * _SWAY_HZ * t
        zero = np.zeros_like(t)
        return _SWAY_PX * np.stack([np.sin(phase), 0.5 * np.cos(1.3 * phase), zero, zero], axis=1)

    d, truth = one.detections, one.truth
    t = d.box_t
    moved = GroundTruth(
        t=truth.t,
        object_id=truth.object_id,
        boxes=truth.boxes + shift(truth.t),
        motion=None,
        ignore=truth.ignore,
        classes=truth.classes,
        frames=truth.frames,
    )
    return replace(one, detections=replace(d, boxes=d.boxes + shift(t)), truth=moved)


def _third(one: JudgedRecording) -> JudgedRecording:
    """Add a poor detector."""
    third = _poor_detector(one.truth, _POOR, 1)
    return replace(one, detections=Detections.concatenate([one.detections, third]))


def _two_poor(one: JudgedRecording) -> JudgedRecording:
    """Leave nothing but two poor detectors."""
    poor = [_poor_detector(one.truth, name, seed) for seed, name in enumerate(("first", "second"), 11)]
    return replace(one, detections=Detections.concatenate(poor))


def _poor_detector(truth: GroundTruth, name: str, seed: int) -> Detections:
    """Simulate a detector at 10 Hz that finds half of the vehicles and takes a dozen fixed things for one."""
    rng = np.random.default_rng(seed)
    frames = np.unique(truth.t)[::2]
    low, high = np.array([0.0, 100.0, 30.0, 30.0]), np.array([1200.0, 650.0, 90.0, 70.0])
    places = rng.uniform(low, high, (12, 4))
    t, boxes, scores = [], [], []
    for moment in frames:
        there = truth.boxes[(truth.t == moment) & ~truth.ignore]
        seen = there[rng.random(len(there)) < 0.5]
        false = places[rng.random(len(places)) < 0.6]
        found = np.concatenate([seen, false])
        found = found + rng.normal(0.0, 0.06, found.shape) * found[:, [2, 3, 2, 3]]
        found[:, 2:] = np.maximum(found[:, 2:], 4.0)
        t.append(np.full(len(found), moment))
        boxes.append(found)
        scores.append(rng.uniform(0.4, 0.95, len(found)))
    return Detections.from_rows(
        np.concatenate(t), np.full(sum(map(len, t)), name), np.concatenate(boxes), np.concatenate(scores)
    )
