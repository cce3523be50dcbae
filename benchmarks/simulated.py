"""Sets of simulated recordings: highways, worlds beside the highway, and odd detectors on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from benchmarks.foreign import recorded, worlds
from benchmarks.recordings import SCENARIOS, JudgedRecording, RecordingSet, simulated
from benchmarks.robustness import variations, varied
from jeat_graph.data.errors import ConfigError


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
        **dict.fromkeys(SCENARIOS, simulated),
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
