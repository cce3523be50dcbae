"""`python -m benchmarks raw`: from raw pictures and raw events to tracks, ours and ByteTrack's."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import stdev
from typing import TYPE_CHECKING, Any

from benchmarks import common
from benchmarks.baselines import peers_here
from benchmarks.kept import kept_or_found
from benchmarks.processes import in_processes
from benchmarks.provenance import provenance
from benchmarks.raw_options import add_raw, detectors_of, findings
from benchmarks.raw_segments import SENSORS, RawFound, RawSegment, described, segments_in
from benchmarks.recordings import JudgedRecording
from jeat_graph.config.reading import config_to_dict, load_config
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.declared import declared_settings
from jeat_graph.detection.detecting import EVENTS_SENSOR, FRAMES_SENSOR, FUSED_SENSOR
from jeat_graph.detection.request import DetectRequest

if TYPE_CHECKING:
    from jeat_graph.config.schema import Config
    from jeat_graph.eval.tables import Cell, Table

# Rows of a smoothed table are joined over so many periods of the slowest sensor: where the tracker leaves out
# what is more likely wrong than right, nothing is put in.
_JOINED_PERIODS = 1.5
BYTETRACK, PAPER = "ByteTrack", "paper"
CAUSAL, SMOOTHED = "causal", "smoothed"
_METRICS = ("MOTA", "MOTP", "HOTA", "IDF1")
_ALL = "all"


@dataclass(frozen=True)
class Row:
    """A row of the table.

    Attributes:
        detectors: of pictures and of events, by name; that of both twice.
        tracker: `ByteTrack`, `paper`, or the preset of ours.
        sensors: what it is given.
    """

    detectors: tuple[str, str]
    tracker: str
    sensors: tuple[str, ...]

    @property
    def key(self) -> tuple[str, str]:
        """Whose recordings they are."""
        return (FUSED_SENSOR, self.detectors[0]) if self.sensors == (FUSED_SENSOR,) else self.detectors

    def request(self) -> DetectRequest:
        """What has detected, wherever that was."""
        frames, events = self.detectors
        if self.sensors == (FUSED_SENSOR,):
            return DetectRequest(frames="frames", events="events", detector_fused=frames)
        return DetectRequest(
            frames="frames" if FRAMES_SENSOR in self.sensors else None,
            events="events" if EVENTS_SENSOR in self.sensors else None,
            detector_frames=frames,
            detector_events=events,
        )

    def __str__(self) -> str:
        by_sensor = {**dict(zip(SENSORS, self.detectors, strict=True)), FUSED_SENSOR: self.detectors[0]}
        return f"{self.tracker}, " + " + ".join(f"{s} {Path(by_sensor[s]).name}" for s in self.sensors)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    add_raw(parser, "raw")
    parser.add_argument(
        "--presets", nargs="+", default=["default"], metavar="NAME", help="of our tracker (default: default)"
    )
    parser.add_argument("--no-peers", action="store_true", help="leave ByteTrack out")
    parser.add_argument(
        "--keep",
        metavar="DIR",
        help="keep there what detectors find, and take what the same ones found in the same segments",
    )


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return common.measure_or_read(args, "raw", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Detect once, then track and judge with every tracker."""
    folders = [Path(one) for one in args.folders]
    segments = segments_in(folders)
    if len(args.frames) != len(args.events):
        raise ConfigError(
            f"{len(args.frames)} detectors of pictures and {len(args.events)} of events: they go in pairs"
        )
    configs = {name: load_config(name) for name in (*args.presets, PAPER)}
    with_peers = not args.no_peers and "bytetrack" in peers_here()
    found = in_processes(
        kept_or_found, [(one, args.keep) for one in findings(args, segments)], args.jobs, "detecting"
    )
    recordings = _recordings(found)
    rows = [
        row
        for pair in zip(args.frames, args.events, strict=True)
        for row in rows_of(pair, args.presets, with_peers)
    ]
    rows += [row for one in args.fused for row in fused_rows(one, args.presets, with_peers)]
    # Pairs that share a detector share the rows of its sensor alone.
    jobs = [(row, recordings[row.key]) for row in {str(row): row for row in rows}.values()]
    records = in_processes(_judge, jobs, args.jobs, "tracking")
    settings = {
        "data": described(folders),
        "detectors": detectors_of(args),
        "detection": list(args.detection_set),
    }
    return {
        "benchmark": "raw",
        **provenance(settings, {name: config_to_dict(one) for name, one in configs.items()}),
        "sources": list(dict.fromkeys(s.source for s in segments)),
        "records": [record for part in records for record in part],
    }


def rows_of(detectors: tuple[str, str], presets: Sequence[str], with_peers: bool) -> list[Row]:
    """Return the rows of a pair of detectors: each sensor alone and both, theirs, the paper's and ours."""
    streams = [*((sensor,) for sensor in SENSORS), SENSORS]
    theirs = [Row(detectors, BYTETRACK, stream) for stream in streams] if with_peers else []
    ours = [Row(detectors, preset, stream) for preset in presets for stream in streams]
    return [*theirs, Row(detectors, PAPER, SENSORS), *ours]


def fused_rows(detector: str, presets: Sequence[str], with_peers: bool) -> list[Row]:
    """Return the rows of a network of both sensors, whose boxes are those of one sensor: theirs and ours."""
    trackers = [*([BYTETRACK] if with_peers else []), *presets]
    return [Row((detector, detector), tracker, (FUSED_SENSOR,)) for tracker in trackers]


def _recordings(found: Sequence[RawFound]) -> dict[tuple[str, str], dict[str, list[JudgedRecording]]]:
    """Return recordings by data set, by pair of detectors with the detections of both sensors.

    A network of both sensors stands as `fused` and its name.
    """
    by_sensor: dict[str, dict[tuple[str, str, str], RawFound]] = {sensor: {} for sensor in SENSORS}
    out: dict[tuple[str, str], dict[str, list[JudgedRecording]]] = {}
    for one in found:
        asked = one.finding
        if asked.sensor == FUSED_SENSOR:
            group = out.setdefault((FUSED_SENSOR, asked.detector), {}).setdefault(asked.segment.source, [])
            group.append(_recording(asked.segment, one.detections))
            continue
        by_sensor[asked.sensor][asked.detector, asked.segment.source, asked.segment.name] = one
    frames, events = (by_sensor[sensor] for sensor in SENSORS)
    for (first, source, name), rgb in frames.items():
        for (second, *place), evt in events.items():
            if place != [source, name]:
                continue
            both = Detections.concatenate([rgb.detections, evt.detections])
            group = out.setdefault((first, second), {}).setdefault(source, [])
            group.append(_recording(rgb.finding.segment, both))
    return out


def _recording(segment: RawSegment, found: Detections) -> JudgedRecording:
    return JudgedRecording(f"{segment.source}/{segment.name}", found, segment.truth(), segment.size_px())


def _judge(job: tuple[Row, dict[str, list[JudgedRecording]]]) -> list[dict[str, Any]]:
    """Judge one row in all data sets: a record for each, and for what it reports (causal, smoothed)."""
    row, by_source = job
    everything = {**by_source, _ALL: [one for group in by_source.values() for one in group]}
    tracked = {one.name: _tracked(row, one) for group in by_source.values() for one in group}
    out = []
    for source, group in everything.items():
        for kind in tracked[group[0].name]:
            scores = _scores(group, [tracked[one.name][kind] for one in group], row, kind)
            each = [_scores([one], [tracked[one.name][kind]], row, kind) for one in group]
            spread = {m: stdev([e[m] for e in each]) if len(each) > 1 else 0.0 for m in _METRICS}
            out.append(
                {
                    "row": str(row) + (", smoothed" if kind == SMOOTHED else ""),
                    "detectors": dict(zip(SENSORS, row.detectors, strict=True)),
                    "tracker": row.tracker,
                    "sensors": list(row.sensors),
                    "kind": kind,
                    "source": source,
                    "segments": len(group),
                    "scores": scores,
                    "std": spread,
                    "nees": _nees(group, [tracked[one.name][kind] for one in group], row, kind),
                }
            )
    return out


def _tracked(row: Row, recording: JudgedRecording) -> dict[str, Any]:
    """Return the tables of a tracker, by what they are."""
    from benchmarks.baselines import run_baseline
    from jeat_graph.runs.latency import at_measurement
    from jeat_graph.tracking.whole import both_tables, track

    if row.tracker == BYTETRACK:
        return {CAUSAL: run_baseline("bytetrack", recording.detections, row.sensors)}
    seen = recording.only(row.sensors)
    config = _config(row, seen, recording.image)
    seen = at_measurement(seen, config)
    if row.tracker == PAPER:
        return {CAUSAL: track(config, seen)}
    return dict(zip((CAUSAL, SMOOTHED), both_tables(config, seen), strict=True))


def _config(row: Row, seen: Detections, image: tuple[float, float] | None) -> Config:
    """Return a preset for what is seen: what is known of the networks, their rates, and their picture.

    As in `track`, files beside the networks count with `default` alone.
    """
    from jeat_graph.runs.declaring import fit_input

    changes = [] if image is None else [f"image.width={image[0]:g}", f"image.height={image[1]:g}"]
    if row.tracker == "default":
        changes += declared_settings(row.request())
    return fit_input(load_config(row.tracker, changes), seen)[0]


def _scores(group: Sequence[JudgedRecording], found: Sequence[Any], row: Row, kind: Any) -> dict[str, Any]:
    from jeat_graph.eval.metrics import evaluate

    first = row.sensors[:1] if row.tracker == BYTETRACK else row.sensors
    # Ours says itself when it ran: what detectors need was taken off their times beforehand.
    ran = [table.instants for table in found]
    at = [one.instants(first) for one in group] if row.tracker == BYTETRACK else ran
    instants = at if kind == CAUSAL else None
    pairs = [(one.truth, table) for one, table in zip(group, found, strict=True)]
    joined_s = _joined_s(group, row.sensors) if kind == SMOOTHED else None
    return evaluate(pairs, kind=kind, instants=instants, max_gap_s=joined_s).as_dict()


def _joined_s(group: Sequence[JudgedRecording], sensors: Sequence[str]) -> float | None:
    """How far apart rows of smoothed tables may be that are joined (s); None where no rate is known."""
    from jeat_graph.runs.declaring import scan_rate_hz

    rates = [scan_rate_hz([one.detections for one in group], sensor) for sensor in sensors]
    slowest = min((rate for rate in rates if rate), default=None)
    return None if slowest is None else _JOINED_PERIODS / slowest


def _nees(
    group: Sequence[JudgedRecording], found: Sequence[Any], row: Row, kind: Any
) -> dict[str, float | int]:
    """Whether the stated errors are true: only ours says something."""
    from jeat_graph.eval.position_nees import position_nees

    if row.tracker in (BYTETRACK, PAPER):
        return {}
    judged = position_nees([(one.truth, table) for one, table in zip(group, found, strict=True)], kind)
    if not judged.matched:
        return {}
    return {"anees": judged.anees, "coverage": judged.coverage, "matched": judged.matched}


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of a result, by the name of their markers: one for all data together, and one a data set."""
    from jeat_graph.eval.tables import Table

    sources = [*result["sources"], _ALL]
    cells: dict[str, dict[str, Cell]] = {}
    for one in result["records"]:
        several = one["segments"] > 1
        cell = " / ".join(
            f"{one['scores'][m]:.1f}" + (f"±{one['std'][m]:.0f}" if several else "") for m in _METRICS
        )
        cells.setdefault(one["row"], {"": one["row"]})[one["source"]] = cell
    title = f"From raw pictures and events: {' / '.join(_METRICS)}, segments pooled (± over segments)"
    honest: dict[str, dict[str, Cell]] = {
        one["row"]: {
            "": one["row"],
            "ANEES": one["nees"]["anees"],
            "within 95 % ellipses (%)": 100.0 * one["nees"]["coverage"],
            "boxes": one["nees"]["matched"],
        }
        for one in result["records"]
        if one["source"] == _ALL and one["nees"]
    }
    return {
        "raw": Table.from_records(list(cells.values()), ["", *sources], title=title),
        "raw-honesty": Table.from_records(
            list(honest.values()),
            title="Errors of position against what is said of them, all data (ANEES 1 and 95 % are right)",
            digits={"within 95 % ellipses (%)": 1},
        ),
    }
