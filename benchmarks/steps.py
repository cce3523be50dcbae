"""Steps from one configuration to another, one change each, for the table of the ablation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from typing import Any

from jeat_graph.config.reading import config_from_dict, config_to_dict
from jeat_graph.config.schema import Config, SensorConfig


@dataclass(frozen=True)
class Change:
    """One row of the ablation.

    Attributes:
        name: what the row adds.
        take: keys that get the target's values from here on; `sensors.*` stands for every sensor.
        hold: keys that get values of their own, until a later step takes them from the target.
    """

    name: str
    take: tuple[str, ...]
    hold: Mapping[str, Any] = field(default_factory=dict)


STEPS = (
    Change(
        "+ scale-aware noise and motion",
        (
            "sensors.*.sigma_px",
            "sensors.*.rho_x",
            "sensors.*.rho_y",
            "sensors.*.bias",
            "motion",
            "noise",
            "size",
            "sensors.*.sigma_log_width",
            "sensors.*.sigma_log_height",
        ),
        # What the likelihood of the innovations finds best as long as nothing is known of perspective.
        {"motion.jerk_per_size": 2.0, "motion.jerk_per_growth": 0.0},
    ),
    Change("+ size in the gate", ("association.size_gate", "association.gate_probability")),
    Change(
        "+ likelihood as cost",
        (
            "association.cost",
            "association.log_size_range",
            "sensors.*.p_detect",
            "sensors.*.clutter_per_scan",
            "sensors.*.precision",
            "sensors.*.score_precision",
        ),
        {"lifecycle.hidden_prior": 0.0},
    ),
    Change("+ one slot a sensor", ("association.method", "association.second_pass", "association.priority")),
    Change("+ no duplicate births, merging", ("birth.max_overlap", "merge")),
    Change(
        "+ existence probability, births weighed",
        ("lifecycle", "birth", "sensors.*.tempering", "input"),
        {"lifecycle.hidden_prior": 0.0, "lifecycle.p_detect_weight": 0.0, "lifecycle.leave_picture": False},
    ),
    Change("+ output rules", ("output", "smoother", "lifecycle.leave_picture", "sensors.*.score_fit")),
    Change("+ blindness of the event camera", ("sensors.*.blind_speed",)),
    Change("+ P_D of each track, hidden vehicles", ("lifecycle.hidden_prior", "lifecycle.p_detect_weight")),
    Change("+ standing tracks", ("standing",)),
    Change("+ errors with memory", ("sensors.*.correlated_share", "sensors.*.memory_s")),
    Change("+ boxes cut by the picture's edge", ("image.edge_px",)),
    Change("+ jerk by perspective", ("motion",)),
)


def start(paper: Config, target: Config) -> Config:
    """Return the paper's configuration for the sensors and the picture of the target.

    Sensors that the paper's preset does not name get its RGB constants.
    """
    generic = paper.sensors.get("rgb", SensorConfig())
    sensors = {
        name: replace(paper.sensors.get(name, generic), rate_hz=sensor.rate_hz)
        for name, sensor in target.sensors.items()
    }
    image = replace(target.image, edge_px=paper.image.edge_px)
    return replace(paper, sensors=sensors, image=image, association=replace(paper.association, priority=()))


def rows(paper: Config, target: Config, steps: Sequence[Change] = STEPS) -> list[tuple[str, Config]]:
    """All configurations from `start(paper, target)` to `target`, each with its name.

    The last one takes whatever is left, so it equals the target exactly.
    """
    first = start(paper, target)
    tree, goal = config_to_dict(first), config_to_dict(target)
    out = [("paper", first)]
    for k, step in enumerate(steps):
        tree = deepcopy(tree)
        for key in step.take:
            for path in _paths(key, goal):
                _put(tree, path, _get(goal, path))
        for key, value in step.hold.items():
            for path in _paths(key, goal):
                _put(tree, path, value)
        last = k == len(steps) - 1
        out.append((step.name, config_from_dict(goal if last else tree)))
    return out


def _paths(key: str, tree: Mapping[str, Any]) -> list[tuple[str, ...]]:
    path = tuple(key.split("."))
    if path[:2] == ("sensors", "*"):
        return [("sensors", name, *path[2:]) for name in tree["sensors"]]
    return [path]


def _get(tree: Mapping[str, Any], path: tuple[str, ...]) -> Any:
    value: Any = tree
    for key in path:
        value = value[key]
    return deepcopy(value)


def _put(tree: dict[str, Any], path: tuple[str, ...], value: Any) -> None:
    for key in path[:-1]:
        tree = tree[key]
    tree[path[-1]] = value


def without(target: Config) -> list[tuple[str, Config]]:
    """The target with one of its parts switched off again: what that part is worth where all others work.

    Args:
        target: the configuration at the end of the way.
    """
    white = {name: replace(sensor, correlated_share=0.0) for name, sensor in target.sensors.items()}
    return [
        ("all, without NIS adaptation", replace(target, noise=replace(target.noise, adaptation_rate=0.0))),
        ("all, without errors with memory", replace(target, sensors=white)),
        (
            "all, misses of one scan independent",
            replace(target, lifecycle=replace(target.lifecycle, sight_scans=0.0)),
        ),
    ]
