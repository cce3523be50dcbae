"""The header of Prophesee's `.raw` and `.dat` files: lines that begin with `%`, each a key and a value."""

from __future__ import annotations

import re
from pathlib import Path
from typing import BinaryIO, NamedTuple

from jeat_graph.data.errors import DataError

#: The key of a line that says time 0 on the clock of the recording (µs), as `t_offset` of HDF5 does: ours;
#: other programs pass it over.
ORIGIN = "t_offset"
_MOST_LINES = 10_000
_MOST_LINE_BYTES = 1 << 12
_MOST_PX = 1 << 14
#: Pictures of cameras by the generation of their sensor, where the header has no size.
_GENERATIONS = {
    "3.0": (640, 480),
    "3.1": (640, 480),
    "4.0": (1280, 720),
    "4.1": (1280, 720),
    "4.2": (1280, 720),
}
_VERSIONS = {"2.0": "EVT2", "2.1": "EVT21", "3.0": "EVT3"}


class RawHeader(NamedTuple):
    """What a header says.

    Attributes:
        encoding: `EVT2`, `EVT21`, `EVT3` or another name; None if it does not say.
        size_px: width and height of the picture, or None.
        options: further `key=value` pairs of the line `format`, such as `endianness`.
        keys: all lines, the last of each key, keys in lower case.
        text: the header.
    """

    encoding: str | None
    size_px: tuple[int, int] | None
    options: dict[str, str]
    keys: dict[str, str]
    text: str


def read_raw_header(file: BinaryIO, path: Path) -> RawHeader:
    """Read the header; the file then stands at the first byte behind it.

    A header ends with `% end`, or before the first line that does not begin with `% `.

    Raises:
        DataError: a size that is none, or a file that ends in a line of its header.
    """
    lines: list[str] = []
    while len(lines) < _MOST_LINES:
        at = file.tell()
        line = file.readline(_MOST_LINE_BYTES)
        if _is_cut(line):
            raise DataError("ends in its header: the file is cut off", path)
        if not line.startswith(b"%") or not line.endswith(b"\n") or not _is_text(line):
            file.seek(at)
            break
        lines.append(line.decode("latin-1").strip())
        if lines[-1].lower() == "% end":
            break
    keys: dict[str, str] = {}
    for line_text in lines:
        words = line_text.lstrip("% ").split(maxsplit=1)
        if words:
            keys[words[0].lower().rstrip(":")] = words[1] if len(words) > 1 else ""
    encoding, options = _encoding(keys)
    return RawHeader(encoding, _size(keys, options, path), options, keys, "\n".join(lines))


def origin_of(header: RawHeader, path: Path) -> int:
    """Return time 0 on the clock of the recording (µs), 0 where the header does not say.

    Raises:
        DataError: it says something that is no whole number.
    """
    text = header.keys.get(ORIGIN, "0").strip()
    if not re.fullmatch(r"-?\d{1,18}", text):
        raise DataError(
            f"its header says {ORIGIN} {text[:40]!r}, which is no whole number of microseconds", path
        )
    return int(text)


def raw_header(version: str, origin_us: int, size_px: tuple[int, int]) -> bytes:
    """Return the header of a file of EVT `version`, 2.0 or 3.0.

    Args:
        version: of EVT.
        origin_us: time 0 on the clock of the recording (µs), which a line `% t_offset` keeps; 0: no line.
        size_px: width and height of the picture.
    """
    width, height = size_px
    name = _VERSIONS[version]
    lines = [f"evt {version}", f"format {name};height={height};width={width}", f"geometry {width}x{height}"]
    lines += [f"{ORIGIN} {origin_us}"] if origin_us else []
    return "".join(f"% {line}\n" for line in (*lines, "end")).encode("ascii")


def _is_cut(line: bytes) -> bool:
    """Whether the file ends in a line of the header: only its last line has no end."""
    whole = line.endswith(b"\n") or len(line) == _MOST_LINE_BYTES
    return line.startswith(b"%") and not whole and _is_text(line)


def _is_text(line: bytes) -> bool:
    """Whether a line may be of a header: events may begin with the byte of `%` too."""
    return all(byte >= 0x20 or byte in b"\t\r\n" for byte in line)


def _encoding(keys: dict[str, str]) -> tuple[str | None, dict[str, str]]:
    if "format" in keys:
        name, *rest = keys["format"].split(";")
        pairs = (part.split("=", 1) for part in rest if "=" in part)
        return name.strip().upper().replace(".", ""), {key.strip(): value.strip() for key, value in pairs}
    version = keys.get("evt", "").strip()
    return (_VERSIONS.get(version, f"EVT {version}") if version else None), {}


def _size(keys: dict[str, str], options: dict[str, str], path: Path) -> tuple[int, int] | None:
    if "width" in options and "height" in options:
        sides = (options["width"], options["height"])
    elif "geometry" in keys and re.fullmatch(r"\d+x\d+", keys["geometry"].strip()):
        width, height = keys["geometry"].strip().split("x")
        sides = (width, height)
    elif "width" in keys and "height" in keys:
        sides = (keys["width"], keys["height"])
    else:
        return _GENERATIONS.get(keys.get("generation", keys.get("sensor_generation", "")).strip())
    if not all(re.fullmatch(r"\s*\d{1,6}\s*", side) and 0 < int(side) <= _MOST_PX for side in sides):
        raise DataError(f"its header says a picture of {sides[0]} x {sides[1]} px", path)
    return int(sides[0]), int(sides[1])
