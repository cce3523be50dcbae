"""Writes a simulated corridor: a folder for each camera as `road` writes it, and who was who."""

from __future__ import annotations

from pathlib import Path
from string import ascii_uppercase

import numpy as np
import yaml

from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.io.tables.table_writer import write_columns
from jeat_graph_sehn.simulation.corridor.cameras import CameraErrors, Seen, see, write_seen
from jeat_graph_sehn.simulation.corridor.traffic import KINDS, CorridorTraffic, Driven, drive

#: The clocks of all cameras but the first are off by at most so much (s).
_CLOCK_S = 60.0


def simulate_corridor(
    config: CorridorTraffic, seed: int, errors: CameraErrors | None = None
) -> tuple[Driven, list[Seen], list[float]]:
    """Return the traffic, what each camera says, and how far each clock is ahead of the first (s)."""
    errors = errors or CameraErrors()
    driven = drive(config, np.random.default_rng([seed, 0]))
    rng = np.random.default_rng([seed, 1])
    clocks = [0.0, *rng.uniform(-_CLOCK_S, _CLOCK_S, len(config.places_m) - 1).round(3).tolist()]
    return driven, [see(driven, k, clock, errors, rng) for k, clock in enumerate(clocks)], clocks


def write_corridor_world(config: CorridorTraffic, seed: int, out: Path) -> list[Path]:
    """Simulate and write; return the cameras' folders.

    Beside them stand `truth.csv` (camera, track_id, vehicle, true time, class; vehicle −1 is nothing) and
    `corridor_truth.yaml` (distances and clocks).
    """
    errors = CameraErrors()
    driven, seen, clocks = simulate_corridor(config, seed, errors)
    names = [ascii_uppercase[k] if k < len(ascii_uppercase) else f"C{k}" for k in range(len(seen))]
    out.mkdir(parents=True, exist_ok=True)
    folders = [out / name for name in names]
    for one, folder in zip(seen, folders, strict=True):
        write_seen(one, folder, errors)
    parts = []
    for k, one in enumerate(seen):
        real = one.vehicle >= 0
        parts.append(
            {
                "camera": np.full(len(one.t), names[k]),
                "track_id": np.arange(1, len(one.t) + 1),
                "vehicle": one.vehicle,
                "t_true": np.where(real, np.round(driven.t[one.vehicle, k], 4), np.nan),
                "class": np.where(real, np.array(KINDS)[driven.kind[one.vehicle]], ""),
            }
        )
    write_columns(
        {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}, out / "truth.csv"
    )
    truth = {
        "places_m": dict(zip(names, map(float, config.places_m), strict=True)),
        "clock_s": dict(zip(names, clocks, strict=True)),
    }
    with open_atomic(out / "corridor_truth.yaml") as file:
        yaml.safe_dump(truth, file, sort_keys=False)
    return folders
