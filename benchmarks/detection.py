"""`python -m benchmarks detection`: how well detectors find vehicles in raw pictures and raw events."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import stdev
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import common
from benchmarks.processes import in_processes
from benchmarks.provenance import provenance
from benchmarks.raw_options import NONE, add_raw, detectors_of, findings
from benchmarks.raw_segments import SENSORS, RawFound, described, find_in, segments_in
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.detection.detecting import FUSED_SENSOR

if TYPE_CHECKING:
    from jeat_graph.data.detections import Detections
    from jeat_graph.eval.tables import Cell, Table
    from jeat_graph_sehn.training.truth_at import TruthByTime

#: Boxes by the root of their area (px): the paper's smaller half, and COCO's limit.
SIDES = {"below 12 px": (0.0, 12.0), "12 to 32 px": (12.0, 32.0), "above 32 px": (32.0, np.inf)}
ALL, MOVED, STOPPED = "all", "that moved", "that stopped"
#: Who has gone less (px) in the time (s) before an instant, that is of few events, does not count as moved.
_LEAST_WAY_PX, _BEFORE_S = 1.0, 0.2
#: Who has gone so far since the recording began (px), and less than that in the time above, has stopped.
_GONE_PX, _STANDS_PX = 3.0, 0.3
#: Average precision is over all scores; what is certainly wrong only takes time.
_EVERY_SCORE = ("model_frames.score=0.01", "model_events.score=0.01", "model_fused.score=0.01")
_KEYS = ("AP50", "AP")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    add_raw(parser, "detection", one_is_enough=True)


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return common.measure_or_read(args, "detection", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Let every detector look at every segment, and judge what it finds.

    Raises:
        ConfigError: no detectors, or what `findings` raises.
    """
    args.frames, args.events = ([one for one in names if one != NONE] for names in (args.frames, args.events))
    if not (args.frames or args.events or args.fused):
        raise ConfigError("no detectors: give --frames, --events or --fused")
    folders = [Path(one) for one in args.folders]
    segments = segments_in(folders)
    asked = findings(args, segments, _EVERY_SCORE)
    found = in_processes(find_in, asked, args.jobs, "detecting")
    settings = {
        "data": described(folders),
        "detectors": detectors_of(args),
        "detection": list(args.detection_set),
    }
    records = []
    for sensor in (*SENSORS, FUSED_SENSOR):
        for detector in dict.fromkeys(one.finding.detector for one in found if one.finding.sensor == sensor):
            own = [one for one in found if (one.finding.sensor, one.finding.detector) == (sensor, detector)]
            records.append({"sensor": sensor, "detector": Path(detector).name, **judge_detector(own)})
    return {"benchmark": "detection", **provenance(settings, {}), "records": records}


def judge_detector(found: Sequence[RawFound]) -> dict[str, Any]:
    """Judge what one detector found in all segments.

    Returns:
        `scans`, `scans_per_cpu_s`, and by name of a group of vehicles (`all`, each data set, `that moved`,
        `that stopped`, sizes): `AP50` and `AP` (%, segments pooled), `boxes`, `segments`, and the standard
        deviation of AP50 over segments.
    """
    truths = [one.finding.segment.truth() for one in found]
    pairs = [(truth, one.detections) for truth, one in zip(truths, found, strict=True)]
    groups = {ALL: _ap(pairs)}
    for source in dict.fromkeys(one.finding.segment.source for one in found):
        own = [p for p, one in zip(pairs, found, strict=True) if one.finding.segment.source == source]
        groups[source] = _ap(own)
    groups[MOVED] = _ap([(only_moved(truth), detections) for truth, detections in pairs])
    groups[STOPPED] = _ap([(only_stopped(truth), detections) for truth, detections in pairs])
    for name, sides in SIDES.items():
        groups[name] = _ap(pairs, sides)
    scans = sum(one.detections.num_scans for one in found)
    return {
        "scans": scans,
        "scans_per_cpu_s": scans / max(sum(one.cpu_s for one in found), 1e-9),
        "groups": groups,
    }


def only_moved(truth: GroundTruth) -> GroundTruth:
    """Ignore what has hardly moved in the last moments: no event camera, and no background, shows it."""
    lookup = _ways(truth)
    return _only(truth, lambda t: lookup.moved(t - _BEFORE_S, t, _LEAST_WAY_PX))


def only_stopped(truth: GroundTruth) -> GroundTruth:
    """Ignore all but what drove and stands now: of that an event camera shows nothing, but it has seen it."""
    lookup, start = _ways(truth), float(truth.frame_times()[0])

    def stopped(t: float) -> set[int]:
        return lookup.moved(start, t, _GONE_PX) - lookup.moved(t - _BEFORE_S, t, _STANDS_PX)

    return _only(truth, stopped)


def _ways(truth: GroundTruth) -> TruthByTime:
    from jeat_graph_sehn.training.truth_at import TruthByTime

    return TruthByTime(truth)


def _only(truth: GroundTruth, chosen: Callable[[float], set[int]]) -> GroundTruth:
    """Ignore all but the objects that are chosen at each time (s)."""
    ignore = truth.ignore.copy()
    for t in truth.frame_times().tolist():
        rows = np.flatnonzero(np.abs(truth.t - t) <= 1e-6)
        ignore[rows] |= ~np.isin(truth.object_id[rows], list(chosen(t)))
    return replace(truth, ignore=ignore)


def _ap(
    pairs: Sequence[tuple[GroundTruth, Detections]], sides_px: tuple[float, float] = (0.0, np.inf)
) -> dict[str, Any]:
    from jeat_graph.eval.detection_ap import detection_ap

    def pooled(some: Sequence[tuple[GroundTruth, Detections]]) -> Mapping[str, float]:
        (one,) = detection_ap(some, sides_px=sides_px).values()
        return one.as_dict()

    whole = pooled(pairs)
    each = [pooled([pair])["AP50"] for pair in pairs]
    there = [value for value in each if np.isfinite(value)]
    return {
        **{key: whole[key] if whole["truth_boxes"] else None for key in _KEYS},
        "boxes": whole["truth_boxes"],
        "segments": len(there),
        "AP50_std": stdev(there) if len(there) > 1 else 0.0,
    }


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """The table of a result, by the name of its markers."""
    from jeat_graph.eval.tables import Table

    records: list[dict[str, Cell]] = []
    for one in result["records"]:
        record: dict[str, Cell] = {"detector": one["detector"], "sensor": one["sensor"]}
        record |= {name: _cell(group) for name, group in one["groups"].items()}
        records.append(record | {"scans a s": one["scans_per_cpu_s"]})
    columns = list(dict.fromkeys(key for record in records for key in record))
    title = "AP50 ± over segments / AP50:95 (%), and scans a second of one core"
    return {"detection": Table.from_records(records, columns, title=title, digits={"scans a s": 1})}


def _cell(group: Mapping[str, Any]) -> str | None:
    if group["AP50"] is None:
        return None
    several = f"±{group['AP50_std']:.0f}" if group["segments"] > 1 else ""
    return f"{group['AP50']:.1f}{several} / {group['AP']:.1f}"
