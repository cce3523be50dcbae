"""`python -m benchmarks simulated`: trackers on highways, streets and squares, and with odd detectors."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from functools import lru_cache

from benchmarks import tables
from benchmarks.foreign import recorded, worlds
from benchmarks.recordings import JudgedRecording, RecordingSet
from benchmarks.robustness import variations, varied
from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.simulate import simulate

_SCENARIOS = ("day", "night", "night-nolight")
SEEDS = (0, 1, 2, 3, 4)
DURATION_S, _QUICK_S = 30.0, 4.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    texts = {"seeds": "of the recordings (0 1 2 3 4)", "duration": f"of a recording ({DURATION_S:g})"}
    tables.declare_trackers(parser, "simulated", texts)
    parser.add_argument(
        "--worlds",
        nargs="+",
        metavar="NAME",
        help="judge these alone (all scenarios, streets and odd detectors)",
    )


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return tables.judge_sets(args, _sets)


def _sets(args: argparse.Namespace) -> list[RecordingSet]:
    seeds = tuple(args.seeds or SEEDS)[: tables.most_recordings(args)]
    return simulated_sets(args.worlds, seeds, args.duration or (_QUICK_S if args.quick else DURATION_S))


@lru_cache(maxsize=8)
def simulated(scenario: str, seed: int, duration_s: float = DURATION_S) -> JudgedRecording:
    """Simulate a recording; the last few are kept."""
    detections, truth = simulate(load_scenario(scenario), seed=seed, duration_s=duration_s)
    return JudgedRecording(f"{scenario}/{seed}", detections, truth)


def simulated_sets(
    names: Sequence[str] | None, seeds: Sequence[int], duration_s: float
) -> list[RecordingSet]:
    """Simulate sets of recordings, one recording a seed.

    Args:
        names: of scenarios, worlds and variations; all of them by default.
        seeds: of the recordings.
        duration_s: of each (s).

    Raises:
        ConfigError: an unknown name.
    """
    sources: dict[str, Callable[[str, int, float], JudgedRecording]] = {
        **dict.fromkeys(_SCENARIOS, simulated),
        **dict.fromkeys((world.name for world in worlds()), recorded),
        **dict.fromkeys((one.name for one in variations()), varied),
    }
    for name in names or ():
        if name not in sources:
            raise ConfigError(f"unknown world {name!r}; there are: {', '.join(sources)}")
    return [
        RecordingSet(name, tuple(sources[name](name, seed, duration_s) for seed in seeds))
        for name in names or sources
    ]
