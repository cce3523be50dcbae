"""Filter against smoother on the road, in metres and km/h: where they differ, and whether both are honest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.eval.compare import Comparison
from jeat_graph.eval.road import RoadErrors, RoadJudging, judge_road, read_road_tracks, read_road_truth
from jeat_graph.eval.tables import Cell, Table

#: Tables of a run on the road, by the estimator that made them.
TABLES = {"filter": "road_causal.csv", "smoothed": "road_smoothed.csv"}
#: What the simulator calls the truth on the road, beside that in the picture.
TRUTH = "gt_road.csv"
#: Places along the road between which errors are counted together (m).
PLACES_M = (20.0, 40.0, 60.0, 80.0, 100.0)
_TIME_S = 1e-6
_SHOWN = {
    "across m": "across_rmse_m",
    "along m": "along_rmse_m",
    "speed km/h": "speed_rmse_kmh",
    "median error km/h": "speed_median_kmh",
    "NEES": "nees",
    "speed NEES": "speed_nees",
    "held across": "across_held",
    "held along": "along_held",
    "held speed": "speed_held",
}
_DIGITS = {"held across": 1, "held along": 1, "held speed": 1}


class RoadComparison(NamedTuple):
    """Filter and smoother on the road.

    Attributes:
        values: all figures, ready for JSON.
        tables: the same for people.
    """

    values: dict[str, Any]
    tables: list[Table]


def road_truth_beside(run: str | Path, truth: str | Path | None) -> Path | None:
    """Return the truth on the road beside that in the picture, where the run has tables of the road."""
    if truth is None or not all((Path(run) / name).is_file() for name in TABLES.values()):
        return None
    found = Path(truth).parent / TRUTH
    return found if found.is_file() else None


def with_road(comparison: Comparison, run: str | Path, truth: str | Path | None) -> Comparison:
    """Return a comparison with that on the road too (`road` in its values), if there is truth for it.

    Raises:
        DataError: as `compare_road`.
    """
    if truth is None:
        return comparison
    on_road = compare_road(run, truth)
    values = {**comparison.values, "road": on_road.values}
    return replace(comparison, values=values, tables=[*comparison.tables, *on_road.tables])


def compare_road(run: str | Path, truth: str | Path, config: RoadJudging | None = None) -> RoadComparison:
    """Judge both tables of the road, over all of their rows, and over those that both have.

    The filter has no row before a track is confirmed, and states no speed before it knows one: only the same
    rows say which of the two is better.

    Args:
        run: a run directory with the tables of the road.
        truth: on the road.
        config: which rows count, by default those of `RoadJudging`.

    Raises:
        DataError: a table is missing, or a file is not valid.
    """
    true, settings = read_road_truth(truth), config or RoadJudging()
    missing = next((name for name in TABLES.values() if not (Path(run) / name).is_file()), None)
    if missing is not None:
        raise DataError(f"holds no {missing}: track with --camera, and with a smoother", run)
    errors = {
        name: judge_road(read_road_tracks(Path(run) / file), true, settings) for name, file in TABLES.items()
    }
    same = shared_rows(errors["filter"], errors["smoothed"])
    values: dict[str, Any] = {name: one.scores() for name, one in errors.items()}
    values["same_rows"] = {name: one.scores() for name, one in same.items()}
    values["by_distance"] = []
    for low, high in pairwise(PLACES_M):
        parts = {name: one.take((one.along >= low) & (one.along < high)) for name, one in same.items()}
        if len(parts["filter"].error):
            scores = {name: one.scores() for name, one in parts.items()}
            values["by_distance"].append({"from_m": low, "to_m": high, **scores})
    return RoadComparison(values, _tables(values, settings))


def shared_rows(causal: RoadErrors, smoothed: RoadErrors) -> dict[str, RoadErrors]:
    """Rows of the same track and time in both, at which both state a speed, in the same order."""
    row_type = [("track_id", np.int64), ("t", np.int64)]
    keys = []
    for one in (causal, smoothed):
        keys.append(np.empty(len(one.t), dtype=row_type))
        keys[-1]["track_id"], keys[-1]["t"] = one.track_id, np.rint(one.t / _TIME_S)
    shared: tuple[Any, IntArray, IntArray] = np.intersect1d(
        keys[0], keys[1], assume_unique=True, return_indices=True
    )
    _, first, second = shared
    known = np.isfinite(causal.error[first, 2]) & np.isfinite(smoothed.error[second, 2])
    rows: tuple[IntArray, IntArray] = (first[known], second[known])
    return {"filter": causal.take(rows[0]), "smoothed": smoothed.take(rows[1])}


def _tables(values: Mapping[str, Any], config: RoadJudging) -> list[Table]:
    def record(label: str, scores: Mapping[str, float | int]) -> dict[str, Cell]:
        return {"estimator": label, "rows": scores["rows"], **{k: scores.get(v) for k, v in _SHOWN.items()}}

    whole = [record(f"{name}, all rows", values[name]) for name in TABLES]
    whole += [record(f"{name}, same rows", values["same_rows"][name]) for name in TABLES]
    span = f"{config.near_m:g} to {config.far_m:g} m"
    title = f"On the road, {span}: RMSE; NEES should be 1; held: % of errors inside the 95 % interval"
    tables = [Table.from_records(whole, title=title, digits=_DIGITS)]
    records: list[dict[str, Cell]] = []
    for one in values["by_distance"]:
        row: dict[str, Cell] = {
            "place": f"{one['from_m']:g} to {one['to_m']:g} m",
            "rows": one["filter"]["rows"],
        }
        for label in ("across m", "along m", "speed km/h", "held speed"):
            for name in TABLES:
                row[f"{label} {name}"] = one[name].get(_SHOWN[label])
        records.append(row)
    if records:
        digits = {f"held speed {name}": 1 for name in TABLES}
        tables.append(
            Table.from_records(records, title="On the road, by distance (same rows)", digits=digits)
        )
    return tables
