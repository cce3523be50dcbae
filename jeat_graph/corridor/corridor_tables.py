"""Tables of a corridor: who passed which cameras, travel times, origin and destination, who was left out."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.corridor.gap_model import within
from jeat_graph.corridor.handover import Handover, identities_of
from jeat_graph.corridor.passages import Passages
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.normal import Z95
from jeat_graph.io.tables.rounding import round_decimals
from jeat_graph.road.speeds import KMH

Columns = dict[str, npt.NDArray[Any]]
_DECIMALS = 3
#: A vehicle whose likeliest partner is at least this probable is left out for doubt, not for want of one.
_DOUBT = 0.1


@dataclass(frozen=True, eq=False)
class Corridor:
    """A solved corridor.

    Attributes:
        order: names of the cameras, as traffic passes them.
        cameras: passages by name.
        handovers: the gaps, in order.
        identities: (N,) identities of each camera's passages.
    """

    order: tuple[str, ...]
    cameras: Mapping[str, Passages]
    handovers: tuple[Handover, ...]
    identities: Mapping[str, IntArray]

    @classmethod
    def of(
        cls, order: Sequence[str], cameras: Mapping[str, Passages], handovers: Sequence[Handover]
    ) -> Corridor:
        """Put solved gaps together."""
        return cls(tuple(order), cameras, tuple(handovers), identities_of(order, handovers, cameras))

    def clock_s(self, name: str) -> float:
        """How far a camera's clock is ahead of the first one's (s)."""
        place = self.order.index(name)
        return sum(over.fitted.parameters.offset_s for over in self.handovers[:place])


def identity_columns(corridor: Corridor) -> Columns:
    """Rows of `identities.csv`: one a vehicle and camera, with the probability of the step that led there."""
    parts: dict[str, list[Any]] = {
        k: [] for k in ("identity", "camera", "track_id", "t", "t_common", "probability")
    }
    for place, name in enumerate(corridor.order):
        passages = corridor.cameras[name]
        probability = np.full(len(passages), np.nan)
        if place:
            over = corridor.handovers[place - 1]
            probability[over.second] = over.probability
        parts["identity"].append(corridor.identities[name])
        parts["camera"].append(np.full(len(passages), name))
        parts["track_id"].append(passages.track_id)
        parts["t"].append(round_decimals(passages.t, 4))
        parts["t_common"].append(round_decimals(passages.t - corridor.clock_s(name), 4))
        parts["probability"].append(round_decimals(probability, 4))
    columns = {name: np.concatenate(values) for name, values in parts.items()}
    rows = np.lexsort((columns["t_common"], columns["identity"]))
    return {name: values[rows] for name, values in columns.items()}


def passage_columns(corridor: Corridor) -> Columns:
    """Rows of `passages.csv`: one a vehicle and gap, by the time at the first camera."""
    parts: dict[str, list[Any]] = {}
    for over in corridor.handovers:
        a, b = over.fitted.gap.before, over.fitted.gap.after
        i, j, p = over.first, over.second, over.fitted.parameters
        shift = corridor.clock_s(a.camera)
        travel = b.t[j] - a.t[i] - p.offset_s
        own = np.sqrt(a.sigma_t[i] ** 2 + b.sigma_t[j] ** 2 + over.fitted.covariance[0, 0])
        rows = {
            "identity": corridor.identities[a.camera][i],
            "from": np.full(len(i), a.camera),
            "to": np.full(len(i), b.camera),
            "from_track_id": a.track_id[i],
            "to_track_id": b.track_id[j],
            "t_from": round_decimals(a.t[i] - shift, 4),
            "t_to": round_decimals(b.t[j] - shift - p.offset_s, 4),
            "travel_time_s": round_decimals(travel, _DECIMALS),
            "low_s": round_decimals(travel - Z95 * own, _DECIMALS),
            "high_s": round_decimals(travel + Z95 * own, _DECIMALS),
            "speed_kmh": round_decimals(KMH * p.distance_m / travel, _DECIMALS),
            "from_lane": _names(a.lanes, a.lane[i]),
            "to_lane": _names(b.lanes, b.lane[j]),
            "class": _kinds(over),
            "probability": round_decimals(over.probability, 4),
        }
        for name, values in rows.items():
            parts.setdefault(name, []).append(values)
    return {name: np.concatenate(values) for name, values in parts.items()}


def travel_time_columns(corridor: Corridor, interval_s: float, begin_s: float = 0.0) -> Columns:
    """Rows of `travel_times.csv`: by gap, interval of the time at its first camera, and class (`all`: any).

    The interval of the mean counts that not all vehicles were followed, doubt about who is who, and the
    clocks' offset, which is one for all.

    Args:
        corridor: solved.
        interval_s: length of the intervals, which begin at multiples of it.
        begin_s: is added to all times (s).
    """
    records: list[tuple[Any, ...]] = []
    for over in corridor.handovers:
        a, b = over.fitted.gap.before, over.fitted.gap.after
        start = a.t - corridor.clock_s(a.camera) + begin_s
        travel = b.t[over.second] - a.t[over.first] - over.fitted.parameters.offset_s
        expected = np.bincount(over.fitted.pairs.i, over.fitted.marginals.pair, len(a))
        kinds = _names(a.kinds, a.kind)
        slot = np.floor(start / interval_s).astype(np.int64)
        for k in range(int(slot.min()), int(slot.max()) + 1):
            for kind in ("all", *a.kinds):
                here = (slot == k) & ((kinds == kind) | (kind == "all"))
                mine = here[over.first]
                if kind != "all" and not here.any():
                    continue
                numbers = mean_travel_time(
                    travel[mine],
                    over.probability[mine],
                    float(expected[here].sum()),
                    over.fitted.covariance[0, 0],
                )
                records.append(
                    (
                        a.camera,
                        b.camera,
                        k * interval_s,
                        (k + 1) * interval_s,
                        kind,
                        int(mine.sum()),
                        *numbers,
                    )
                )
    names = (
        "from",
        "to",
        "begin",
        "end",
        "class",
        "vehicles",
        "expected",
        "mean_s",
        "low_s",
        "high_s",
        "median_s",
    )
    columns = {name: np.array([row[k] for row in records]) for k, name in enumerate(names)}
    for name in names[6:]:
        columns[name] = round_decimals(columns[name].astype(np.float64), _DECIMALS)
    return columns


def mean_travel_time(
    travel: FloatArray, probability: FloatArray, expected: float, clock_variance: float
) -> tuple[float, float, float, float, float]:
    """Return the expected number of vehicles, their mean travel time with its 95 % interval, the median.

    Args:
        travel: (P,) of those that were followed.
        probability: (P,) that each is the same vehicle at both cameras.
        expected: how many vehicles went from one camera to the other.
        clock_variance: of the clocks' offset (s²).
    """
    if len(travel) == 0:
        return (expected, math.nan, math.nan, math.nan, math.nan)
    weight = float(probability.sum())
    mean = float((probability * travel).sum()) / weight
    spread = float(travel.var(ddof=1)) if len(travel) > 1 else (0.2 * mean) ** 2
    unseen = max(1.0 - weight / max(expected, weight), 0.0)
    doubt = float((probability * (1.0 - probability)).sum()) / weight
    sd = math.sqrt(spread / len(travel) * (unseen + 2.0 * doubt) + clock_variance)
    return (expected, mean, mean - Z95 * sd, mean + Z95 * sd, float(np.median(travel)))


def od_columns(corridor: Corridor, interval_s: float, begin_s: float = 0.0) -> Columns:
    """Rows of `od.csv`: vehicles by the first and the last camera that they passed, and when at the first.

    `vehicles` counts identities. `expected` is the mean over all ways in which the passages may belong
    together: what comes from nowhere at a camera is passed on from camera to camera by the probabilities of
    all pairs, until it goes nowhere. `low` and `high` are its 95 % interval, that of independent events.
    Vehicles of one camera alone came from or went to a ramp, or were missed elsewhere.
    """
    slots = {
        name: np.floor((corridor.cameras[name].t - corridor.clock_s(name) + begin_s) / interval_s).astype(
            np.int64
        )
        for name in corridor.order
    }
    counted = _counted(corridor, slots)
    records: list[tuple[Any, ...]] = []
    for slot in sorted({int(k) for own in slots.values() for k in np.unique(own)}):
        for first, name in enumerate(corridor.order):
            for last, events in _ends(corridor, first, slots[name] == slot):
                mean, variance = float(events.sum()), float((events * (1.0 - events)).sum())
                half = Z95 * math.sqrt(variance)
                key = (slot, name, corridor.order[last])
                if mean > 0.5 or key in counted:
                    span = (slot * interval_s, (slot + 1) * interval_s)
                    numbers = (counted.get(key, 0), mean, max(mean - half, 0.0), mean + half)
                    records.append((*span, name, key[2], *numbers))
    names = ("begin", "end", "from", "to", "vehicles", "expected", "low", "high")
    columns = {name: np.array([row[k] for row in records]) for k, name in enumerate(names)}
    for name in names[5:]:
        columns[name] = round_decimals(columns[name].astype(np.float64), 2)
    return columns


def _ends(corridor: Corridor, first: int, begun: BoolArray) -> Iterator[tuple[int, FloatArray]]:
    """Yield each camera from the first on, with the probability of each passage there that one of those ends.

    Args:
        corridor: solved.
        first: place of the camera at which they begin.
        begun: (N,) which passages there are asked for.
    """
    weight = begun.astype(np.float64)
    if first:
        weight *= np.minimum(corridor.handovers[first - 1].fitted.marginals.column_alone, 1.0)
    for last in range(first, len(corridor.order)):
        if last == len(corridor.order) - 1:
            yield last, np.minimum(weight, 1.0)
            return
        fitted = corridor.handovers[last].fitted
        yield last, np.minimum(weight * fitted.marginals.row_alone, 1.0)
        passed_on = weight[fitted.pairs.i] * fitted.marginals.pair
        weight = np.bincount(fitted.pairs.j, passed_on, len(fitted.gap.after)).astype(np.float64)


def _counted(corridor: Corridor, slots: Mapping[str, IntArray]) -> dict[tuple[int, str, str], int]:
    """Identities by interval at their first camera, first and last camera."""
    origin: dict[int, tuple[int, str, str]] = {}
    for name in corridor.order:
        for identity, slot in zip(corridor.identities[name].tolist(), slots[name].tolist(), strict=True):
            begun, first, _ = origin.get(identity, (slot, name, name))
            origin[identity] = (begun, first, name)
    return dict(Counter(origin.values()))


def left_out_columns(corridor: Corridor) -> Columns:
    """Rows of `left_out.csv`: passages that no gap hands over though one might, each with the reason."""
    rows: list[tuple[str, int, float, str]] = []
    for name in corridor.order:
        rows += [(name, k, math.nan, reason) for k, reason in corridor.cameras[name].left_out]
    for over in corridor.handovers:
        fitted = over.fitted
        a, b = fitted.gap.before, fitted.gap.after
        reaches = within(fitted.gap, fitted.parameters, fitted.slowness)
        for passages, used, own, alone, other, reach in (
            (a, over.first, fitted.pairs.i, fitted.marginals.row_alone, b.camera, reaches),
            (b, over.second, fitted.pairs.j, fitted.marginals.column_alone, a.camera, np.ones(len(b))),
        ):
            best = np.zeros(len(passages))
            np.maximum.at(best, own, fitted.marginals.pair)
            for k in np.setdiff1d(np.arange(len(passages)), used):
                rows.append(
                    (passages.camera, int(passages.track_id[k]), float(passages.t[k]),
                     _reason(other, float(best[k]), float(alone[k]), float(reach[k])))
                )  # fmt: skip
    return {
        "camera": np.array([row[0] for row in rows], dtype=np.str_),
        "track_id": np.array([row[1] for row in rows], dtype=np.int64),
        "t": round_decimals(np.array([row[2] for row in rows], dtype=np.float64), 4),
        "reason": np.array([row[3] for row in rows], dtype=np.str_),
    }


def _reason(other: str, best: float, alone: float, reach: float) -> str:
    if reach < 0.5:
        return f"would pass {other} when {other} was not recorded"
    if best < _DOUBT:
        return f"no vehicle at {other} fits it: it came or went between, or {other} missed it"
    return f"who it is at {other} is in doubt: the likeliest vehicle has {best:.2f}, none {alone:.2f}"


def _kinds(over: Handover) -> npt.NDArray[np.str_]:
    """The class at the first camera, or where it is unknown at the second."""
    a, b = over.fitted.gap.before, over.fitted.gap.after
    first, second = _names(a.kinds, a.kind[over.first]), _names(b.kinds, b.kind[over.second])
    return np.where(first == "", second, first)


def _names(names: Sequence[str], code: IntArray) -> npt.NDArray[np.str_]:
    return np.array([*names, ""], dtype=np.str_)[code]
