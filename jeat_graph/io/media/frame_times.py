"""When each picture of a recording was taken: lists beside it, names that are times, time stamps of a video.

================================  ===========================================================================
`NAME.frames.csv`, `frames.csv`   `index,t_us`; the first belongs to the video NAME.mp4 whatever its length
`images.txt`, `rgb.txt`           time (s) and name of a picture a line: RPG's and TUM's data sets
`timestamps.txt`, …               one time a line: DSEC, or `# timecode format v2` of Matroska's tools (ms)
names of pictures                 whole numbers that are times, `seconds_nanoseconds`, or seconds with a point
video                             the time stamps of its pictures
================================  ===========================================================================

Whole numbers are in the unit in which they are times of a clock since 1970, or else in which their step is
one of a camera.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.time_units import TIME_UNITS, in_seconds

FRAME_TIMES = "frames.csv"
#: Files that list the times of pictures or of a video, one a line.
TIME_LISTS = ("timestamps.txt", "image_timestamps.txt")
#: Files that list the time (s) and the name of each picture.
NAME_LISTS = ("images.txt", "rgb.txt")
# Whole numbers from here on count from 1970 (s, from 1973 on); each unit has a thousand times as many.
_EPOCH_S = 1e8
# Names that step by less are numbers of frames, not times.
_LEAST_STEP = 1000
# Whole seconds of a slow camera step by less.
_SLOWEST_STEP_S = 5.0
# A step of a camera in a unit: from here (a thousand a second) to a thousand times as long.
_LEAST_CAMERA_STEP = {"ns": 1e6, "us": 1e3, "ms": 1.0}
_V2 = re.compile(r"#\s*time(?:code|stamp) format v2", re.IGNORECASE)
_NAME = re.compile(r"(?P<text>\D*?)(?P<whole>\d+)(?:(?P<mark>[._])(?P<rest>\d+))?")
_NS_DIGITS, _EPOCH_DIGITS = 9, 10
#: Time stamps this near to number / rate are rounded values of it: Matroska keeps milliseconds.
STAMP_RESOLUTION_S = 1.001e-3
# Lengths of one recording, by two clocks, differ by no more than this share and so many pictures.
_SAME_LENGTH, _SAME_FRAMES = 0.1, 2.0


class NamedTimes(NamedTuple):
    """Times of pictures that have names.

    Attributes:
        times_s: (F,) ascending (s).
        order: (F,) which of the names each belongs to.
        origin: what says so, for messages.
    """

    times_s: FloatArray
    order: IntArray
    origin: str


def unit_of_whole(times: FloatArray) -> str | None:
    """Return the unit that whole numbers (N,) are times in, or None where nothing tells.

    Numbers that count from 1970 tell it by their size, others by their median step.
    """
    if not len(times):
        return None
    for unit, per_second in sorted(TIME_UNITS.items(), key=lambda item: -item[1]):
        if unit != "s" and times[0] >= _EPOCH_S * per_second:
            return unit
    if len(times) < 2:
        return None
    step = float(np.median(np.diff(np.sort(times))))
    if times[0] >= _EPOCH_S and step < _SLOWEST_STEP_S:
        return None  # whole seconds, or milliseconds of a very fast camera
    return next((unit for unit, least in _LEAST_CAMERA_STEP.items() if step >= least), None)


def times_in_names(stems: Sequence[str]) -> NamedTimes | None:
    """Read the times that the names of pictures are, or return None where they are no times.

    Args:
        stems: names without folder and suffix, as `1504645177.42`, `1305031102_175304000`,
            `left_1403636579763555584`.
    """
    found = [_NAME.fullmatch(stem) for stem in stems]
    parts = [match.group("text", "whole", "mark", "rest") for match in found if match is not None]
    if len(parts) < len(stems) or len({(text, mark) for text, _, mark, _ in parts}) != 1:
        return None
    mark = parts[0][2]
    whole = np.array([float(one) for _, one, _, _ in parts])
    if mark is None:
        unit = unit_of_whole(whole)
        if unit is None or not _are_times(whole, unit):
            return None
        return _ordered(in_seconds(whole, unit), f"the names of the pictures ({unit})")
    rests = [rest for _, _, _, rest in parts]
    if mark == ".":
        values = np.array([float(f"{one}.{rest}") for _, one, _, rest in parts])
        return _ordered(values, "the names of the pictures (s)")
    padded = all(len(rest) == _NS_DIGITS for rest in rests)
    since_1970 = all(len(one) == _EPOCH_DIGITS and len(rest) <= _NS_DIGITS for _, one, _, rest in parts)
    if not (padded or since_1970):
        return None
    nanoseconds = np.array([float(rest) for rest in rests])
    return _ordered(whole + nanoseconds / TIME_UNITS["ns"], "the names of the pictures (seconds_nanoseconds)")


def times_of_listed(file: Path, names: Sequence[str]) -> NamedTimes | None:
    """Read `images.txt` of RPG's data sets or `rgb.txt` of TUM's: a time (s) and a name a line.

    Args:
        file: the list.
        names: of the pictures, with suffix.

    Returns:
        The times; None where the file is a list of something else.

    Raises:
        DataError: it lists pictures of this folder, but not all, or its times do not ascend.
    """
    rows = [
        (line, words)
        for line, text in enumerate(file.read_text(encoding="utf-8", errors="replace").splitlines(), start=1)
        if (words := text.split()) and not text.lstrip().startswith("#")
    ]
    place = {name: k for k, name in enumerate(names)}
    listed = [
        (line, words[0], place[Path(words[1]).name])
        for line, words in rows
        if len(words) == 2 and Path(words[1]).name in place
    ]
    if not listed:
        return None
    missing = set(range(len(names))) - {k for _, _, k in listed}
    if missing:
        raise DataError(f"does not list {names[min(missing)]}, which lies in the folder of pictures", file)
    times = np.array([_number(text, file, line) for line, text, _ in listed])
    _check_ascending(times, file, [line for line, _, _ in listed])
    return NamedTimes(times, np.array([k for _, _, k in listed]), file.name)


def read_frame_times(path: str | Path) -> IntArray:
    """Read the times (F,) of `frames.csv` (µs).

    Raises:
        DataError: not such a table, or times that do not ascend.
    """
    from jeat_graph.io.tables.file_tables import read_table

    table = read_table(path, ("index", "t_us"))
    t_us = table.whole("t_us")
    bad = np.diff(t_us) <= 0
    if bad.any():
        raise table.error(1 + int(np.argmax(bad)), "t_us must ascend")
    return t_us


def read_times_s(path: Path) -> FloatArray:
    """Read the times (F,) of `frames.csv`, or of a list with one time a line, in s.

    Raises:
        DataError: not such a file, times that do not ascend, or whose unit nothing tells.
    """
    if path.suffix == ".txt":
        return _read_list(path)
    return np.asarray(read_frame_times(path) / TIME_UNITS["us"])


def table_beside(place: Path) -> Path | None:
    """Find the file that lists the times of a folder of pictures or of a video, without names."""
    folders = (place, place.parent) if place.is_dir() else (place.parent,)
    known = [place.with_name(f"{place.stem}.{FRAME_TIMES}")] if not place.is_dir() else []
    known += [folder / FRAME_TIMES for folder in folders]
    # DSEC has its pictures in images/left/rectified and their times in images.
    above = (*folders, place.parent.parent) if place.is_dir() else folders
    known += [folder / name for folder in above for name in TIME_LISTS]
    return next((file for file in known if file.is_file()), None)


def listed_names(place: Path, names: Sequence[str]) -> NamedTimes | None:
    """Return what a list of names in or above a folder of pictures says; None without one."""
    for folder in (place, place.parent):
        for name in NAME_LISTS:
            if (folder / name).is_file():
                found = times_of_listed(folder / name, names)
                if found is not None:
                    return found
    return None


def check_of_this_video(table: Path, times_s: FloatArray, stamps_s: FloatArray | None, video: Path) -> None:
    """Refuse a table of times that lasts longer or shorter than the video that it should belong to.

    Args:
        table: the file.
        times_s: (F,) what it says.
        stamps_s: (F,) the video's own, or None.
        video: the video.

    Raises:
        DataError: they differ by more than two clocks do.
    """
    if stamps_s is None or len(stamps_s) < 2 or table.name == f"{video.stem}.{FRAME_TIMES}":
        return
    ours, theirs = float(times_s[-1] - times_s[0]), float(stamps_s[-1] - stamps_s[0])
    step = theirs / (len(stamps_s) - 1)
    if abs(ours - theirs) > max(_SAME_LENGTH * theirs, _SAME_FRAMES * step):
        raise DataError(
            f"lasts {ours:.3f} s, but the pictures of {video} {theirs:.3f} s by their own time stamps: it "
            f"looks like the table of another video; if it is right, call it {video.stem}.{FRAME_TIMES}, "
            "else move it away",
            table,
        )


def settled_stamps(stamps_s: FloatArray | None, rate_hz: float | None) -> FloatArray | None:
    """Return the time stamps of a video, as number / rate where they are no more than rounded values of it.

    Args:
        stamps_s: (F,) as the file has them, or None.
        rate_hz: that the file declares, or None.
    """
    if stamps_s is None:
        return None
    if rate_hz is not None and 0.0 < rate_hz < float("inf"):
        steady = np.arange(len(stamps_s)) / rate_hz
        if np.abs(stamps_s - stamps_s[0] - steady).max(initial=0.0) <= STAMP_RESOLUTION_S:
            return np.asarray(steady + (stamps_s[0] if stamps_s[0] > STAMP_RESOLUTION_S else 0.0))
    return stamps_s


def _read_list(file: Path) -> FloatArray:
    text = file.read_text(encoding="utf-8", errors="replace")
    lines = [
        (number, line.strip())
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise DataError("holds no times", file)
    times = np.array([_number(line, file, number) for number, line in lines])
    _check_ascending(times, file, [number for number, _ in lines])
    if _V2.match(text):
        return in_seconds(times, "ms")
    if any(character in ".eE" for _, line in lines for character in line):
        return times
    unit = unit_of_whole(times)
    if unit is None:
        raise DataError("one time a line, but in s, ms, us or ns? Write seconds, with a decimal point", file)
    return in_seconds(times, unit)


def _number(text: str, file: Path, line: int) -> float:
    try:
        value = float(text)
    except ValueError:
        raise DataError(f"{text!r} is no time", file, line) from None
    if not np.isfinite(value):
        raise DataError(f"{text!r} is no time", file, line)
    return value


def _check_ascending(times: FloatArray, file: Path, lines: Sequence[int]) -> None:
    bad = np.diff(times) <= 0
    if bad.any():
        raise DataError("times must ascend", file, lines[1 + int(np.argmax(bad))])


def _are_times(whole: FloatArray, unit: str) -> bool:
    """Whether names that are whole numbers are no numbers of frames."""
    if whole[0] >= _EPOCH_S * TIME_UNITS[unit]:
        return True
    return float(np.median(np.diff(np.sort(whole)))) >= _LEAST_STEP


def _ordered(times: FloatArray, origin: str) -> NamedTimes | None:
    order = np.argsort(times, kind="stable")
    ascending = times[order]
    if (np.diff(ascending) <= 0).any():
        return None
    return NamedTimes(ascending, order, origin)
