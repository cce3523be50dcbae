"""`python -m benchmarks real`: real detectors that nothing here was made for, and simulated odd ones.

Every set of real recordings is tracked as it comes, after blind calibration and after calibration with truth,
each half of a set with what the other half gives; both tables are judged, and so are the peers, with their
defaults and tuned on the judged recordings themselves. Copies of the recordings, altered a little, say how
much of the scores is luck. Simulated worlds that nothing was made for stand beside the odd detectors.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks import common
from benchmarks.contenders import NAMES
from benchmarks.foreign import WorldJob, judge_world, worlds, worlds_table
from benchmarks.judging import HEADLINE, in_processes, summarise
from benchmarks.peer_cache import PeerCache, cache_key
from benchmarks.peer_search import peers_here
from benchmarks.provenance import provenance
from benchmarks.real_copies import CopyJob, copies_table, judge_copy
from benchmarks.real_ours import OursOnSet, judge_row, rows_of
from benchmarks.real_sets import RealSet, real_set, real_sets
from benchmarks.robustness import PRESETS, judge_variation, variations
from jeat_graph.config.argument_types import natural
from jeat_graph.config.reading import load_config

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

_QUICK_RECORDINGS = 2
_ROBUSTNESS_DURATION_S = 20.0
_QUICK_DURATION_S = 6.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    texts = {
        "data": "folder that holds kitti/, kitti-pedestrian/, tud/ (../shared/data)",
        "seeds": "of the simulated recordings (0 1)",
        "duration": f"of a simulated one ({_ROBUSTNESS_DURATION_S:g})",
        "quick": "two recordings a set, 6 s of simulation, nothing calibrated",
    }
    common.declare(parser, "real", texts)
    add = parser.add_argument
    add(
        "--copies",
        type=natural,
        default=0,
        metavar="N",
        help="judge N copies of each set, too, altered a little: how much of the scores is luck (0)",
    )
    add("--peers", metavar="JSON", help="keep the other trackers' scores in this file from run to run")
    add("--no-peers", action="store_true", help="leave the other trackers out")
    add("--tuned", action="store_true", help="search the others' parameters too, on what is judged (slow)")
    add("--no-calibrate", action="store_true", help="leave the calibrated rows out (they take minutes)")
    add("--no-worlds", action="store_true", help="leave the simulated worlds beside the highway out")
    add("--no-robustness", action="store_true", help="leave the simulated detectors out")


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return common.measure_or_read(args, "real", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Track and judge everything."""
    data = Path(args.data or "../shared/data")
    most = _QUICK_RECORDINGS if args.quick else None
    sets = real_sets(data, most)
    if not sets:
        print(f"no real recordings in {data}: only the simulated ones are judged", file=sys.stderr)
    calibrate = not (args.no_calibrate or args.quick)
    jobs = [(row, data, most, one.name) for one in sets for row in rows_of(one, calibrate)]
    ours = in_processes(_judge_ours, jobs, args.jobs, "real, ours")
    peers: list[dict[str, Any]] = []
    names: list[str] = []
    if not args.no_peers:
        cache = PeerCache(Path(args.peers) if args.peers else None)
        names, tuned = peers_here(), args.tuned and not args.quick
        peers = [one for found in sets for one in judge_peers(found, names, cache, tuned)]
    drawn = [CopyJob(data, most, one.name, seed, tuple(names)) for one in sets for seed in range(args.copies)]
    copies = in_processes(judge_copy, drawn, args.jobs, "altered copies") if drawn else []
    setup: dict[str, Any] = {
        "data": {one.name: [r.name for r in one.recordings] for one in sets},
        "seeds": list(args.seeds or ((0,) if args.quick else (0, 1))),
        "duration_s": args.duration or (_QUICK_DURATION_S if args.quick else _ROBUSTNESS_DURATION_S),
        "tuned": bool(args.tuned),
        "copies": args.copies,
    }
    foreign: list[list[dict[str, Any]]] = []
    if not args.no_worlds:
        seen = [
            WorldJob(one.name, seed, setup["duration_s"], tuple(names))
            for one in worlds()
            for seed in setup["seeds"]
        ]
        foreign = in_processes(judge_world, seen, args.jobs, "other worlds")
    robustness: list[dict[str, Any]] = []
    if not args.no_robustness:
        odd = [
            (preset, v.name, seed, setup["duration_s"])
            for v in variations()
            for seed in setup["seeds"]
            for preset in PRESETS
        ]
        robustness = in_processes(judge_variation, odd, args.jobs, "odd detectors")
    return {
        "benchmark": "real",
        **provenance(setup, {name: load_config(name) for name in PRESETS}),
        "ours": ours,
        "peers": peers,
        "copies": [record for found in copies for record in found],
        "worlds": [record for found in foreign for record in found],
        "robustness": robustness,
        "robustness_summary": summarise(robustness),
    }


def _judge_ours(job: tuple[OursOnSet, Path, int | None, str]) -> dict[str, Any]:
    row, data, most, name = job
    return judge_row(row, real_set(data, most, name))


def judge_peers(one: RealSet, names: Sequence[str], cache: PeerCache, tuned: bool) -> list[dict[str, Any]]:
    """Judge other trackers on every stream of a set, with their defaults and, if asked for, tuned."""
    from benchmarks.baselines import best_baseline, judge_baseline

    pairs = [(r.truth, r.detections) for r in one.recordings]
    out = []
    for stream in one.streams:
        for name in names:
            for how, function in (("defaults", judge_baseline), ("tuned", best_baseline))[: 1 + tuned]:

                def compute(
                    name: str = name, stream: tuple[str, ...] = stream, function: Any = function
                ) -> dict[str, Any]:
                    found = function(name, pairs, stream)
                    return {"parameters": dict(found.parameters), "scores": found.scores.as_dict()}

                found = cache.get(cache_key(f"{name} {how}", stream, {}, one.recordings), compute)
                row = f"{NAMES[name]}, {' + '.join(stream)}" + (", tuned" if how == "tuned" else "")
                out.append({"set": one.name, "row": row, "how": how, "sensors": list(stream), **found})
    return out


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of a result, by the name of their markers."""
    out: dict[str, Table] = {}
    names = list(dict.fromkeys(e["set"] for e in result["ours"]))
    for name in names:
        ours = [e for e in result["ours"] if e["set"] == name]
        peers = [e for e in result["peers"] if e["set"] == name]
        marker = name.lower().replace(" ", "-")
        out[f"real-{marker}"] = set_table(name, ours, peers)
        copies = [e for e in result.get("copies", ()) if e["set"] == name]
        if copies:
            out[f"copies-{marker}"] = copies_table(name, copies, result["settings"]["copies"])
    if result.get("worlds"):
        out["worlds"] = worlds_table(result["worlds"], len(result["settings"]["seeds"]))
    if result["robustness_summary"]:
        seeds = common.over_seeds(len(result["settings"]["seeds"]))
        out["robustness"] = common.scenario_table(
            _turned(result["robustness_summary"]),
            f"Odd detectors, simulated: {' / '.join(HEADLINE)}, {seeds}",
            HEADLINE,
        )
    return out


def set_table(name: str, ours: Sequence[Mapping[str, Any]], peers: Sequence[Mapping[str, Any]]) -> Table:
    """One row a tracker: causal and smoothed scores, errors, and whether the covariances are honest."""
    from jeat_graph.eval.tables import Table

    records: list[dict[str, Cell]] = []
    for e in ours:
        records.append(
            {
                "": e["row"],
                "causal " + " / ".join(HEADLINE): _cell(e["causal"]),
                "smoothed": _cell(e["smoothed"]),
                **{k: e["causal"][k] for k in ("FP", "FN", "IDSW")},
                "ANEES": round(e["nees"]["causal"].get("anees", float("nan")), 2),
                "95 %": round(100.0 * e["nees"]["causal"].get("coverage", float("nan")), 1),
            }
        )
    for e in peers:
        records.append(
            {
                "": e["row"],
                "causal " + " / ".join(HEADLINE): _cell(e["scores"]),
                **{k: e["scores"][k] for k in ("FP", "FN", "IDSW")},
            }
        )
    columns = list(records[0])
    return Table.from_records(records, columns, title=f"{name}, pooled")


def _cell(scores: Mapping[str, float]) -> str:
    return " / ".join(f"{scores[m]:.1f}" for m in HEADLINE)


def _turned(entries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Variations as rows and presets as columns."""
    return [{**e, "row": e["scenario"], "scenario": e["row"]} for e in entries]
