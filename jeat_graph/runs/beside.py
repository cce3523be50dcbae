"""What files beside a recording say of it: the picture's size and the frame rate, so that nobody types them.

`seqinfo.ini` of MOTChallenge says both, a video says both, a folder of pictures says its size.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from jeat_graph.config.reading import as_config
from jeat_graph.config.schema import Config
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import FrameCount
from jeat_graph.runs.directory import read_record

# Rates of two files of one recording may differ in their last digits: 29.97 and 30 do not, 25 and 30 do.
_SAME_RATE = 0.02


class Facts(NamedTuple):
    """What is known of a recording's frames.

    Attributes:
        size_px: width and height of the picture, or None.
        rate_hz: frames per second, or None.
        origin: the file that says so.
    """

    size_px: tuple[int, int] | None
    rate_hz: float | None
    origin: str


def facts_of_frames(frames: str | Path) -> Facts:
    """Return size and rate of a video or a folder of pictures.

    Raises:
        DataError: it cannot be read.
    """
    from jeat_graph.io.media.video import peek

    size_px, rate_hz = peek(frames)
    return Facts(size_px, rate_hz, str(frames))


def facts_beside(paths: Sequence[str | Path]) -> Facts | None:
    """Return what files beside those of a format say, as `seqinfo.ini` does; None where two disagree.

    Raises:
        DataError: a file cannot be read.
    """
    from jeat_graph.io.formats.registry import recognise

    found = []
    for path in paths:
        facts = recognise(path).facts
        if facts is not None:
            info = facts(path)
            if info.origin is not None:
                found.append(Facts(info.size_px, info.rate_hz, str(info.origin)))
    if not found or any(one[:2] != found[0][:2] for one in found):
        return None
    return found[0]


def with_picture(config: Config, overrides: Sequence[str], facts: Facts | None) -> tuple[Config, list[str]]:
    """Take the picture's size from a file beside the recording, unless the user has said it.

    Args:
        config: the configuration, `overrides` applied.
        overrides: settings that the user gave, such as `image.width=1920`.
        facts: what is known, if anything.

    Returns:
        The configuration, and a line that says what was taken, or none.
    """
    size_given = any(
        text.strip().startswith("image.") or text.strip().startswith("image=") for text in overrides
    )
    if size_given or facts is None or facts.size_px is None:
        return config, []
    width, height = facts.size_px
    known = config.input.picture == "given"
    if known and (width, height) == (config.image.width, config.image.height):
        return config, []
    note = f"picture of {width} x {height} px, as {facts.origin} says"
    return as_config(config, facts.size_px), [note]


def rate_of_truth(run: str | Path, truth: str | Path, rate_hz: float | None) -> float | None:
    """Return the frame rate by which a run and its truth are read.

    Args:
        run: run directory, table or result.
        truth: file of the truth.
        rate_hz: what the user says, or None.

    Returns:
        The user's rate (Hz); without it, where the truth counts frames and no `seqinfo.ini` says it, the one
        that the run's input was read by; else None.

    Raises:
        DataError: the user's rate is not that of `seqinfo.ini` beside the truth, or of the run's input.
    """
    from jeat_graph.io.formats.registry import recognise

    kind = recognise(truth)
    counts = kind.rate_hz is None and kind.counts_frames(truth)
    known = facts_beside([truth]) if counts else None
    recorded = recorded_rate(run)
    if rate_hz is None:
        stated = known is not None and known.rate_hz is not None
        return recorded if counts and not stated else None
    if known is not None and known.rate_hz is not None:
        _check_same(rate_hz, known.rate_hz, known.origin)
    if counts and recorded is not None:
        _check_same(rate_hz, recorded, f"the run {run}, from its input,")
    return rate_hz


def recorded_rate(run: str | Path) -> float | None:
    """Return the frame rate (Hz) by which a run's input was read, None where none was needed or known."""
    try:
        rate = read_record(Path(run))["reading"]["rate_hz"]
    except (DataError, KeyError, TypeError):
        return None
    return float(rate) if isinstance(rate, int | float) and rate > 0.0 else None


def recorded_frames(run: str | Path) -> FrameCount | None:
    """Return the frame numbers of a run's input, None where it had times, or that is not known."""
    try:
        found = read_record(Path(run))["frames"]
        numbers = [found[key] for key in ("first", "lowest", "highest")]
    except (DataError, KeyError, TypeError):
        return None
    if not all(isinstance(number, int) for number in numbers):
        return None
    first, lowest, highest = numbers
    return FrameCount(first, lowest, highest, found.get("fixed") is True)


def recorded_size(run: str | Path) -> tuple[int, int] | None:
    """Return width and height (px) of the picture that a run was tracked with, None where it is not known."""
    try:
        image = read_record(Path(run))["config"]["image"]
        size = round(image["width"]), round(image["height"])
    except (DataError, KeyError, TypeError):
        return None
    return size if min(size) > 0 else None


def _check_same(rate_hz: float, other_hz: float, origin: str) -> None:
    if abs(rate_hz / other_hz - 1.0) > _SAME_RATE:
        raise DataError(f"--rate {rate_hz:g} does not fit: {origin} says {other_hz:g} Hz; leave it out")
