"""Times of pictures by the edges of a signal that the event camera recorded: triggers, or exposures."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.io.events.layout import EventLayout
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.events.reader import Triggers

TRIGGERS, RISE, FALL = "triggers", "rise", "fall"
_CHOICE = re.compile(rf"{TRIGGERS}(?::(?P<channel>\d+))?(?::(?P<edge>{RISE}|{FALL}))?")
_US_PER_S = 1e6


class EdgeCounts(NamedTuple):
    """How many edges of a signal rose, and how many fell."""

    rising: int
    falling: int


class TriggerChoice(NamedTuple):
    """Which edges are the times of pictures.

    Attributes:
        channel: number of the input; None: the only one that has as many as there are pictures.
        edge: `rise` or `fall`.
    """

    channel: int | None = None
    edge: str = RISE


def trigger_choice(text: str) -> TriggerChoice:
    """Read `triggers`, `triggers:CHANNEL`, `triggers:fall` or `triggers:CHANNEL:fall`.

    Raises:
        ConfigError: it is none of these.
    """
    found = _CHOICE.fullmatch(text)
    if found is None:
        raise ConfigError(
            f"--frame-times can be {TRIGGERS}, {TRIGGERS}:CHANNEL, {TRIGGERS}:{FALL} or "
            f"{TRIGGERS}:CHANNEL:{FALL}, not {text!r}"
        )
    channel = found["channel"]
    return TriggerChoice(None if channel is None else int(channel), found["edge"] or RISE)


def count_edges(triggers: Triggers) -> dict[str, EdgeCounts]:
    """Count edges by channel."""
    out = {}
    for channel in np.unique(triggers.channel).tolist():
        value = triggers.value[triggers.channel == channel]
        out[str(channel)] = EdgeCounts(int((value > 0).sum()), int((value == 0).sum()))
    return out


@lru_cache(maxsize=1)
def _read(path: Path, layout: EventLayout | None, size: int, written_ns: int) -> Triggers:
    """Read them once; size and time tell whether the file is the same."""
    parts = []
    with open_events(path, None, layout) as reader:
        reader.labels = False
        for _ in reader.pieces():
            parts.append(reader.triggers)
    return Triggers.joined(parts)


def read_triggers(path: Path, layout: EventLayout | None = None) -> Triggers:
    """Read all edges of a file of events, on the clock of its events as they are handed out (µs).

    Raises:
        ConfigError: an extra package is needed for this format.
        DataError: it cannot be read.
    """
    status = path.stat() if path.exists() else None
    return _read(path, layout, status.st_size if status else 0, status.st_mtime_ns if status else 0)


def times_by_triggers(
    path: Path, choice: TriggerChoice, layout: EventLayout | None = None
) -> Callable[[int], tuple[FloatArray, str]]:
    """Return what gives the times of so many pictures, one an edge, and says where they come from.

    Args:
        path: file of events.
        choice: which edges.
        layout: of the file.

    Raises:
        DataError: by what is returned: there are not as many edges as pictures, or not ascending ones.
    """

    def times(count: int) -> tuple[FloatArray, str]:
        triggers = read_triggers(path, layout)
        of_edge = triggers.value == (choice.edge == RISE)
        channels = np.unique(triggers.channel).tolist() if choice.channel is None else [choice.channel]
        fitting = [one for one in channels if int((of_edge & (triggers.channel == one)).sum()) == count]
        if len(fitting) != 1:
            raise DataError(_not_as_many(triggers, choice, count, fitting), path)
        t = triggers.t_us[of_edge & (triggers.channel == fitting[0])] / _US_PER_S
        if (np.diff(t) <= 0).any():
            raise DataError(f"times of the triggers of channel {fitting[0]} do not ascend", path)
        return t, f"where channel {fitting[0]} of the triggers of {path} {choice.edge}s"

    return times


def _not_as_many(triggers: Triggers, choice: TriggerChoice, count: int, fitting: list[int]) -> str:
    counts = count_edges(triggers)
    if not counts:
        return f"has no triggers to take the times of {count} frames from"
    shown = "; ".join(
        f"channel {name}: {one.rising} rise, {one.falling} fall" for name, one in counts.items()
    )
    if fitting:
        which = ", ".join(map(str, fitting))
        return (
            f"channels {which} of its triggers each {choice.edge} {count} times, as there are frames "
            f"({shown}): name one with --frame-times {TRIGGERS}:CHANNEL"
        )
    return (
        f"its triggers are not as many as the {count} frames ({shown}): name the channel and the edge with "
        f"--frame-times {TRIGGERS}:CHANNEL:{RISE} or :{FALL}, or leave out frames or events without a partner"
    )
