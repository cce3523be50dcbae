"""Compares crossings on the road with those in the picture, which `count` counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.counting import Line, crossings
from jeat_graph.road.crossings import followed_span
from jeat_graph.road.results import LeftOut, RoadResult

PixelLine = tuple[float, float, float, float]


class LineAgreement(NamedTuple):
    """How many cross a line, counted both ways.

    Attributes:
        line: its name.
        in_picture: crossings of boxes' middles in the picture, as `count` has them.
        not_placed: how many of these are none on the road (rows of `left_out.csv`).
        only_on_road: crossings of vehicles on the road whose boxes' middles do not cross in the picture.
    """

    line: str
    in_picture: int
    not_placed: int
    only_on_road: int


def with_unplaced(
    result: RoadResult, table: Trajectories, lines: Mapping[str, PixelLine]
) -> tuple[RoadResult, list[LineAgreement]]:
    """Add the crossings that `count` finds in the picture and the road does not have to `left_out`.

    Args:
        result: what was found out about the vehicles.
        table: the boxes that it was made from.
        lines: x1, y1, x2, y2 (px) by name.

    Returns:
        The result, and how many cross each line either way: on the road cross
        `in_picture - not_placed + only_on_road`.
    """
    on_road = Counter((line, result.vehicles[k].track_id) for line, k, _ in result.crossings)
    whole = {one.track_id: one for one in result.left_out}
    known = {vehicle.track_id: followed_span(vehicle) for vehicle in result.vehicles}
    unplaced: list[LeftOut] = []
    agreements: list[LineAgreement] = []
    for name, ends in lines.items():
        left = on_road.copy()
        found = crossings(table, Line(*ends, name=name))
        missing = []
        for one in found:
            if left[name, one.track_id] > 0:
                left[name, one.track_id] -= 1
                continue
            if one.track_id in whole:
                reason = whole[one.track_id].reason
            elif on_road[name, one.track_id]:
                reason = "it crosses the line again, and counts once on the road"
            else:
                reason = _why(one.t, known.get(one.track_id))
            missing.append(LeftOut(one.track_id, one.t, one.t, reason, name))
        unplaced += missing
        only = sum(count for (line, _), count in left.items() if line == name)
        agreements.append(LineAgreement(name, len(found), len(missing), only))
    return replace(result, left_out=[*result.left_out, *unplaced]), agreements


def _why(t: float, span: tuple[float, float] | None) -> str:
    if span is None:
        return "nothing of it was measured"
    if span[0] <= t <= span[1]:
        return "the vehicle on the road does not cross the line between its ends while it can be followed"
    return "the picture's edge cuts the vehicle there"


def agreement_notes(agreements: list[LineAgreement]) -> list[str]:
    """Return a line of text for each line at which picture and road do not agree."""
    notes = []
    for one in agreements:
        if one.not_placed:
            notes.append(
                f"{one.not_placed} of {one.in_picture} crossings of `{one.line}` were not placed on the road "
                "and are in no count here (left_out.csv says why): move the line away from the picture's "
                "edge, or make it longer"
            )
        if one.only_on_road:
            notes.append(
                f"`count` does not have {one.only_on_road} of the crossings of `{one.line}` here: it follows "
                "the middles of the boxes, which do not cross the line in the picture"
            )
    return notes
