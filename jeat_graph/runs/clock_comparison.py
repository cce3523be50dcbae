"""How the clocks of two sensors lie to each other, whose boxes are in one picture, and how sure that is."""

from __future__ import annotations

from collections.abc import Generator
from typing import NamedTuple

import numpy as np

from jeat_graph.data.detections import Detections
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.data.time_text import exact_text
from jeat_graph.rig.agreement import Agreement, agreement_in_steps
from jeat_graph.rig.registering import clock_by_map_in_steps
from jeat_graph.rig.sensor_tracks import SensorTracks
from jeat_graph.runs.own_tracks import own_tracks_in_steps

# Boxes must agree better than as the times are by this much, and this many times as much as usual.
_BETTER, _CLEAR, _LEAST_USUAL = 0.08, 2.5, 0.05
# So many vehicles must agree, and the offset be so many standard deviations, for it to be taken off.
_LEAST_VEHICLES, _SIGNIFICANT = 5, 4.0
#: Smaller offsets move no box by more than its noise (s).
LEAST_S = 0.02
# So many pairs of boxes are compared in one step where somebody waits for it (a millisecond or less).
_PAIRS_A_STEP = 25_000
#: That much of a recording is looked at for the exact offset (s): a tracker needs a few seconds for it.
COMPARED_S = 90.0
# Sensors contradict each other where each sees so many vehicles drive, most of them where the other one sees
# some, and their boxes agree at no difference of the clocks.
_MANY, _SAME_PLACES, _NEVER = 10, 0.6, 0.08
# Places are distinguished by so many columns and rows.
_PLACES = 24


class FoundClock(NamedTuple):
    """What was found of one sensor's clock: seconds ahead, standard deviation, whether it is taken off."""

    lag_s: float
    std_s: float
    sure: bool


class ClockComparison(NamedTuple):
    """What two sensors say of each other.

    Attributes:
        agree: whether their boxes agree clearly as the times are.
        differ: by how much the second's clock is ahead, where boxes agree clearly better at another
            difference; None where they do not.
        contradiction: why they cannot be of one picture and one recording, or empty.
    """

    agree: bool
    differ: FoundClock | None
    contradiction: str


def compare_in_steps(
    first: Detections,
    second: Detections,
    pair: tuple[str, str],
    latest_s: float | None = None,
    *,
    exactly: bool = False,
) -> Generator[None, None, ClockComparison]:
    """Compare the clocks of two sensors, a little each step.

    Args:
        first: of the sensor whose clock is taken for right.
        second: of the other.
        pair: names of both.
        latest_s: only the latest so much is tracked for the exact offset (s), and steps are kept short; by
            default the first `COMPARED_S` is.
        exactly: whether boxes that agree as the times are may show a small difference all the same: where the
            clocks were right before, and one may have drifted.
    """
    pairs = None if latest_s is None else _PAIRS_A_STEP
    agreed = yield from agreement_in_steps(first, second, pairs)
    if agreed is None:
        return ClockComparison(False, None, "")
    if _differ(agreed):
        found = yield from _exactly(first, second, agreed.offset_s, latest_s)
        return ClockComparison(False, found, "")
    if exactly and _agree(agreed):
        found = yield from _exactly(first, second, 0.0, latest_s)
        if found.sure:
            return ClockComparison(False, found, "")
    contradiction = yield from _contradiction(first, second, agreed, pair, latest_s)
    return ClockComparison(_agree(agreed), None, contradiction)


def _differ(agreed: Agreement) -> bool:
    """Whether boxes agree clearly better at another difference of the clocks than as the times are."""
    return (
        abs(agreed.offset_s) >= LEAST_S
        and agreed.best - agreed.at_zero > _BETTER
        and agreed.best > _CLEAR * agreed.usual
    )


def _agree(agreed: Agreement) -> bool:
    """Whether boxes agree clearly as the times are; what stands still does so at all differences."""
    return agreed.at_zero > _CLEAR * max(agreed.usual, _LEAST_USUAL)


def _exactly(
    first: Detections, second: Detections, offset_s: float, latest_s: float | None
) -> Generator[None, None, FoundClock]:
    """Find the offset, known roughly, to the millisecond by the motion of vehicles that both saw."""
    # Both are tracked for as long as both have scans, but no longer than is needed.
    begin = max(first.scan_t[0], second.scan_t[0] - offset_s)
    end = min(first.scan_t[-1], second.scan_t[-1] - offset_s)
    if latest_s is None:
        end = min(end, begin + COMPARED_S)
    else:
        begin = max(begin, end - latest_s)
    ours = yield from own_tracks_in_steps(_between(first, begin, end))
    theirs = yield from own_tracks_in_steps(_between(second, begin + offset_s, end + offset_s))
    same = PictureMap(np.eye(3, 4))
    clock = yield from clock_by_map_in_steps(ours, theirs, same, [offset_s], _LEAST_VEHICLES)
    if clock is None:
        return FoundClock(offset_s, float("inf"), False)
    sure = abs(clock.offset_s) > max(LEAST_S, _SIGNIFICANT * clock.offset_std_s)
    return FoundClock(clock.offset_s, clock.offset_std_s, sure)


def _between(detections: Detections, begin: float, end: float) -> Detections:
    first, last = np.searchsorted(detections.scan_t, [begin, end], side="left")
    return Detections.from_scans(detections.scan(k) for k in range(int(first), int(last)))


def _contradiction(
    first: Detections, second: Detections, agreed: Agreement, pair: tuple[str, str], latest_s: float | None
) -> Generator[None, None, str]:
    """Say so where sensors see traffic in the same places and never the same vehicles."""
    if agreed.best >= _NEVER or not _same_places(first, second):
        return ""
    moving = []
    for one in (first, second):
        begin = float(one.scan_t[0] if latest_s is None else one.scan_t[-1] - latest_s)
        tracks: SensorTracks = yield from own_tracks_in_steps(_between(one, begin, begin + COMPARED_S))
        moving.append(int(tracks.moves.sum()))
    if min(moving) < _MANY:
        return ""
    return (
        f"sensors {pair[0]!r} and {pair[1]!r} see vehicles in the same part of the picture, but never the "
        f"same ones, by whatever their clocks differ (at best {100 * agreed.best:.0f} % of the boxes agree): "
        "are both of one picture and one recording? `jeat-graph register` brings sensors together that have "
        "pictures of their own; leave one out, or track them as they are with --set input.clocks=as_given"
    )


def _same_places(first: Detections, second: Detections) -> bool:
    """Whether most boxes of each sensor lie where the other one has some at any time."""
    both = [one.boxes[:, :2] + 0.5 * one.boxes[:, 2:] for one in (first, second)]
    low = np.minimum(*(one.min(axis=0) for one in both))
    high = np.maximum(*(one.max(axis=0) for one in both))
    cells = [
        np.clip((one - low) / np.maximum(high - low, 1e-9) * _PLACES, 0, _PLACES - 1).astype(int)
        @ [_PLACES, 1]
        for one in both
    ]
    shares = [float(np.isin(a, b).mean()) for a, b in (cells, cells[::-1])]
    return min(shares) > _SAME_PLACES


def summary_of(name: str, lag_s: float, std_s: float) -> str:
    """Say what is taken off a sensor's times."""
    return (
        f"sensor {name!r}: its times are {lag_s:.4f} s late beside those of the others "
        f"(± {1e3 * std_s:.1f} ms), which is taken off (--set input.clocks=as_given leaves them)"
    )


def unsure_of(name: str, reference: str, found: FoundClock) -> str:
    """Say of a difference that too few vehicles show how it could be taken off."""
    late = f"{abs(found.lag_s):.4f} s {'late' if found.lag_s > 0 else 'early'} beside those of {reference!r}"
    setting = f"--set sensors.{name}.latency_s={exact_text(round(found.lag_s, 4))}"
    return (
        f"sensor {name!r}: its boxes agree best if its times are {late}, but too few vehicles say so: they "
        f"are left as they are; {setting} takes it off"
    )


def taken_off_each(names: list[str], ahead: dict[str, FoundClock]) -> dict[str, FoundClock]:
    """Say what is to be taken off each sensor's times so that all have the earliest clock.

    A detector gives its boxes late rather than early. A sensor that was not found to differ has the
    reference's clock.

    Args:
        names: of all sensors.
        ahead: by sensor that is sure to differ, how far it is ahead of the reference.
    """
    earliest = min(0.0, *(one.lag_s for one in ahead.values()))
    widest = max(found.std_s for found in ahead.values())
    taken = {}
    for name in names:
        one = ahead.get(name, FoundClock(0.0, widest, True))
        if one.lag_s > earliest:
            taken[name] = FoundClock(round(one.lag_s - earliest, 6), round(one.std_s, 6), True)
    return taken
