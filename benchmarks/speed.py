"""`python -m benchmarks speed`: time, memory and start of our tracker beside others', in one run."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks.provenance import commit, made_by
from benchmarks.readme import update_readme
from benchmarks.speed_worker import SCANS_A_MINUTE, ask
from jeat_graph.config.argument_types import counting
from jeat_graph.data.extras import install

OBJECTS = (10, 50, 200, 1000)
VEHICLES = (30, 100, 300)
ENGINES = ("none", "fixed-lag", "full")
_HOUR = 60 * SCANS_A_MINUTE


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add("--out", metavar="DIR", help="write speed.json there")
    add("--objects", nargs="+", type=counting, default=list(OBJECTS), metavar="N", help="10 50 200 1000")
    add("--frames", type=counting, default=100, metavar="N", help="timed frames a repetition (100)")
    add("--warm-up", type=counting, default=30, metavar="N", help="frames before them (30)")
    add("--repeats", type=counting, default=3, metavar="N", help="repetitions, each of another scene (3)")
    add("--clock", choices=("wall", "cpu"), default="wall", help="cpu where others use the machine as well")
    add("--smoothers", action="store_true", help="time the steps with smoothing too")
    add("--no-peers", action="store_true", help="ours alone")
    add("--quick", action="store_true", help="small numbers: to see that it runs")
    add("--readme", metavar="FILE", help="renew the table between the markers of this Markdown file")
    add("--hour", action="store_true", help="also an hour of input at 100 Hz: is memory flat?")


def run(args: argparse.Namespace) -> int:
    """Measure, print the tables, write the files."""
    if args.quick:
        args.objects, args.frames, args.warm_up, args.repeats = args.objects[:2], 20, 15, 1
    if not args.quick:
        # The first child may have to compile; its time counts nowhere.
        ask({"job": "start_up"})
    result: dict[str, Any] = {"command": args.words, "commit": commit()}
    result |= {"steps": _steps(args), "start_up": _start_up(args)}
    result["real_time"] = _real_time(args)
    if args.hour:
        result["hour"] = ask({"job": "endurance", "scans": _HOUR, "objects": 5})
    sys.stdout.write(_tables(result))
    if args.readme is not None:
        update_readme(args.readme, {"speed": f"```text\n{_tables(result)}```\n\n{made_by(result)}"})
    if args.out is not None:
        _write(result, args)
    return 0


def _steps(args: argparse.Namespace) -> list[dict[str, Any]]:
    from benchmarks.speed_subjects import OURS
    from benchmarks.speed_timing import summarise

    names = [name for name, (_, engine) in OURS.items() if engine == "none" or args.smoothers]
    if not args.no_peers:
        found = ask({"job": "peers"})
        names += found
        if not found:
            how = f"{install('baselines')} && pip install --no-deps trackers"
            print(f"the peers are not installed: {how}", file=sys.stderr)
    objects = sorted(args.objects)
    rows = []
    work = tqdm(
        [(num, repeat) for num in objects for repeat in range(args.repeats)],
        desc="steps",
        disable=not sys.stderr.isatty(),
    )
    runs: dict[int, list[Any]] = {num: [] for num in objects}
    for num, repeat in work:
        answer = ask(
            {
                "job": "times",
                "names": names,
                "objects": num,
                "frames": args.frames,
                "warm_up": args.warm_up,
                "seed": repeat,
                "clock": args.clock,
            }
        )
        runs[num].append({name: (np.array(elapsed), seen) for name, (elapsed, seen) in answer.items()})
    peaks = {
        name: ask({"job": "memory", "name": name, "objects": objects, "frames": 40})
        for name in tqdm(names, desc="memory", disable=not sys.stderr.isatty())
    }
    for k, num in enumerate(objects):
        rows += [
            {"objects": num, **record, "peak_mib": peaks[record["tracker"]][k]}
            for record in summarise(runs[num])
        ]
    return rows


def _start_up(args: argparse.Namespace) -> dict[str, float]:
    times = [ask({"job": "start_up"}) for _ in range(max(args.repeats, 1))]
    return {key: float(np.median([one[key] for one in times])) for key in times[0]}


def _real_time(args: argparse.Namespace) -> list[dict[str, Any]]:
    duration = 1.0 if args.quick else 5.0
    vehicles = VEHICLES[:1] if args.quick else VEHICLES
    rows = []
    for num in tqdm(vehicles, desc="real time", disable=not sys.stderr.isatty()):
        job = {"objects": num, "engines": list(ENGINES), "duration": duration, "clock": args.clock}
        rows += [
            {"vehicles": num, "smoother": engine, "times_real_time": factor}
            for engine, factor in ask({"job": "real_time", **job}).items()
        ]
    return rows


def _tables(result: dict[str, Any]) -> str:
    lines = [
        "Time per frame, one thread (× ByteTrack: median of the repetitions, least … greatest)",
        f"{'objects':>7}  {'tracker':<24}{'median ms':>10}{'p99 ms':>9}{'p99/med':>9}{'MiB':>7}{'tracks':>8}"
        "  × ByteTrack",
    ]
    for row in result["steps"]:
        line = (
            f"{row['objects']:>7}  {row['tracker']:<24}{row['median_ms']:>10.3f}{row['p99_ms']:>9.3f}"
            f"{row['p99_over_median']:>9.2f}{row['peak_mib']:>7.1f}{row['reported']:>8.1f}"
        )
        if "times_faster" in row:
            line += (
                f"  {row['times_faster']:.1f} ({row['times_faster_min']:.1f} … {row['times_faster_max']:.1f})"
            )
        lines.append(line)
    lines += ["", "Times real time, `default`, events at 100 Hz and RGB at 20 Hz"]
    lines += [f"{'vehicles':>8}" + "".join(f"{engine:>15}" for engine in ENGINES)]
    for num in dict.fromkeys(row["vehicles"] for row in result["real_time"]):
        mine = {r["smoother"]: r["times_real_time"] for r in result["real_time"] if r["vehicles"] == num}
        lines.append(f"{num:>8}" + "".join(f"{mine[engine]:>15.1f}" for engine in ENGINES))
    start = result["start_up"]
    lines += [
        "",
        f"Start: import jeat_graph {start['import_s']:.2f} s, with the tracker "
        f"{start['import_tracker_s']:.2f} s, first step {start['first_step_s']:.2f} s",
    ]
    if "hour" in result:
        memory = result["hour"]["resident_mib"]
        lines.append(
            f"One hour at 100 Hz: {memory[0]:.1f} MiB after the first minute, "
            f"{memory[-1]:.1f} MiB after the last"
        )
    return "\n".join(lines) + "\n"


def _write(result: dict[str, Any], args: argparse.Namespace) -> None:
    from benchmarks.provenance import provenance
    from jeat_graph.config.reading import config_to_dict, load_config
    from jeat_graph.io.files.atomic import open_atomic

    settings = {key: getattr(args, key) for key in ("objects", "frames", "warm_up", "repeats", "clock")}
    head = provenance(settings, {name: config_to_dict(load_config(name)) for name in ("default", "paper")})
    folder = Path(args.out)
    with open_atomic(folder / "speed.json") as file:
        json.dump({**head, **result}, file, indent=1)
        file.write("\n")
