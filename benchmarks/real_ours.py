"""Our tracker on the real sets: without calibration, calibrated blindly, and calibrated with truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from benchmarks.real_sets import RealSet
from benchmarks.recordings import JudgedRecording
from jeat_graph.config.reading import load_config
from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.runs.declaring import fit_input, own_picture
from jeat_graph.runs.latency import at_measurement
from jeat_graph.tracking.whole import both_tables

DEFAULT, BLIND, TRUTH = "default", "calibrated blindly", "calibrated with truth"


@dataclass(frozen=True)
class OursOnSet:
    """One row: our tracker, in one dress, on one set.

    Attributes:
        row: its name.
        sensors: what it is given.
        how: `DEFAULT`, `BLIND` or `TRUTH`; calibration is on the other half of the set's recordings.
        changes: `key=value` texts over the preset.
        white: whether the sensors' errors are taken to have no memory.
    """

    row: str
    sensors: tuple[str, ...]
    how: str = DEFAULT
    changes: tuple[str, ...] = ()
    white: bool = False


def rows_of(one: RealSet, calibrate: bool) -> list[OursOnSet]:
    """The rows of a set: each stream as it comes and calibrated, and all of them with parts switched off."""
    out = [OursOnSet(f"default, {' + '.join(s)}", s) for s in reversed(one.streams)]
    every = one.streams[-1]
    out.append(OursOnSet("default without NIS adaptation", every, changes=("noise.adaptation_rate=0.0",)))
    out.append(OursOnSet("default without errors with memory", every, white=True))
    out.append(OursOnSet("default, cut boxes taken for whole", every, changes=("image.edge_px=0.0",)))
    out.append(OursOnSet("default without disagreement", every, changes=("lifecycle.disagreement=0.0",)))
    if calibrate and len(one.recordings) > 1:
        out += [OursOnSet(how, every, how) for how in (BLIND, TRUTH)]
        out += [OursOnSet(f"{how}, {s[0]}", s, how) for s in one.streams[:-1] for how in (BLIND, TRUTH)]
    return out


def configs_for(row: OursOnSet, one: RealSet) -> list[Config]:
    """The configuration of each recording: calibrated ones never saw it."""
    base = load_config("default", row.changes)
    seen = [recording.only(row.sensors) for recording in one.recordings]
    if row.how == DEFAULT:
        fitted = [fit_input(base, detections)[0] for detections in seen]
        return [_without_memory(config) for config in fitted] if row.white else fitted
    whole = fit_input(base, *seen)[0]
    halves = [_calibrated(row, one, half, seen, whole) for half in range(2)]
    return [own_picture(halves[k % 2], detections) for k, detections in enumerate(seen)]


def _without_memory(config: Config) -> Config:
    sensors = {name: replace(s, correlated_share=0.0) for name, s in config.sensors.items()}
    return replace(config, sensors=sensors)


def _calibrated(row: OursOnSet, one: RealSet, half: int, seen: Sequence[Detections], base: Config) -> Config:
    """Calibrate for every other recording (from number `half` on) from those in between."""
    from jeat_graph.calibration.procedure import calibrate_with_truth, calibrate_without_truth

    others = [k for k in range(len(seen)) if k % 2 != half]
    if row.how == BLIND:
        return calibrate_without_truth([seen[k] for k in others], base).config
    pairs = [(seen[k], one.recordings[k].truth) for k in others]
    return calibrate_with_truth(pairs, base).config


def judge_row(row: OursOnSet, one: RealSet) -> dict[str, Any]:
    """Track a set and judge both tables, pooled and recording by recording."""
    configs = configs_for(row, one)
    recordings = tuple(
        replace(r, detections=at_measurement(r.detections, c))
        for c, r in zip(configs, one.recordings, strict=True)
    )
    one = replace(one, recordings=recordings)
    tables = [both_tables(c, r.only(row.sensors)) for c, r in zip(configs, one.recordings, strict=True)]
    return {
        "set": one.name,
        "row": row.row,
        "sensors": list(row.sensors),
        "how": row.how,
        "changes": list(row.changes),
        "causal": _scores(one.recordings, [causal for causal, _ in tables], row.sensors, "causal"),
        "smoothed": _scores(one.recordings, [smoothed for _, smoothed in tables], row.sensors, "smoothed"),
        "nees": {
            kind: _nees(one.recordings, [pair[k] for pair in tables], kind)
            for k, kind in enumerate(("causal", "smoothed"))
        },
        "by_recording": {
            r.name: _scores([r], [table], row.sensors, "causal")
            for r, (table, _) in zip(one.recordings, tables, strict=True)
        },
    }


def _scores(
    recordings: Sequence[JudgedRecording], tables: Sequence[Trajectories], sensors: Sequence[str], kind: Any
) -> dict[str, Any]:
    from jeat_graph.eval.metrics import evaluate

    pairs = [(r.truth, table) for r, table in zip(recordings, tables, strict=True)]
    instants = [r.instants(sensors) for r in recordings] if kind == "causal" else None
    return evaluate(pairs, kind=kind, instants=instants).as_dict()


def _nees(
    recordings: Sequence[JudgedRecording], tables: Sequence[Trajectories], kind: Any
) -> dict[str, float]:
    """Consistency of the position, and the share of the errors within 95 % ellipses."""
    from jeat_graph.eval.position_nees import position_nees

    found = position_nees([(r.truth, table) for r, table in zip(recordings, tables, strict=True)], kind)
    return {"anees": found.anees, "coverage": found.coverage} if found.matched else {}
