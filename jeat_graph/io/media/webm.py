"""WebM films whose bytes follow from their pictures alone."""

from __future__ import annotations

import re
from pathlib import Path

# Number of the track, random in what FFmpeg writes: element TrackUID (0x73C5, or 0x63C5 where a tag refers to
# it) of eight bytes. It stands before the first picture.
_TRACK_UID = re.compile(rb"([\x73\x63]\xc5\x88).{8}", re.DOTALL)
_HEAD_BYTES = 4096


def settle_webm(path: Path) -> None:
    """Give the track of a WebM film the number 1 instead of a random one, in place."""
    with path.open("r+b") as file:
        head = file.read(_HEAD_BYTES)
        settled = _TRACK_UID.sub(lambda found: found[1] + (1).to_bytes(8, "big"), head, count=2)
        file.seek(0)
        file.write(settled)
