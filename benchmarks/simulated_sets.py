"""Sets of simulated recordings: highways, worlds beside the highway, and odd detectors on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

from benchmarks.foreign import recorded, worlds
from benchmarks.recordings import JudgedRecording, RecordingSet
from benchmarks.robustness import variations, varied
from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.simulate import simulate

_SCENARIOS = ("day", "night", "night-nolight")
DURATION_S = 30.0


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
