"""Files that hold several videos: one of them is read, or none; they are never laid over each other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from jeat_graph.data.errors import DataError

_MOST_NAMED = 5


def choose_video(
    names: Sequence[str], wanted: str | int | None, path: str | Path | None = None
) -> str | None:
    """Choose one of the videos that a file holds.

    Args:
        names: of the videos, each once; a name and a number of one video are `3 (b.mp4)`.
        wanted: the user's choice: a name or a number, or None.
        path: the file, for messages, if there is one.

    Returns:
        One of `names`; None where there is none to choose from.

    Raises:
        DataError: there are several and none is chosen, or the one chosen is not there.
    """
    if not names:
        return None
    if wanted is None:
        if len(names) == 1:
            return names[0]
        raise DataError(
            f"holds {len(names)} videos ({_listed(names)}): read one of them with --only-video NAME (in "
            "Python video=)",
            path,
        )
    text = str(wanted)
    for name in names:
        number, bracket, rest = name.partition(" (")
        if text == name or (bracket and text in (number, rest.removesuffix(")"))):
            return name
    if len(names) == 1:
        return names[0]
    raise DataError(f"holds no video {text!r}; there are {_listed(names)}", path)


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    return ", ".join(names[:_MOST_NAMED]) + more
