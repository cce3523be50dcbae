"""Pictures and clocks of two sensors brought together by the traffic that both saw, or refused.

1. Each sensor's own tracks (`sensor_tracks`). 2. The clocks, roughly, by how vehicles grow (`clock_search`).
3. Which vehicle is which, by RANSAC over pairs of trajectories (`matching`). 4. Map, clock and all paths in
one factor graph (`refining`). 5. Does the traffic tell it? Where it does not, nothing is returned; cameras
that face each other are recognised (`passing`).
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import NamedTuple

import numpy as np

from jeat_graph.config.sensors import ClockConfig
from jeat_graph.data.errors import DataError
from jeat_graph.data.in_steps import run_through, worth
from jeat_graph.data.picture_map import LENSES, PictureMap
from jeat_graph.rig.between_vehicles import LensEvidence
from jeat_graph.rig.clock_search import offset_of, rank_offsets
from jeat_graph.rig.matching import MatchedTracks, match_again, match_at, no_tracks
from jeat_graph.rig.passing import facing_pattern
from jeat_graph.rig.refining import Refined, no_smaller, refine, with_lenses
from jeat_graph.rig.sensor_tracks import SensorTracks, joined

# Rough differences of the clocks that are tried; rounds of matching and fitting where the map is known.
_CANDIDATES, _ROUNDS = 4, 2
# What a round of matching is worth in steps of about a millisecond.
_MATCHING_STEPS = 16
#: Fewer vehicles tell nothing.
LEAST_VEHICLES = 8
# Of the vehicles that both could see such a share must be matched; a map that is quite another has no more
# matches than this share of the best one's.
_LEAST_SHARE, _MOST_SECOND = 0.5, 0.75
# Offsets that differ by more are others (s).
_OTHER_S = 0.35
# How uncertain a result may be: boxes, as a share of their size; the clock (s). Several lanes tell the map to
# .02 to .06 sizes; one lane says that it tells it to .2 to .4, and is off by more.
_MOST_SIZES, _MOST_CLOCK_S = 0.12, 0.02
# Lenses bend where vehicles would say so of straight ones as rarely as this.
_BENDS = 1e-3
# Vehicles whose paths lie within so many sizes of each other drive in one lane (.2 to .5; 5 to 6 in several).
_ONE_LANE, _LANE_QUANTILES = 1.5, (0.05, 0.95)


class Registration(NamedTuple):
    """How a sensor's picture and clock lie to those of another.

    Attributes:
        way: from its picture to the other's, with covariance.
        clock: its clock, None where nothing tells.
        lines: what is to be reported of it.
    """

    way: PictureMap
    clock: ClockConfig | None
    lines: list[str]


def register_by_traffic(
    first: SensorTracks,
    second: SensorTracks,
    names: tuple[str, str],
    sizes: tuple[tuple[float, float], tuple[float, float]],
    start: MatchedTracks | None = None,
) -> Registration:
    """Bring a sensor to another one by what both saw.

    Args:
        first: tracks of the sensor whose picture and clock are the common ones.
        second: of the other.
        names: of both.
        sizes: width and height of both pictures (px).
        start: a map and an offset that are nearly right, if some are known.

    Raises:
        DataError: the traffic does not tell how they lie; says why, and what to do.
    """
    for name, one in zip(names, (first, second), strict=True):
        moving = int(one.moves.sum())
        if moving < LEAST_VEHICLES:
            raise DataError(
                f"sensor {name!r} saw {moving} vehicles drive by, and {LEAST_VEHICLES} are needed: "
                "record longer"
            )
    try:
        return _register(first, second, names, sizes, start)
    except DataError:
        facing = facing_pattern(first, second)
        if facing is None:
            raise
        raise DataError(
            f"sensors {names[0]!r} and {names[1]!r} face each other (the clock of {names[1]!r} is ahead by "
            f"about {facing.offset_s:.1f} s): vehicles that grow in one picture shrink in the other, in the "
            "same order. Such pictures are not registered: run `track` and `road` on each; `handover` "
            "follows vehicles from one to the other"
        ) from None


def _register(
    first: SensorTracks,
    second: SensorTracks,
    names: tuple[str, str],
    sizes: tuple[tuple[float, float], tuple[float, float]],
    start: MatchedTracks | None,
) -> Registration:
    """Bring together two sensors that look the same way."""
    matched = _best(first, second, names) if start is None else match_again(first, second, start)
    _check_matches(matched, names)

    def refine_and_match(rough: bool = False) -> tuple[Refined, MatchedTracks]:
        refined = refine(first, second, matched, sizes, rough)
        again = match_again(first, second, matched._replace(way=refined.way, offset_s=refined.clock.offset_s))
        _check_matches(again, names)
        return refined, again

    try:
        _, matched = refine_and_match(rough=True)
        refined, matched = refine_and_match()
        evidence = refined.bends
        if evidence is not None and evidence.p_value < _BENDS:
            matched = matched._replace(way=with_lenses(refined.way, sizes), offset_s=refined.clock.offset_s)
            refined, matched = refine_and_match()
    except RuntimeError:
        raise _undetermined(names, "it leaves the map between the pictures open") from None
    _check_certainty(refined, second, matched, names, sizes[1])
    return Registration(refined.way, refined.clock, _lines(refined, matched, names, sizes[1], evidence))


def clock_by_map(
    first: SensorTracks,
    second: SensorTracks,
    way: PictureMap,
    guesses_s: Sequence[float] | None = None,
    least: int = LEAST_VEHICLES,
) -> ClockConfig | None:
    """Find the second's clock by traffic where the map is known.

    Args:
        first: tracks of the sensor whose picture and clock are the common ones.
        second: of the other.
        way: from its picture to the first's.
        guesses_s: rough offsets of its clock (s); by default those at which vehicles grow in the same way.
        least: number of vehicles that must agree.

    Returns:
        Offset and standard deviation; None where the traffic does not tell.
    """
    return run_through(clock_by_map_in_steps(first, second, way, guesses_s, least))


def clock_by_map_in_steps(
    first: SensorTracks,
    second: SensorTracks,
    way: PictureMap,
    guesses_s: Sequence[float] | None = None,
    least: int = LEAST_VEHICLES,
) -> Generator[None, None, ClockConfig | None]:
    """Do what `clock_by_map` does, one round of matching or of fitting a step."""
    if guesses_s is None:
        guesses_s = [offset_of(one.shift, first, second) for one in rank_offsets(first, second, _CANDIDATES)]
    none = no_tracks()
    found = []
    for guess in guesses_s:
        found.append(match_again(first, second, MatchedTracks(none, none, way, guess, 0)))
        yield from worth(_MATCHING_STEPS)
    best = max(found, key=lambda one: len(one.a), default=None)
    if best is None or len(best.a) < max(least, _LEAST_SHARE * best.possible):
        return None
    clock = None
    for _ in range(_ROUNDS):
        clock = _offset_of_matches(first, second, best, least)
        if clock is None:
            return None
        yield from worth(_MATCHING_STEPS)
        best = match_again(first, second, best._replace(offset_s=clock.offset_s))
        yield from worth(_MATCHING_STEPS)
    return clock


def _offset_of_matches(
    first: SensorTracks, second: SensorTracks, best: MatchedTracks, least: int
) -> ClockConfig | None:
    """Median over vehicles of how far one's boxes lag behind the other's, over their velocity."""
    way = best.way
    a_t, lag, weight = [], [], []
    for a, b in zip(best.a, best.b, strict=True):
        ours, theirs = first.measured[a], second.measured[b]
        t = theirs.t - best.offset_s
        inside = (t > ours.t[0] + 0.1) & (t < ours.t[-1] - 0.1)
        if inside.sum() < 2:
            continue
        velocity = np.gradient(ours.centre, ours.t, axis=0)
        at = np.column_stack([np.interp(t[inside], ours.t, v) for v in ours.centre.T])
        v = np.column_stack([np.interp(t[inside], ours.t, s) for s in velocity.T])
        left = way.points(theirs.centre[inside], theirs.size[inside, 1]) - at
        good = np.isfinite(left).all(axis=1)
        size2 = theirs.size[inside].prod(axis=1)[good]
        power = (v[good] ** 2).sum(axis=1) / size2
        a_t.append(float(theirs.t.mean()))
        # x(t − offset) is behind where x' is ahead: the slope of what is left over velocity.
        lag.append(float(-((left[good] * v[good]).sum(axis=1) / size2).sum() / max(power.sum(), 1e-12)))
        weight.append(float(power.sum()))
    if len(lag) < least:
        return None
    values, weights = np.array(lag), np.array(weight)
    order = np.argsort(values)
    middle = float(values[order][np.searchsorted(np.cumsum(weights[order]), 0.5 * weights.sum())])
    std = 1.4826 * float(np.median(np.abs(values - middle))) / np.sqrt(len(values)) * 1.25
    return ClockConfig(
        offset_s=no_smaller(best.offset_s + middle),
        at_s=float(np.median(a_t)),
        offset_std_s=no_smaller(float(std)),
    )


def _best(first: SensorTracks, second: SensorTracks, names: tuple[str, str]) -> MatchedTracks:
    """Match at the likeliest differences of the clocks; the best one must be far better than the others.

    On a short stretch of road a late clock looks like a map that is shifted along it. What matches the same
    partners at another difference is therefore no other solution: the graph finds the clock.
    """
    found = [
        one
        for candidate in rank_offsets(first, second, _CANDIDATES)
        if (one := match_at(first, second, candidate.shift)) is not None
    ]
    if not found:
        raise _undetermined(
            names, "no vehicle of the one fits one of the other, at any difference of their clocks"
        )
    found.sort(key=lambda one: -len(one.a))
    best = found[0]
    others = [
        len(_pairs(one) - _pairs(best)) for one in found[1:] if abs(one.offset_s - best.offset_s) > _OTHER_S
    ]
    return best._replace(wrong_map=max(others, default=0))


def _pairs(matched: MatchedTracks) -> set[tuple[int, int]]:
    return set(zip(matched.a.tolist(), matched.b.tolist(), strict=True))


def _check_matches(matched: MatchedTracks, names: tuple[str, str]) -> None:
    count, possible = len(matched.a), matched.possible
    if count < LEAST_VEHICLES or count < _LEAST_SHARE * possible:
        raise _undetermined(
            names,
            f"at best {count} of {possible} vehicles have a partner: they look at different roads, or did "
            "not record at one time, or face each other and share little of the road",
        )
    if matched.wrong_map > _MOST_SECOND * count:
        raise _undetermined(
            names,
            f"{count} vehicles have a partner at {matched.offset_s:.2f} s between the clocks, and "
            f"{matched.wrong_map} another one at quite another difference: record longer",
        )


def _check_certainty(
    refined: Refined,
    second: SensorTracks,
    matched: MatchedTracks,
    names: tuple[str, str],
    own: tuple[float, float],
) -> None:
    if _in_one_lane(second, matched):
        raise _undetermined(
            names,
            "all vehicles that both see drive in one lane, which tells nothing of what is beside it: "
            "record where they drive in several, or give --points",
        )
    std = refined.way.std_px(own)
    if std > _MOST_SIZES * refined.sizes_px:
        raise _undetermined(
            names,
            f"it tells the map to ± {std:.0f} px only: record longer, or give corresponding points with "
            "--points",
        )
    if refined.clock.offset_std_s > _MOST_CLOCK_S:
        raise _undetermined(
            names, f"it tells the clock to ± {1e3 * refined.clock.offset_std_s:.0f} ms only: record longer"
        )


def _in_one_lane(second: SensorTracks, matched: MatchedTracks) -> bool:
    """Whether all paths lie on one line, by the distances of their points from it in widths of boxes."""
    chosen = [second.measured[b] for b in matched.b]
    xy = joined(chosen)
    width = np.concatenate([np.sqrt(one.size.prod(axis=1)) for one in chosen])
    middle = xy.mean(axis=0)
    _, _, axes = np.linalg.svd(xy - middle, full_matrices=False)
    along, across = (xy - middle) @ axes.T.reshape(2, 2)[:, 0], (xy - middle) @ axes.T.reshape(2, 2)[:, 1]
    # A lane is straight on the road, and so in a picture, but for the heights of vehicles.
    across = across - np.polyval(np.polyfit(along, across, 1), along)
    low, high = np.quantile(across / width, _LANE_QUANTILES)
    return bool(high - low < _ONE_LANE)


def _undetermined(names: tuple[str, str], why: str) -> DataError:
    return DataError(
        f"the traffic does not tell how sensors {names[0]!r} and {names[1]!r} lie to each other: {why}"
    )


def _by_place(way: PictureMap, own: tuple[float, float]) -> str:
    """Say where in the own picture the map is known best and least; nothing where no place is in view."""
    places, std = way.std_by_place(own)
    if not len(std):
        return ""
    best, worst = int(np.argmin(std)), int(np.argmax(std))
    where = [f"± {std[k]:.2g} px at {places[k, 0]:.0f},{places[k, 1]:.0f}" for k in (best, worst)]
    return f" ({where[0]}, {where[1]})"


def _lens_line(refined: Refined, evidence: LensEvidence | None, names: tuple[str, str]) -> str:
    """Say whether the lenses bend."""
    if refined.way.lenses is None:
        assert evidence is not None
        return f"{names[1]}: no lens bends that the traffic could tell (p = {evidence.p_value:.2g})"
    std = np.sqrt(np.diag(refined.way.covariance))[-LENSES:]
    own, common = (f"{lens.k1:.3f} ± {one:.3f}" for lens, one in zip(refined.way.lenses, std, strict=True))
    why = "" if evidence is None else f" (p = {evidence.p_value:.1g} that none does)"
    return f"{names[1]}: the lenses bend{why}: k1 {own} of {names[1]}, {common} of {names[0]}"


def _lines(
    refined: Refined,
    matched: MatchedTracks,
    names: tuple[str, str],
    own: tuple[float, float],
    evidence: LensEvidence | None,
) -> list[str]:
    clock, std = refined.clock, refined.way.std_px(own)
    drift = f"drift {clock.drift_ppm:.1f} ± {clock.drift_std_ppm:.1f} ppm"
    return [
        f"{names[1]}: {len(matched.a)} of {matched.possible} vehicles matched with {names[0]}'s",
        f"{names[1]}: boxes go to the picture of {names[0]} to ± {std:.2g} px over the whole picture"
        f"{_by_place(refined.way, own)}; "
        f"residuals {refined.residual_px[0]:.2g} px of {names[0]}, {refined.residual_px[1]:.2g} px of "
        f"{names[1]}, of boxes of {refined.sizes_px:.0f} px",
        _lens_line(refined, evidence, names),
        f"{names[1]}: clock {clock.offset_s:.4f} s ± {1e3 * clock.offset_std_s:.1f} ms ahead at its "
        f"{clock.at_s:.1f} s, {drift}",
    ]
