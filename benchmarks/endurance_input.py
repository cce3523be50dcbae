"""Traffic without end for the endurance test: made one second at a time, from any second on.

Vehicles drive in circles that never end, so that there are as many in the last hour as in the first; both
sensors see them with noise, misses and false boxes, and their scans arrive late and out of order. Each second
has random numbers of its own: whoever goes on in the middle meets what one who began at the beginning meets.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Scan
from jeat_graph.io.streams.scan_batch import ScanBatch
from jeat_graph.live.messages import ScanMessage

RATES_HZ = {"evt": 100.0, "rgb": 20.0}
DELAY_S = {"evt": 0.005, "rgb": 0.08}
#: Further delay of each scan, at random up to so much (s).
JITTER_S = 0.02
_SIDE_PX, _NOISE_PX, _MISSED, _FALSE = 30.0, 0.7, 0.1, 0.3
#: Numbers set aside for the messages of one second.
_NUMBERS = 1000
_SOURCE = "endurance"


def messages(last: int, vehicles: int, seed: int, first: int = 0) -> Iterator[ScanMessage]:
    """Yield the scans of both sensors in order of arrival, numbered.

    Args:
        last: the second at which the input ends.
        vehicles: how many are in the picture.
        seed: of the input.
        first: the second to begin with; the numbers are those of the whole input.
    """
    for second in range(first, last):
        for k, scan in enumerate(arriving(second, vehicles, seed)):
            yield ScanMessage(ScanBatch([scan], [0]), _SOURCE, _NUMBERS * second + k)


def arriving(second: int, vehicles: int, seed: int) -> list[Scan]:
    """Return the scans that arrive in one second of the input, in the order in which they do."""
    made = [item for of in (second - 1, second) if of >= 0 for item in _made_in(of, vehicles, seed)]
    here = [item for item in made if second < item[0] <= second + 1.0]
    return [scan for _, scan in sorted(here, key=lambda item: item[0])]


@lru_cache(maxsize=1)  # what arrives in a second was made in it or in the one before
def _made_in(second: int, vehicles: int, seed: int) -> list[tuple[float, Scan]]:
    """The scans of one second's pictures and events, and when each arrives (s)."""
    whole, rng = np.random.default_rng(seed), np.random.default_rng((seed, second))
    centre = whole.uniform((200.0, 150.0), (1080.0, 570.0), (vehicles, 2))
    radius, speed = whole.uniform(20.0, 120.0, vehicles), whole.uniform(0.2, 0.6, vehicles)
    phase = whole.uniform(0.0, 2.0 * np.pi, vehicles)
    out = []
    for sensor, rate in RATES_HZ.items():
        for t in second + (np.arange(int(rate)) + 0.3) / rate:
            angle = phase + speed * t
            here = centre + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
            when = t + DELAY_S[sensor] + rng.uniform(0.0, JITTER_S)
            out.append((float(when), _scan(float(t), sensor, here, rng)))
    return out


def _scan(t: float, sensor: str, centre: FloatArray, rng: np.random.Generator) -> Scan:
    seen = centre[rng.random(len(centre)) > _MISSED]
    false = rng.uniform((0.0, 0.0), (1280.0, 720.0), (rng.poisson(_FALSE), 2))
    boxes = np.full((len(seen) + len(false), 4), _SIDE_PX)
    boxes[:, :2] = np.concatenate([seen + rng.normal(0.0, _NOISE_PX, seen.shape), false]) - 0.5 * _SIDE_PX
    score = np.concatenate([rng.uniform(0.6, 0.95, len(seen)), rng.uniform(0.1, 0.4, len(false))])
    return Scan(t, sensor, boxes, score)
