"""`jeat-graph handover`: the same vehicles at several cameras along a road, and their travel times."""

from __future__ import annotations

import argparse
import math
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.cli.count_output import clock_s, with_clock
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import positive
from jeat_graph.data.errors import ConfigError

if TYPE_CHECKING:
    from jeat_graph.corridor.handover import Handover, KnownGap

WRITES_INTO = ("out",)
HELP = "follow vehicles from camera to camera along a road: travel times, origin and destination"
_MEASURE = re.compile(
    r"(?P<value>[-+]?[\d.]+(?:e[-+]?\d+)?)\s*(?:(?:±|\+-|\+/-)\s*(?P<sd>[\d.]+(?:e[-+]?\d+)?))?"
)
_say = partial(say, "handover")
#: Of a distance that is given without one, as a share.
_USUAL_DISTANCE_SD = 0.01
_INTERVAL_S = 300.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add(
        "cameras",
        nargs="+",
        type=_named_folder,
        metavar="NAME=ROAD",
        help="a name for each camera, and the folder that `jeat-graph road` wrote of it",
    )
    add(
        "--distance",
        action="append",
        default=[],
        type=partial(_measured_gap, "--distance"),
        metavar="A-B=M±M",
        help="distance along the road from the line of A to that of B (m), with its standard deviation; "
        "traffic passes A first",
    )
    add(
        "--clock",
        action="append",
        default=[],
        type=partial(_measured_gap, "--clock"),
        metavar="A-B=S±S",
        help="clock of B less clock of A (s), with its standard deviation, such as 0±0.05 for one clock "
        "(default: found from the traffic)",
    )
    add("--corridor", metavar="FILE", help="an earlier corridor.yaml: its clocks and distances")
    add(
        "--line",
        action="append",
        default=[],
        type=_named,
        metavar="NAME=LINE",
        help="which line of a camera's crossings.csv counts, if there are several",
    )
    add(
        "--direction",
        action="append",
        default=[],
        type=_named,
        metavar="NAME=left|right",
        help="to which side the traffic that is followed crosses a camera's line, if it is crossed both ways",
    )
    add(
        "--embeddings",
        action="append",
        default=[],
        type=_named,
        metavar="NAME=RUN",
        help="the run of a camera's tracks, made with --embedder: what its vehicles look like; for both "
        "cameras of a gap",
    )
    add(
        "--interval", type=positive, default=_INTERVAL_S, metavar="S",
        help=f"length of an interval of travel_times.csv and od.csv ({_INTERVAL_S:g})",
    )  # fmt: skip
    add("--begin", metavar="DATE", help="date and time of time 0 of the first camera's clock")
    add(
        "--out",
        required=True,
        metavar="DIR",
        help="folder for corridor.yaml, identities.csv, passages.csv, travel_times.csv, od.csv, left_out.csv "
        "and corridor.html",
    )


def run(args: argparse.Namespace) -> int:
    """Solve the corridor and write it."""
    from jeat_graph.corridor.corridor_file import write_corridor
    from jeat_graph.corridor.corridor_page import write_corridor_page
    from jeat_graph.corridor.corridor_tables import (
        Corridor,
        identity_columns,
        left_out_columns,
        od_columns,
        passage_columns,
        travel_time_columns,
    )
    from jeat_graph.corridor.handover import chain, hand_over
    from jeat_graph.corridor.passage_appearance import check_appearance, with_appearance
    from jeat_graph.corridor.passages import read_passages
    from jeat_graph.io.files.outputs import check_folder
    from jeat_graph.io.tables.table_writer import write_columns

    begin_s = clock_s(args.begin)
    out = Path(args.out)
    check_folder(out)
    names = [name for name, _ in args.cameras]
    if len(set(names)) < len(names) or len(names) < 2:
        raise ConfigError("two or more cameras with different names are needed: A=road-a B=road-b")
    lines, ways = _once("--line", args.line, names), _once("--direction", args.direction, names)
    if set(ways.values()) - {"left", "right"}:
        raise ConfigError("--direction: must be NAME=left or NAME=right")
    runs = _once("--embeddings", args.embeddings, names)
    gaps = _gaps(args)
    order = chain(gaps, names)
    cameras = {
        name: read_passages(folder, name, lines.get(name), ways.get(name)) for name, folder in args.cameras
    }
    cameras |= {name: with_appearance(cameras[name], run) for name, run in runs.items()}
    check_appearance([cameras[name] for name in order])
    gaps = sorted(gaps, key=lambda gap: order.index(gap.first))
    corridor = Corridor.of(order, cameras, hand_over(gaps, cameras))
    for over in corridor.handovers:
        _say(_sentence(over))
    travel_times = travel_time_columns(corridor, args.interval, begin_s)
    od = od_columns(corridor, args.interval, begin_s)
    dated = partial(with_clock, begin=args.begin)
    out.mkdir(parents=True, exist_ok=True)
    for name, columns in (
        ("identities", identity_columns(corridor)),
        ("passages", passage_columns(corridor)),
        ("travel_times", dated(travel_times)),
        ("od", dated(od)),
        ("left_out", left_out_columns(corridor)),
    ):
        write_columns(columns, out / f"{name}.csv")
    write_corridor(corridor, out / "corridor.yaml", [_sentence(over) for over in corridor.handovers])
    write_corridor_page(corridor, travel_times, od, out / "corridor.html")
    total = sum(len(over.first) for over in corridor.handovers)
    print(f"{total} vehicles handed over in {len(corridor.handovers)} gaps: {out}")
    return 0


def _sentence(over: Handover) -> str:
    p, covariance = over.fitted.parameters, over.fitted.covariance
    a, b = over.fitted.gap.before, over.fitted.gap.after
    sd = math.sqrt(covariance[0, 0])
    return (
        f"{a.camera}-{b.camera}: {len(over.first)} of {len(a)} vehicles are among the {len(b)} at "
        f"{b.camera}, {p.distance_m:.0f} m on; clock {p.offset_s:.3f} ± {sd:.3f} s ahead (peak "
        f"{over.peak.height:.0f} robust deviations, next {over.peak.runner_up:.0f}); travel times spread by "
        f"{100.0 * p.spread:.1f} %{_of_appearance(over)}"
    )


def _of_appearance(over: Handover) -> str:
    """Say how well embeddings tell vehicles apart, where there are some."""
    if over.fitted.gap.appearance is None:
        return ""
    appearance = over.fitted.parameters.appearance
    return f"; embeddings tell vehicles apart by d′ {0.0 if appearance is None else appearance.d_prime:.1f}"


def _gaps(args: argparse.Namespace) -> list[KnownGap]:
    """What is declared of the gaps: by a file, and by arguments, which come first."""
    from jeat_graph.corridor.corridor_file import read_known_gaps
    from jeat_graph.corridor.handover import KnownGap

    found: dict[tuple[str, str], KnownGap] = {}
    if args.corridor is not None:
        found = {(gap.first, gap.second): gap for gap in read_known_gaps(args.corridor)}
    for first, second, value, sd in args.distance:
        if not value > 0.0:
            raise ConfigError(f"--distance {first}-{second}: must be positive")
        known = found.get((first, second), KnownGap(first, second))
        sd = _USUAL_DISTANCE_SD * value if math.isnan(sd) else sd
        found[first, second] = replace(known, distance_m=value, distance_sd_m=max(sd, 1e-3))
    for first, second, value, sd in args.clock:
        known = found.get((first, second), KnownGap(first, second))
        found[first, second] = replace(
            known, offset_s=value, offset_sd_s=0.05 if math.isnan(sd) else max(sd, 1e-3)
        )
    if not found:
        raise ConfigError("say how far the cameras are apart, as --distance A-B=500±5")
    return list(found.values())


def _once(option: str, given: list[tuple[str, str]], names: list[str]) -> dict[str, str]:
    for name, _ in given:
        if name not in names:
            raise ConfigError(f"{option} {name}: there is no such camera: {', '.join(names)}")
    if len({name for name, _ in given}) < len(given):
        raise ConfigError(f"{option}: a camera is named twice")
    return dict(given)


def _named(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals or not name or not value:
        raise argparse.ArgumentTypeError(f"must read NAME=VALUE, not {text!r}")
    return name, value


def _named_folder(text: str) -> tuple[str, str]:
    name, folder = _named(text)
    if "-" in name:
        raise argparse.ArgumentTypeError(f"a camera's name has no hyphen, which stands between two: {name!r}")
    return name, folder


def _measured_gap(option: str, text: str) -> tuple[str, str, float, float]:
    name, _, measure = text.partition("=")
    first, hyphen, second = name.partition("-")
    match = _MEASURE.fullmatch(measure.strip())
    example = "A-B=500±5" if option == "--distance" else "A-B=0±0.05"
    if not (hyphen and first and second and match):
        raise argparse.ArgumentTypeError(f"must read {example}, not {text!r}")
    try:
        value = float(match["value"])
        sd = math.nan if match["sd"] is None else float(match["sd"])
    except ValueError:
        raise argparse.ArgumentTypeError(f"must read {example}, not {text!r}") from None
    return first, second, value, sd
