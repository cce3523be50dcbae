"""Files of one recording are read together, so that their frames count from the same number.

The first frame of a recording may be empty in one file and not in another. So all files are read, the first
frames are decided once from the numbers of all of them (`frame_numbers.first_frames`), one line says how, and
a file that was taken to count otherwise is read again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from jeat_graph.data.frame_numbers import FrameCount, first_frames, note_first
from jeat_graph.data.notes import note

Content = TypeVar("Content")


@dataclass(frozen=True)
class Reader(Generic[Content]):
    """Reads one file, or whatever has frame numbers.

    Attributes:
        title: what it is called in notes.
        read: reads it with its first frame given, or with None as it counts by itself; returns the content
            and the frame numbers, None where it has times.
        settled: whether it cannot be read otherwise, as a run cannot that was tracked before.
    """

    title: str
    read: Callable[[int | None], tuple[Content, FrameCount | None]]
    settled: bool = False


def read_together(
    readers: Sequence[Reader[Content]], given: int | None = None, truth: int | None = None
) -> tuple[list[Content], list[FrameCount | None]]:
    """Read files of one recording.

    Args:
        readers: of the files.
        given: the first frame that the user says, of the files where it can be; one that has a frame 0 counts
            from 0 beside others that have none.
        truth: which of them is the truth that the others are judged by, or None.

    Returns:
        What each holds, and its frame numbers with the first as it was decided, None where it has times.
        What is settled is returned as it is, though its first frame may be decided to be another one.
    """
    found = [reader.read(None) for reader in readers]
    counts = [count for _, count in found]
    firsts = first_frames(counts, truth)
    if given is not None:
        fixed = all(count is None or count.fixed for count in counts)
        firsts = [None if count is None else _as_given(count, given, fixed) for count in counts]
        if given not in firsts and any(first is not None for first in firsts):
            for reader in readers:
                reader.read(given)  # says what is wrong with it
    contents = [content for content, _ in found]
    for k, (reader, count, first) in enumerate(zip(readers, counts, firsts, strict=True)):
        if count is not None and first != count.first and not reader.settled:
            contents[k] = reader.read(first)[0]
    _say([reader.title for reader in readers], counts, firsts, given, truth)
    decided = zip(counts, firsts, strict=True)
    return contents, [
        None if count is None or first is None else count._replace(first=first) for count, first in decided
    ]


def _as_given(count: FrameCount, given: int, fixed: bool) -> int:
    """As said, where no number is below it and the format, or that of some file, leaves it open."""
    return count.first if count.lowest < given or (count.fixed and not fixed) else given


def _say(
    titles: Sequence[str],
    counts: Sequence[FrameCount | None],
    firsts: Sequence[int | None],
    given: int | None,
    truth: int | None,
) -> None:
    """Say in one line from which number frames count, where a user might think otherwise."""
    counted = [k for k, count in enumerate(counts) if count is not None]
    by_first = {first: [titles[k] for k in counted if firsts[k] == first] for first in (0, 1)}
    if by_first[0] and by_first[1]:
        text = " and ".join(f"from {first} in {', '.join(names)}" for first, names in by_first.items())
        note(f"frames count {text}" + (" (--first-frame says otherwise)" if given is None else ""))
        return
    if given is not None:
        return
    for k in counted:
        count = counts[k]
        if count is None or firsts[k] == count.first:
            continue
        other = next(one for one in counted if (found := counts[one]) is not None and found.from_0)
        name = "the truth" if other == truth else "the run" if k == truth else titles[other]
        note(f"{titles[k]}: frames count from 0, as those of {name} do (--first-frame 1 says otherwise)")
        return
    for k in counted:
        note_first(titles[k], counts[k])
