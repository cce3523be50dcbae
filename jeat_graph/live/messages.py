"""Messages between a detector, the tracker and whoever wants the tracks: version 1, in two encodings.

A message of scans is `{"v": 1, "source": "gantry7", "seq": 41, "scans": [scan, …]}`, each scan as in a line
of `stream` (`io.streams.scan_lines`), all of one time; `source` and `seq`, a whole number that rises by
source, are what duplicates are known by. A scan, or a list of scans, alone is taken too. One of tracks is
`{"v": 1, "seq": 7, "source": …, "of": 41, "t": …, "tracks": […]}`, where `source` and `of` say which message
it answers. Both are JSON, or MessagePack of the same structure, which may hold boxes (M, 4) and scores (M,)
as bytes: 64-bit floats, the lowest byte first.
"""

from __future__ import annotations

import json
import math
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.extras import install
from jeat_graph.io.streams.scan_batch import ScanBatch
from jeat_graph.io.streams.scan_lines import batch_of
from jeat_graph.io.streams.stream_reading import StreamReading
from jeat_graph.live.memory import Memory, fingerprint

VERSION = 1
#: Of the name of a source; numbers of messages are below `MOST_SEQ`.
MOST_CHARACTERS, MOST_SEQ = 256, 1 << 63
_KEYS = ("v", "source", "seq", "scans")
# MessagePack has times of its own, which its package gives in seconds since 1970 when asked to.
_TIMESTAMP_S = 1
_FIRST_OF_TEXT = frozenset(bytes([c]) for c in b" \t\r\n{[\xef")
_ENCODER = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"))


class ScanMessage(NamedTuple):
    """Scans of one time and where they come from.

    Attributes:
        batch: the scans.
        source: who sent them, empty if the message does not say.
        seq: its number among the messages of that source, or None.
    """

    batch: ScanBatch
    source: str
    seq: int | None


def decode_scans(
    payload: bytes, name: str, number: int, how: StreamReading | None = None
) -> ScanMessage | None:
    """Read a message of scans, of either encoding; None where all are of a video that is not asked for.

    Args:
        payload: the message.
        name: where it came from, for messages.
        number: its number there, from 1.
        how: what the scans do not say themselves.

    Raises:
        DataError: what is wrong.
    """
    content = _load(payload, name, number)
    source, seq = "", None
    if isinstance(content, dict) and "scans" in content:
        strange = next((key for key in content if key not in _KEYS), None)
        if strange is not None:
            raise DataError(f"unknown key {strange!r}; a message has {', '.join(_KEYS)}", name, number)
        version = content.get("v")
        if version != VERSION:
            raise DataError(f"is a message of version {version!r}; known here: {VERSION}", name, number)
        source, seq = content.get("source", ""), content.get("seq")
        if not isinstance(source, str) or len(source) > MOST_CHARACTERS:
            what = f"a text of at most {MOST_CHARACTERS} characters"
            raise DataError(f"source must be {what}, got {str(source)[:40]!r}", name, number)
        if seq is not None and (isinstance(seq, bool) or not isinstance(seq, int) or not 0 <= seq < MOST_SEQ):
            what = "a whole number that is not negative, below 2^63"
            raise DataError(f"seq must be {what}, got {str(seq)[:40]}", name, number)
        content = content["scans"]
        if not isinstance(content, list):
            raise DataError("scans must be a list", name, number)
    batch = batch_of(content, name, number, how)
    return None if batch is None else ScanMessage(batch, source, seq)


def encode_tracks(line: str, seq: int, answered: ScanMessage | None, encoding: str = "json") -> bytes:
    """Make a message of tracks.

    Args:
        line: the tracks as a line of JSON (`io/streams/track_lines.json_line`).
        seq: number of this message among those that go out.
        answered: the message that it answers, if it does.
        encoding: `json` or `msgpack`.

    Raises:
        ConfigError: MessagePack is not installed.
    """
    head: dict[str, Any] = {"v": VERSION, "seq": seq}
    if answered is not None and answered.seq is not None:
        head |= {"source": answered.source, "of": answered.seq}
    if encoding == "json":
        text = _ENCODER.encode(head)
        return (text[:-1] + "," + line.strip()[1:]).encode()
    return bytes(msgpack_package().packb(head | json.loads(line)))


def _load(payload: bytes, name: str, number: int) -> Any:
    if payload[:1] in _FIRST_OF_TEXT:
        try:
            return json.loads(payload)
        except (ValueError, RecursionError) as error:
            what = error.msg if isinstance(error, json.JSONDecodeError) else str(error)
            raise DataError(f"is not JSON: {what}", name, number) from None
    try:
        package = msgpack_package()
    except ConfigError as error:  # what anybody sends must not end a service
        raise DataError(f"is not JSON, and {error}", name, number) from None
    try:
        content = package.unpackb(payload, strict_map_key=True, timestamp=_TIMESTAMP_S)
    except (ValueError, RecursionError) as error:
        raise DataError(f"is neither JSON nor MessagePack: {error}", name, number) from None
    scans = content.get("scans", [content]) if isinstance(content, dict) else content
    for scan in scans if isinstance(scans, list) else []:
        if isinstance(scan, dict):
            _unpack(scan, name, number)
    return content


def _unpack(scan: dict[Any, Any], name: str, number: int) -> None:
    """Turn bytes into arrays."""
    for key in ("boxes", "scores"):
        value = scan.get(key)
        if isinstance(value, bytes):
            if len(value) % (32 if key == "boxes" else 8):
                raise DataError(f"{key}: {len(value)} bytes are no whole number of rows", name, number)
            flat = np.frombuffer(value, dtype="<f8")
            scan[key] = flat.reshape(-1, 4) if key == "boxes" else flat


def msgpack_package() -> Any:
    """Return the package that reads and writes MessagePack.

    Raises:
        ConfigError: it is not installed.
    """
    try:
        import msgpack
    except ImportError:
        raise ConfigError(f"MessagePack needs a package more: {install('msgpack')}") from None
    return msgpack


class Numbering(NamedTuple):
    """What has come of a source since it began to count.

    Attributes:
        top: the greatest number.
        recent: which of the numbers below it have come, as far as they are kept.
        newest: time of its newest scan (s).
    """

    top: int
    recent: set[int]
    newest: float


class Duplicates:
    """Tells which messages have been taken already, in bounded memory, however many sources there are.

    Of each source the greatest number is kept, and which of the `WINDOW` numbers below it have come: one that
    is older counts as a duplicate. But a message that comes twice is as old as it was: where a number that
    was used up comes with a scan newer than any of its source, or with another time than it had, the source
    has begun to count from the start again, as a detector does that is started again, maybe with its clock
    set back. What came before stays known, for a broker may deliver it once more. Of more than `SOURCES`
    sources the one that has been silent for longest is forgotten.

    Attributes:
        seen: by source its counts, the last one or the last two; the time of a scan says whose a number is.
            The one heard last comes last.
        restarts: by source, how often it began to count from the start again.
        forgotten: how many sources have been forgotten.
    """

    WINDOW, SOURCES = 1024, 256

    def __init__(self) -> None:
        self.seen: dict[str, list[Numbering]] = {}
        self.restarts: dict[str, int] = {}
        self._memory = Memory()
        self.forgotten = 0

    def is_new(self, message: ScanMessage) -> bool:
        """Tell whether a message is new, and take note of it; one without a number always is."""
        seq, source, t = message.seq, message.source, message.batch.t
        if seq is None:
            return True
        of_message = fingerprint(source.encode("utf-8", "replace"), str(seq).encode(), repr(t).encode())
        came = self._memory.knows(of_message)
        self._memory.note(of_message)
        counts = self.seen.pop(source, None) or [Numbering(-1, set(), -math.inf)]
        self.seen[source] = counts
        self._forget()
        k = _whose(counts, t)
        of = counts[k]
        known = seq in of.recent or seq <= of.top - self.WINDOW
        restarted = t > of.newest and (known or (seq < of.top and seq < min(of.recent)))
        if came is not True and (restarted or (known and came is False)):
            self.restarts[source] = self.restarts.get(source, 0) + 1
            self.seen[source] = [of, Numbering(seq, {seq}, t)]
            return True
        if known or came:
            return False
        of.recent.add(seq)
        top, recent = max(of.top, seq), of.recent
        if len(recent) > 2 * self.WINDOW:
            recent = {seq for seq in recent if seq > top - self.WINDOW}
        counts[k] = Numbering(top, recent, max(of.newest, t))
        return True

    def _forget(self) -> None:
        """Forget the sources that have been silent for longest, if there are too many."""
        while len(self.seen) > self.SOURCES:
            source = next(iter(self.seen))
            del self.seen[source]
            self.restarts.pop(source, None)
            self.forgotten += 1

    def state(self) -> dict[str, Any]:
        """Return what `set_state` takes: plain data."""
        seen = {
            source: [(top, sorted(recent), newest) for top, recent, newest in counts]
            for source, counts in self.seen.items()
        }
        return {
            "seen": seen,
            "restarts": self.restarts,
            "forgotten": self.forgotten,
            "memory": self._memory.state(),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned."""
        self.seen = {
            source: [Numbering(top, set(recent), newest) for top, recent, newest in counts]
            for source, counts in state["seen"].items()
        }
        self.restarts, self.forgotten = dict(state["restarts"]), state["forgotten"]
        self._memory.set_state(state["memory"])


def _whose(counts: list[Numbering], t: float) -> int:
    """Return which of a source's counts a message of a time (s) belongs to."""
    if len(counts) == 1 or counts[1].newest > counts[0].newest:
        return 0 if t <= counts[0].newest else len(counts) - 1
    # Its clock was set back: the one whose newest scan is nearer.
    return 1 if abs(t - counts[1].newest) <= abs(t - counts[0].newest) else 0
