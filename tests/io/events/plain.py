"""Event formats written and read word by word in plain Python, from their public descriptions alone."""

from __future__ import annotations

import random
import struct
from dataclasses import dataclass, field

Event = tuple[int, int, int, int]  # t (µs), x, y, polarity
WIDTH, HEIGHT = 640, 480


@dataclass
class Decoded:
    events: list[Event] = field(default_factory=list)
    triggers: list[tuple[int, int, int]] = field(default_factory=list)


class Clock:
    """A counter of some bits that begins again."""

    def __init__(self, bits: int) -> None:
        self.full, self.value, self.turns = 1 << bits, None, 0

    def set(self, value: int) -> int:
        if self.value is not None and self.value > value and self.value - value > self.full // 2:
            self.turns += 1
        self.value = value
        return self.turns * self.full + value


def read_evt2(data: bytes) -> Decoded:
    out, clock, high = Decoded(), Clock(28), None
    for (word,) in struct.iter_unpack("<I", data):
        kind, low = word >> 28, (word >> 22) & 63
        if kind == 8:
            high = clock.set(word & 0x0FFFFFFF)
        elif high is None:
            continue
        elif kind in (0, 1):
            out.events.append((high * 64 + low, (word >> 11) & 2047, word & 2047, kind))
        elif kind == 10:
            out.triggers.append((high * 64 + low, (word >> 8) & 31, word & 1))
    return out


def read_evt21(data: bytes, swapped: bool = False) -> Decoded:
    out, clock, high = Decoded(), Clock(28), None
    for first, second in struct.iter_unpack("<II", data):
        top, valid = (first, second) if swapped else (second, first)
        kind, low = top >> 28, (top >> 22) & 63
        if kind == 8:
            high = clock.set(top & 0x0FFFFFFF)
        elif high is None:
            continue
        elif kind in (0, 1):
            x, y = (top >> 11) & 2047, top & 2047
            out.events += [(high * 64 + low, x + k, y, kind) for k in range(32) if valid >> k & 1]
        elif kind == 10:
            out.triggers.append((high * 64 + low, (top >> 8) & 31, top & 1))
    return out


def read_evt3(data: bytes) -> Decoded:
    out, clock = Decoded(), Clock(12)
    high = row = None
    low = base = polarity = 0
    for (word,) in struct.iter_unpack("<H", data):
        kind, rest = word >> 12, word & 0xFFF
        if kind == 8:
            if clock.value != rest:
                high, low = clock.set(rest), 0
        elif kind == 6:
            low = rest
        elif kind == 0:
            row = rest & 2047
        elif kind == 3:
            base, polarity = rest & 2047, rest >> 11
        elif kind in (4, 5):
            n = 12 if kind == 4 else 8
            if high is not None and row is not None:
                t = high * 4096 + low
                out.events += [(t, base + k, row, polarity) for k in range(n) if rest >> k & 1]
            base += n
        elif kind == 2 and high is not None and row is not None:
            out.events.append((high * 4096 + low, rest & 2047, row, rest >> 11))
        elif kind == 10 and high is not None:
            out.triggers.append((high * 4096 + low, rest >> 8, rest & 1))
    return out


def read_dat(data: bytes) -> Decoded:
    out, clock = Decoded(), Clock(32)
    for t, address in struct.iter_unpack("<II", data):
        out.events.append((clock.set(t), address & 16383, (address >> 14) & 16383, address >> 28))
    return out


def read_aedat2(data: bytes, size: tuple[int, int]) -> Decoded:
    out, clock = Decoded(), Clock(32)
    for address, t in struct.iter_unpack(">II", data):
        if size == (128, 128):
            x, y, p, edge = (address >> 1) & 127, (address >> 8) & 127, 1 - (address & 1), address >> 15 & 1
        elif address >> 31:
            continue
        else:
            x, y, p = (address >> 12) & 1023, (address >> 22) & 511, address >> 11 & 1
            edge = address >> 10 & 1
        time = clock.set(t)
        if edge:
            out.triggers.append((time, 0, p))
        else:
            out.events.append((time, size[0] - 1 - x, size[1] - 1 - y, p))
    return out


def random_evt2(rng: random.Random, n: int, start: int = 0) -> bytes:
    """Words as a camera sends them: times that ascend, edges of signals and words of others between."""
    words, high, low = [8 << 28 | start], start, 0
    for _ in range(n):
        if rng.random() < 0.2:
            high, low = high + 1, 0
            words.append(8 << 28 | (high & 0x0FFFFFFF))
        low = rng.randint(low, 63)
        draw = rng.random()
        if draw < 0.05:
            words.append(10 << 28 | low << 22 | rng.randrange(32) << 8 | rng.randrange(2))
        elif draw < 0.1:
            words.append(rng.choice((14, 15)) << 28 | rng.randrange(1 << 28))
        else:
            x, y = rng.randrange(WIDTH), rng.randrange(HEIGHT)
            words.append(rng.randrange(2) << 28 | low << 22 | x << 11 | y)
    return struct.pack(f"<{len(words)}I", *words)


def random_evt21(rng: random.Random, n: int, swapped: bool = False, start: int = 0) -> bytes:
    tops, high, low = [(8 << 28 | start, 0)], start, 0
    for _ in range(n):
        if rng.random() < 0.2:
            high, low = high + 1, 0
            tops.append((8 << 28 | (high & 0x0FFFFFFF), 0))
        low = rng.randint(low, 63)
        if rng.random() < 0.05:
            tops.append((10 << 28 | low << 22 | rng.randrange(32) << 8 | rng.randrange(2), 0))
        else:
            x, y = rng.randrange(WIDTH // 32) * 32, rng.randrange(HEIGHT)
            tops.append((rng.randrange(2) << 28 | low << 22 | x << 11 | y, rng.getrandbits(32)))
    halves = [half for top, bits in tops for half in ((top, bits) if swapped else (bits, top))]
    return struct.pack(f"<{len(halves)}I", *halves)


def random_evt3(rng: random.Random, n: int, start: int = 0) -> bytes:
    words, high, low = [8 << 12 | start, 6 << 12, rng.randrange(HEIGHT)], start, 0
    for _ in range(n):
        draw = rng.random()
        if draw < 0.03:
            high, low = high + 1, rng.randrange(100)
            words += [8 << 12 | (high & 4095), 6 << 12 | low]
        elif draw < 0.2 and low < 4000:
            low += rng.randrange(90)
            words.append(6 << 12 | min(low, 4095))
        elif draw < 0.4:
            words.append(rng.randrange(HEIGHT))
        elif draw < 0.5:
            words.append(3 << 12 | rng.randrange(2) << 11 | rng.randrange(WIDTH - 33))
            words += [
                4 << 12 | rng.getrandbits(12),
                4 << 12 | rng.getrandbits(12),
                5 << 12 | rng.getrandbits(8),
            ]
        elif draw < 0.53:
            words.append(10 << 12 | rng.randrange(16) << 8 | rng.randrange(2))
        elif draw < 0.56:
            words.append(rng.choice((7, 14, 15)) << 12 | rng.getrandbits(12))
        else:
            words.append(2 << 12 | rng.randrange(2) << 11 | rng.randrange(WIDTH))
    return struct.pack(f"<{len(words)}H", *words)


def random_dat(rng: random.Random, n: int, start: int = 0) -> bytes:
    t, out = start, []
    for _ in range(n):
        t += rng.randrange(50)
        address = rng.randrange(2) << 28 | rng.randrange(HEIGHT) << 14 | rng.randrange(WIDTH)
        out.append(struct.pack("<II", t & 0xFFFFFFFF, address))
    return b"".join(out)


def random_aedat2(rng: random.Random, n: int, size: tuple[int, int], start: int = 0) -> bytes:
    t, out = start, []
    for _ in range(n):
        t += rng.randrange(50)
        x, y, p = rng.randrange(size[0]), rng.randrange(size[1]), rng.randrange(2)
        edge = rng.random() < 0.05
        if size == (128, 128):
            address = edge << 15 | y << 8 | x << 1 | p
        else:
            address = y << 22 | x << 12 | p << 11 | edge << 10
            if rng.random() < 0.1:
                address |= 1 << 31  # a sample of a frame
        out.append(struct.pack(">II", address, t & 0xFFFFFFFF))
    return b"".join(out)


GEOMETRY = f"% geometry {WIDTH}x{HEIGHT}\n"
HEADERS = {
    "evt2": f"% evt 2.0\n{GEOMETRY}% end\n".encode(),
    "evt21": f"% format EVT21;height={HEIGHT};width={WIDTH};endianness=little\n% end\n".encode(),
    "evt21-legacy": f"% format EVT21;height={HEIGHT};width={WIDTH};endianness=legacy\n% end\n".encode(),
    "evt21-silent": f"% evt 2.1\n{GEOMETRY}% end\n".encode(),
    "evt3": f"% evt 3.0\n{GEOMETRY}% end\n".encode(),
    "dat": f"% Data file containing CD events.\n% Version 2\n% Height {HEIGHT}\n% Width {WIDTH}\n".encode()
    + b"\x0c\x08",
    "aedat2-davis": b"#!AER-DAT2.0\r\n# AEChip: eu.seebetter.ini.chips.davis.Davis346B\r\n",
    "aedat2-dvs": b"#!AER-DAT2.0\r\n# AEChip: ch.unizh.ini.jaer.chip.retina.DVS128\r\n",
}
RANDOM = {
    "evt2": random_evt2,
    "evt21": random_evt21,
    "evt21-legacy": lambda rng, n, start=0: random_evt21(rng, n, True, start),
    "evt21-silent": lambda rng, n, start=0: random_evt21(rng, n, True, start),
    "evt3": random_evt3,
    "dat": random_dat,
    "aedat2-davis": lambda rng, n, start=0: random_aedat2(rng, n, (346, 260), start),
    "aedat2-dvs": lambda rng, n, start=0: random_aedat2(rng, n, (128, 128), start),
}
READ = {
    "evt2": read_evt2,
    "evt21": read_evt21,
    "evt21-legacy": lambda data: read_evt21(data, True),
    "evt21-silent": lambda data: read_evt21(data, True),
    "evt3": read_evt3,
    "dat": read_dat,
    "aedat2-davis": lambda data: read_aedat2(data, (346, 260)),
    "aedat2-dvs": lambda data: read_aedat2(data, (128, 128)),
}
#: A start shortly before the clock of each format begins again, in the format's own unit.
LATE = {
    "evt2": (1 << 28) - 20,
    "evt21": (1 << 28) - 20,
    "evt21-legacy": (1 << 28) - 20,
    "evt21-silent": (1 << 28) - 20,
    "evt3": 4096 - 10,
    "dat": (1 << 32) - 2000,
    "aedat2-davis": (1 << 32) - 2000,
    "aedat2-dvs": (1 << 32) - 2000,
}
