"""`jeat-graph explain`: why something in a run is a track, or is not."""

from __future__ import annotations

import argparse
import math
from argparse import ArgumentTypeError
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.cli.identity_texts import identity_texts
from jeat_graph.cli.progress import stages
from jeat_graph.cli.sensor_texts import effect_texts, sensor_texts
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.eval.tables import FORMATS

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table
    from jeat_graph.runs.explaining import PlaceStory, TrackMoment

WRITES = ("out",)
HELP = "explain why something in a run is a track, or is not: the terms of its log odds over time"
# Rows of a track's table.
_ROWS = 16
_SUFFIXES = (".png", ".svg", ".pdf")


def _place(text: str) -> tuple[float, float, float]:
    """Read a time and a place."""
    try:
        t, x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise ArgumentTypeError(f"{text!r} is not t,x,y: a time in s and a place in px") from None
    if not all(map(math.isfinite, (t, x, y))):
        raise ArgumentTypeError(f"{text!r}: time and place must be finite")
    return t, x, y


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add = parser.add_argument
    add("run_directory", metavar="RUN", help="directory of a run; its inputs must not have changed since")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument(
        "--track",
        type=int,
        metavar="ID",
        help="explain this track, reported or not: an identity of causal.csv, or of smoothed.csv where "
        "the smoother decided identities",
    )
    what.add_argument(
        "--at",
        type=_place,
        metavar="T,X,Y",
        help="explain what is, or is not, at a time (s) and a place (px)",
    )
    add("--out", metavar="FILE", help="also plot the track's terms into this file (.png, .svg, .pdf)")
    add(
        "--detections", nargs="+", metavar="FILE", help="the run's inputs, in their order, if they have moved"
    )
    add("--format", choices=FORMATS, default="text", help="of tables (default: text)")


def run(args: argparse.Namespace) -> int:
    """Track the recording again and tell of a track, or of a place."""
    from jeat_graph.runs.directory import read_record
    from jeat_graph.runs.explaining import explain_place, explain_tracks, run_to_explain
    from jeat_graph.runs.run_identities import identities_of_run

    if args.out is not None and args.track is None:
        raise ConfigError("--out plots a track: it needs --track ID")
    if args.out is not None and Path(args.out).suffix.lower() not in _SUFFIXES:
        raise ConfigError(f"--out {args.out}: the name of a plot must end in {', '.join(_SUFFIXES)}")
    folder, lines = Path(args.run_directory), []
    with stages("explain", 2) as stage:
        stage("reading")
        config, detections = run_to_explain(folder, args.detections)
        identities = None if args.track is None else identities_of_run(folder)
        of_sensors = sensor_texts(config, read_record(folder).get("learnt", {}))
        stage("tracking again")
        if args.track is None:
            place = explain_place(config, detections, *args.at)
            print("\n".join([*of_sensors, *_text_of_place(place, args.at, args.format)]))
            return 0
        wanted = [args.track]
        if identities is not None:
            lines = identity_texts(identities, args.track)
            wanted += [one.causal_id for one in identities.of_identity(args.track)]
        found = explain_tracks(config, detections, set(wanted))
    # An identity that no causal track began with is explained by the causal tracks that it is made of.
    shown = [args.track] if args.track in found else list(dict.fromkeys(wanted[1:]))
    if not shown:
        raise DataError(f"there is no track {args.track}")
    for track_id in shown:
        lines += [""] * bool(lines)
        lines += _text_of_track(found[track_id], track_id, args.format)
    print("\n".join([*of_sensors, *lines]))
    if args.out is not None:
        from jeat_graph.drawing.explanation import plot_explanation

        moments = [moment for track_id in shown for moment in found[track_id]]
        links = None if identities is None else identities.links_of(args.track)
        plot_explanation(moments, f"track {args.track}", Path(args.out), links)
    return 0


def _text_of_track(moments: Sequence[TrackMoment], track_id: int, form: str) -> list[str]:
    first, last = moments[0], moments[-1]
    shown = [one for one in moments if one.reported]
    lines = [f"track {track_id}: from {first.t:.3f} to {last.t:.3f} s, {_share_reported(moments, shown)}"]
    if shown:
        lines.append(f"reported first at {shown[0].t:.3f} s, existence {shown[0].existence:.2f}")
    strongest = sorted(last.terms.items(), key=lambda term: -abs(term[1]))[:3]
    terms = ", ".join(f"{name} {value:+.1f}" for name, value in strongest)
    lines.append(f"at its end: log odds {last.log_odds:+.1f} ({terms}); {last.reason}")
    lines += effect_texts(last.effects)
    places = [round(k * (len(moments) - 1) / (_ROWS - 1)) for k in range(_ROWS)]
    rows = [moments[k] for k in dict.fromkeys(places)]
    return [*lines, "", _table(rows).render(form).rstrip()]


def _share_reported(moments: Sequence[TrackMoment], shown: Sequence[TrackMoment]) -> str:
    if not shown:
        return "never reported"
    return (
        "always reported"
        if len(shown) == len(moments)
        else f"reported at {len(shown)} of {len(moments)} steps"
    )


def _table(moments: Sequence[TrackMoment]) -> Table:
    from jeat_graph.eval.tables import Table

    rows: list[dict[str, Cell]] = [
        {
            "t": one.t,
            "log odds": one.log_odds,
            "existence": one.existence,
            **one.terms,
            "against": one.other,
            "table": one.reason if not one.reported else "reported",
        }
        for one in moments
    ]
    return Table.from_records(rows, title="Terms of the log odds", digits={"t": 3, "log odds": 1})


def _text_of_place(place: PlaceStory, at: tuple[float, float, float], form: str) -> list[str]:
    from jeat_graph.eval.tables import Table

    t, x, y = at
    where = f"at t = {t:g} s, ({x:g}, {y:g}) px"
    if not place.boxes and not place.tracks:
        return [f"{where} no sensor has a box, and no track is there"]
    lines = [f"{where}: boxes of sensors: {len(place.boxes)}, tracks: {len(place.tracks)}"]
    if place.boxes:
        boxes: list[dict[str, Cell]] = [
            {"t": one.t, "sensor": one.sensor, "score": one.score, "went to track": one.track_id}
            for one in place.boxes
        ]
        lines += ["", Table.from_records(boxes, title="Boxes", digits={"t": 3}).render(form).rstrip()]
    for track_id, one in sorted(place.tracks.items()):
        terms = ", ".join(f"{name} {value:+.1f}" for name, value in one.terms.items() if abs(value) >= 0.05)
        lines += ["", f"track {track_id}, existence {one.existence:.2f}: {one.reason}", f"  {terms}"]
    return lines
