"""The factor graph of a run's tracks, in users' hands."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.api.sources import PathLike
from jeat_graph.data.errors import DataError

if TYPE_CHECKING:
    from jeat_graph.smoothers.gtsam.filter_graph import FilterGraph


def factor_graph(run: PathLike, tracks: int | Iterable[int] | None = None) -> FilterGraph:
    """Return GTSAM's factor graph and values of a run's tracks, to be looked at, added to and solved.

    Priors, motion with the process noise that the filter took, and what every detection says of the state
    with the noise that the filter gave its sensor, one state a scan. Solved as it is, it gives what
    whole-track smoothing gives; `docs/guides/factor-graph.md` adds to it.

    Args:
        run: run directory.
        tracks: one identity or some, as in its tables; all by default.

    Returns:
        The graph, its values, and what its keys mean.

    Raises:
        DataError: there is no run, an input has changed since, or a track was never reported.
        ConfigError: the run's engine keeps no records of its filter.
    """
    from jeat_graph.runs.measured import measured_run
    from jeat_graph.smoothers.gtsam.filter_graph import filter_graph

    there = {one.track_id: one for one in measured_run(Path(run)).tracks}
    wanted = list(there) if tracks is None else [tracks] if isinstance(tracks, int) else list(tracks)
    missing = [number for number in wanted if number not in there]
    if missing:
        raise DataError(f"has no reported track {missing[0]}; there are {_some(sorted(there))}", run)
    return filter_graph([there[number] for number in wanted])


def _some(numbers: list[int]) -> str:
    """Name some of many numbers."""
    if len(numbers) <= _MOST_NAMED:
        return ", ".join(map(str, numbers)) or "none"
    return f"{', '.join(map(str, numbers[:_MOST_NAMED]))} and {len(numbers) - _MOST_NAMED} more"


_MOST_NAMED = 10
