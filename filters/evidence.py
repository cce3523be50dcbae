"""What is counted of a track by every sensor: the sufficient statistics of its posterior.

Hits and misses count in correlation times, since a detector's errors last: two scans closer together are one
witness. Scores are kept as a decaying peak and as a mean, and count once a track (`object_probability`). N
tracks, S sensors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple, Self

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.filters.array_table import ArrayTable
from jeat_graph.filters.model_constants import ModelConstants


class ScanClock(NamedTuple):
    """Of one scan: its time (s), the sensor's period (s), and the weight of a scan in correlation times."""

    t: float
    period_s: float
    weight: float


@dataclass(frozen=True, eq=False)
class Evidence(ArrayTable):
    """Sufficient statistics of tracks, for their posterior.

    Attributes:
        hits, misses: (N, S) in correlation times.
        stationary_hits, stationary_misses: (N, S) those of them while the track stood.
        found: (N, S) whether the sensor has ever found it.
        recent, recent_weight: (N, S) sum of logits over a few scans, and its weight.
        peak: (N, S) decaying peak of the logits.
        total, total_weight: (N, S) sum of logits over a few seconds, and its weight.
        overlap: (N,) least IoU ever with a better track.
        gained: (N,) log likelihood that later detections gained against noise.
        detections: (N,) number of detections.
        owner: (N,) index of the sensor that found it first.
        born_s, last_s: (N,) times of the first and the last detection (s).
        confirmed_s: (N,) time of the last detection that tells that it is still there (s).
        missed: (N,) detections that were to be expected since then.
    """

    PER_SENSOR: ClassVar[frozenset[str]] = frozenset(
        (
            *("hits", "misses", "stationary_hits", "stationary_misses", "found"),
            *("recent", "recent_weight", "peak", "total", "total_weight"),
        )
    )

    hits: FloatArray
    misses: FloatArray
    stationary_hits: FloatArray
    stationary_misses: FloatArray
    found: BoolArray
    recent: FloatArray
    recent_weight: FloatArray
    peak: FloatArray
    total: FloatArray
    total_weight: FloatArray
    overlap: FloatArray
    gained: FloatArray
    detections: FloatArray
    owner: IntArray
    born_s: FloatArray
    last_s: FloatArray
    confirmed_s: FloatArray
    missed: FloatArray

    def __len__(self) -> int:
        return len(self.owner)

    @classmethod
    def none(cls, sensors: int) -> Self:
        """Return the evidence of no track."""
        per_sensor, one = np.zeros((0, sensors)), np.zeros(0)
        whole, truth = np.zeros(0, dtype=np.int64), np.zeros((0, sensors), dtype=np.bool_)
        logits = per_sensor, per_sensor, per_sensor, per_sensor, per_sensor
        counts = per_sensor, per_sensor, per_sensor, per_sensor
        return cls(*counts, truth, *logits, one, one, one, whole, one, one, one, one)

    @classmethod
    def of_births(
        cls, t: float, sensor: int, sensors: int, logits: FloatArray, overlap: FloatArray, weight: float
    ) -> Self:
        """Return the evidence of tracks that begin at detections: their scores, and no hit beyond.

        Args:
            t: time (s).
            sensor: index of the sensor.
            sensors: number of sensors.
            logits: (M,) of the scores.
            overlap: (M,) IoU with a better track or box.
            weight: of one detection, in correlation times.
        """
        number = len(logits)
        none = np.zeros((number, sensors))
        recent, recent_weight, peak, total, total_weight = (none.copy() for _ in range(5))
        found = np.zeros((number, sensors), dtype=np.bool_)
        found[:, sensor] = True
        recent[:, sensor] = total[:, sensor] = logits * weight
        recent_weight[:, sensor] = total_weight[:, sensor] = weight
        peak[:, sensor] = logits
        owner, time = np.full(number, sensor, dtype=np.int64), np.full(number, t)
        return cls(
            hits=none,
            misses=none,
            stationary_hits=none,
            stationary_misses=none,
            found=found,
            recent=recent,
            recent_weight=recent_weight,
            peak=peak,
            total=total,
            total_weight=total_weight,
            overlap=overlap,
            gained=np.zeros(number),
            detections=np.ones(number),
            owner=owner,
            born_s=time,
            last_s=time.copy(),
            confirmed_s=time.copy(),
            missed=np.zeros(number),
        )


class Hits(NamedTuple):
    """Tracks (K,) that a sensor found again in one scan.

    Attributes:
        rows: (K,) the tracks.
        logits: (K,) of the scores.
        gain: (K,) log likelihood of each detection against noise.
        stationary: (K,) which of the tracks stood.
        confirms: (K,) which detections tell that the track is still there.
    """

    rows: IntArray
    logits: FloatArray
    gain: FloatArray
    stationary: BoolArray
    confirms: BoolArray


def count_hits(evidence: Evidence, hits: Hits, sensor: int, clock: ScanClock, c: ModelConstants) -> Evidence:
    """Return the evidence after a sensor found some tracks again.

    Args:
        evidence: before.
        hits: what it found.
        sensor: index of the sensor.
        clock: of the sensor's scan.
        c: constants.
    """
    rows, logits, gain, stationary, confirms = hits
    new = evidence.copy()
    at = (rows, sensor)
    first = (new.hits[at] <= 0.0) & (new.owner[rows] != sensor)
    new.hits[at] += clock.weight
    new.stationary_hits[at] += clock.weight * stationary
    new.found[at] = True
    for total, weight, memory in (
        (new.recent, new.recent_weight, c.smoothing_s),
        (new.total, new.total_weight, c.mean_memory_s),
    ):
        keep = math.exp(-clock.period_s / memory)
        total[at] = total[at] * keep + logits * clock.weight
        weight[at] = weight[at] * keep + clock.weight
    weight = new.recent_weight[at]
    now = np.where(weight > 0.0, new.recent[at] / np.where(weight > 0.0, weight, 1.0), logits)
    fallen = new.peak[at] - clock.period_s / c.peak_decay_s * np.maximum(new.peak[at] - now, 0.0)
    new.peak[at] = np.where(first, now, np.maximum(fallen, now))
    new.gained[rows] += np.minimum(gain, c.most_gain)
    new.detections[rows] += 1.0
    new.last_s[rows] = clock.t
    new.confirmed_s[rows[confirms]], new.missed[rows[confirms]] = clock.t, 0.0
    return new


def expect_hits(
    evidence: Evidence, p_detect: FloatArray, sees: FloatArray, clock: ScanClock, c: ModelConstants
) -> Evidence:
    """Return the evidence as it is if a scan finds nothing: the detections that were to be expected add up.

    Args:
        evidence: before.
        p_detect: (N,) P_D of the sensor for each track.
        sees: (N,) probability that it is not blind to the track.
        clock: of the scan; scans closer together than `full_scan_s` are not one each.
        c: constants.
    """
    expected = p_detect * sees * min(1.0, clock.period_s / c.full_scan_s)
    return replace(evidence, missed=evidence.missed + expected)


def count_misses(
    evidence: Evidence, rows: IntArray, sensor: int, visible: FloatArray, stationary: BoolArray, weight: float
) -> Evidence:
    """Return the evidence after a sensor missed some tracks (K,).

    Args:
        evidence: before.
        rows: (K,) tracks that were missed.
        sensor: index of the sensor.
        visible: (K,) probability that they were visible.
        stationary: (K,) which of them stood.
        weight: of a scan, in correlation times.
    """
    misses, of_stationary = evidence.misses.copy(), evidence.stationary_misses.copy()
    misses[rows, sensor] += weight * visible
    of_stationary[rows, sensor] += weight * visible * stationary
    return replace(evidence, misses=misses, stationary_misses=of_stationary)
