"""`python -m benchmarks clocks`: live streams of a rig in which one sensor's clock steps or drifts.

Thirty vehicles a minute drive both ways; a camera (20 Hz) and an event camera (50 Hz), whose clock the rig
knows, see them with a pixel of noise. MOTA is that of the answers, each at its own time.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import common
from benchmarks.provenance import provenance
from jeat_graph.api.functions import evaluate
from jeat_graph.config.reading import load_config
from jeat_graph.data.scan import Scan
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.tracker import Tracker

if TYPE_CHECKING:
    import pandas as pd

    from jeat_graph.eval.tables import Cell, Table

SENSORS = {"rgb": (20, 0.0), "evt": (50, 0.003)}
#: Of the event camera's clock, as the rig says it; when a clock steps; and length of a stream (s).
OFFSET_S, STEP_AT_S, SECONDS = 0.15, 24.0, 60.0
STEPS_S = (0.3, 1.0, 3.0, -0.3, -1.0, -3.0)
DRIFTS_PPM = (50.0, 200.0, 2000.0)
_EVERY_S, _WIDTH_PX = 2.0, 1920.0
_CONFIG = (
    *("image.width=1920", "image.height=1080", "smoother.engine=none"),
    *("sensors.rgb.rate_hz=20", "sensors.evt.rate_hz=50", f"sensors.evt.clock.offset_s={OFFSET_S}"),
)

Ahead = Callable[[float], float]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.declare(
        parser,
        "clocks",
        {"quick": "one step on one stream: to see that it runs", "seeds": "of the streams (1 2 3)"},
    )


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return common.measure_or_read(args, "clocks", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Track each stream without a step, and with each."""
    seeds = args.seeds or ([1] if args.quick else [1, 2, 3])
    rows = []
    for seed in seeds:
        scans, truth = draw(seed, 30.0 if args.quick else SECONDS)
        plain = mota(track(scans, "evt", lambda t: 0.0), truth)
        for kind, sensor, size, ahead in _cases(args.quick):
            cost = plain - mota(track(scans, sensor, ahead), truth)
            rows.append({"seed": seed, "kind": kind, "sensor": sensor, "size": size, "cost": cost})
    return {"benchmark": "clocks", **provenance({"seeds": list(seeds)}, {}), "clocks": rows}


def _cases(quick: bool) -> list[tuple[str, str, float, Ahead]]:
    """Return what befalls a clock: its kind, the sensor, how much, and how far it is ahead at a time (s)."""
    if quick:
        return [("step", "evt", 1.0, _step(1.0))]
    found = [("step", sensor, s, _step(s)) for sensor in ("evt", "rgb") for s in STEPS_S]
    return [*found, *(("drift", "evt", ppm, _drift(ppm)) for ppm in DRIFTS_PPM)]


def _step(step_s: float) -> Ahead:
    return lambda t: step_s * (t > STEP_AT_S)


def _drift(ppm: float) -> Ahead:
    return lambda t: 1e-6 * ppm * t


def draw(seed: int, seconds: float) -> tuple[list[tuple[float, Scan]], pd.DataFrame]:
    """Draw the scans of both sensors by their true times (s), and the truth at the camera's."""
    import pandas as pd

    rng = np.random.default_rng(seed)
    count = int(seconds / _EVERY_S) + 1
    speed = rng.uniform(200, 400, count) * np.where(np.arange(count) % 2, -1.0, 1.0)
    size = rng.uniform(0.7, 1.4, count)
    w, h, begin = 80.0 * size, 60.0 * size, _EVERY_S * np.arange(count)
    y = 300.0 + 250.0 * (np.arange(count) % 2)
    scans, truth = [], []
    for name, (rate, first) in SENSORS.items():
        for k in range(int(seconds * rate)):
            t = k / rate + first
            x = np.where(speed > 0, 0.0, _WIDTH_PX) + speed * (t - begin)
            seen = np.flatnonzero((t > begin - 1.0) & (x > w / 2) & (x < _WIDTH_PX - w / 2))
            boxes = np.column_stack([x - w / 2, y - h / 2, w, h])[seen]
            noisy = boxes + rng.normal(0, 1, boxes.shape) * [1.0, 1.0, 0.0, 0.0]
            scans.append((t, Scan(t, name, noisy, rng.uniform(0.55, 0.97, len(seen)))))
            if name == "rgb":
                truth += [(t, int(v), *box) for v, box in zip(seen, boxes.tolist(), strict=True)]
    columns = ["t", "object_id", "left", "top", "width", "height"]
    return sorted(scans, key=lambda pair: pair[0]), pd.DataFrame(truth, columns=columns)


def track(scans: list[tuple[float, Scan]], sensor: str, ahead: Ahead) -> Trajectories:
    """Return the answers of a live tracker to scans of which one sensor's clock is ahead of what is known."""
    live = LiveTracker(Tracker(load_config("default", list(_CONFIG))))
    answers: dict[float, Trajectories] = {}
    for true_s, scan in scans:
        late_s = OFFSET_S * (scan.sensor == "evt") + ahead(true_s) * (scan.sensor == sensor)
        found = live.step(Scan(round(true_s + late_s, 6), scan.sensor, scan.boxes, scan.scores))
        answers |= {t: table for t, table, _ in found.earlier} | {found.t: found.table}
    return Trajectories.concatenate([answers[t] for t in sorted(answers)])


def mota(table: Trajectories, truth: pd.DataFrame) -> float:
    """Return MOTA (per cent) of answers."""
    return float(evaluate(table, truth, outside="ignored")["causal"]["MOTA"])


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """The table of a result, by the name of its marker."""
    from jeat_graph.eval.tables import Table

    groups: dict[tuple[str, str, float], list[float]] = {}
    for row in result["clocks"]:
        groups.setdefault((row["kind"], row["sensor"], row["size"]), []).append(row["cost"])
    records: list[dict[str, Cell]] = []
    for (kind, sensor, size), costs in groups.items():
        what = f"step of {size:+g} s" if kind == "step" else f"drift of {size:g} ppm"
        records.append(
            {"clock of": sensor, "what": what, "MOTA lost, mean": float(np.mean(costs)), "most": max(costs)}
        )
    seeds = len({row["seed"] for row in result["clocks"]})
    return {"clocks": Table.from_records(records, title=f"Clocks that change in a stream, {seeds} streams")}
