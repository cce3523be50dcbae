"""Rows of the accuracy tables: several configurations of ours, and other trackers with their parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from jeat_graph.config.schema import Config

NAMES = {
    "sort": "SORT",
    "bytetrack": "ByteTrack",
    "ocsort": "OC-SORT",
    "botsort": "BoT-SORT",
    "norfair": "Norfair",
}

# Where the parameters in `benchmarks/peers` were searched, beside KITTI.
SEARCH_SEED = 100
SEARCH_DURATION_S = 8.0


@dataclass(frozen=True)
class Ours:
    """A row of our own.

    Attributes:
        row: its name.
        config: of the tracker.
        sensors: which it is given; None: all.
        association: its name where ways of association are compared; None: it is not compared there.
    """

    row: str
    config: Config
    sensors: tuple[str, ...] | None = None
    association: str | None = None


@dataclass(frozen=True)
class Peer:
    """A row of somebody else's tracker.

    Attributes:
        row: its name.
        name: key of the baselines.
        sensors: which it is given; several are merged before it sees them.
        parameters: what differs from its defaults.
    """

    row: str
    name: str
    sensors: tuple[str, ...]
    parameters: Mapping[str, Any]


def ours(default: Config, paper: Config, label: str, sensors: Sequence[str]) -> list[Ours]:
    """Rows of our own: fused, each sensor alone, joint and sequential association, and the paper's.

    Args:
        default: the configuration to be judged.
        paper: the paper's, for the same sensors.
        label: name of the first in the table.
        sensors: the slower one first: it has priority in sequential association.
    """
    both = " + ".join(sensors)
    order = tuple(sensors)

    def associated(config: Config, method: str) -> Config:
        return replace(
            config, association=replace(config.association, method=method, priority=order, second_pass=True)
        )

    joint, sequential = "joint", f"sequential, {order[0]} first"
    return [
        Ours(f"{label}, {both}", default, association="ours, one slot a sensor"),
        *(Ours(f"{label}, {name}", default, (name,)) for name in sensors),
        Ours(
            f"{label}, {both}, joint as in the paper",
            associated(default, "joint"),
            association=f"ours, {joint}",
        ),
        Ours(
            f"{label}, {both}, sequential",
            associated(default, "sequential"),
            association=f"ours, {sequential}",
        ),
        Ours(f"paper, {both}", paper, association=f"paper, {joint}"),
        Ours(
            f"paper, {both}, sequential", associated(paper, "sequential"), association=f"paper, {sequential}"
        ),
        *(Ours(f"paper, {name}", paper, (name,)) for name in sensors),
    ]


def streams(sensors: Sequence[str]) -> list[tuple[str, ...]]:
    """What a baseline is run on: each sensor alone, and all merged."""
    return [*((name,) for name in sensors), tuple(sensors)]


def peers(
    sensors: Sequence[str], best: Mapping[str, Mapping[str, Any]], names: Sequence[str] = tuple(NAMES)
) -> list[Peer]:
    """Rows of the baselines: on each sensor and on both, with their defaults and the best of their grids.

    Args:
        sensors: the slower one first: it sets the frames where both are merged.
        best: parameters by `key(name, sensors)`.
        names: the baselines wanted.
    """
    out = []
    for stream in streams(sensors):
        for name in names:
            text = f"{NAMES[name]}, {' + '.join(stream)}"
            out.append(Peer(text, name, stream, {}))
            found = best.get(key(name, stream))
            if found:
                out.append(Peer(f"{text}, tuned", name, stream, found))
    return out


def key(name: str, sensors: Sequence[str]) -> str:
    """Key of a baseline on a stream in the tables of best parameters."""
    return f"{name}/{'+'.join(sensors)}"
