"""What a live run says at its end of messages that were not taken or not answered as they came."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Counts(NamedTuple):
    """How often something was not as it should be.

    Attributes:
        bad: messages that could not be read.
        duplicates: messages that had been taken before.
        flat: boxes without area.
        too_large: answers that the broker does not take because of their size.
        forgotten: sources of messages that are no longer known by their numbers.
    """

    bad: int
    duplicates: int
    flat: int
    too_large: int
    forgotten: int = 0


def count_lines(counts: Counts, restarts: Mapping[str, int]) -> list[str]:
    """Return a line for each kind that there was.

    Args:
        counts: how often.
        restarts: by source, how often it restarted its count of messages.
    """
    lines = []
    if counts.bad:
        lines.append(f"{counts.bad} messages could not be read and were passed over")
    if counts.duplicates:
        lines.append(f"{counts.duplicates} messages had been taken before and were passed over")
    if counts.flat:
        lines.append(f"{counts.flat} box(es) without area left out")
    if counts.too_large:
        lines.append(f"{counts.too_large} answer(s) were larger than the broker takes and were not sent")
    if counts.forgotten:
        lines.append(f"{counts.forgotten} sources were forgotten: only the last are known by their numbers")
    for source, count in restarts.items():
        often = "once" if count == 1 else f"{count} times"
        lines.append(f"source {source!r} restarted its count of messages {often}")
    return lines
