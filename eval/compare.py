"""Filter against smoothers: what delay buys, where the errors are, and whether the covariances are honest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.progress import progress_span
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.consistency import consistency
from jeat_graph.eval.samples import (
    RECENT_S,
    Samples,
    WholeTrack,
    by_availability,
    by_distance,
    by_height,
    collect_samples,
    errors_of,
    lag_name,
    with_centres,
)
from jeat_graph.eval.tables import Cell, Table
from jeat_graph.smoothers.filtered_track import FilteredTrack

#: Lags of the curve (s).
LAGS_S = (0.0, 0.1, 0.2, 0.5, 1.0)

# Share of the work that judging without truth is, where there is truth too.
_CONSISTENCY = 0.3
# What tables call the smoother of whole tracks; its key in the values is `full`.
_WHOLE = "whole track"
# The same by GTSAM, as `smoother.engine` calls it.
_GTSAM = "gtsam-full"
_UNITS = "px, px/s, px/s²"
# What true places alone show of an estimator.
_OF_PLACES = ("estimator", "position", "position/filter", "ANEES position")


@dataclass(frozen=True, eq=False)
class Comparison:
    """The result: tables to read, values for JSON, and the samples to draw.

    Attributes:
        values: all figures, ready for JSON.
        tables: the same for people.
        samples: single errors, None without truth.
        lags_s: lags of the curve (s).
    """

    values: dict[str, Any]
    tables: list[Table]
    samples: Samples | None
    lags_s: tuple[float, ...] = field(default=LAGS_S)


def compare(
    tracks: Sequence[FilteredTrack],
    sensors: Sequence[str],
    *,
    truth: GroundTruth | None = None,
    causal: Trajectories | None = None,
    instants: FloatArray | None = None,
    lags_s: Sequence[float] = LAGS_S,
    image: tuple[float, float] | None = None,
    gtsam: bool = False,
) -> Comparison:
    """Compare the filter, the smoother at several lags, and the smoother of whole tracks.

    All of them see the same measurements, those that the tracker accepted.

    Args:
        tracks: tracks, as the filter went through them.
        sensors: names of the sensors.
        truth: true boxes; without them only consistency is judged. Where they have no motion, positions are
            judged by their centres, and velocities and accelerations are not.
        causal: the causal table, which decides what track is matched to what object at what time.
        instants: all times at which the tracker gave output (s), if known.
        lags_s: lags (s); 0 is the filter.
        image: width and height of the picture (px): what its edges cut has no place of its own.
        gtsam: whether GTSAM smooths whole tracks, too, for a row beside that of our own pass.
    """
    lags = tuple(sorted(set(lags_s)))
    values: dict[str, Any] = {"tracks": len(tracks), "sensors": list(sensors)}
    with progress_span(0.0, _CONSISTENCY):
        values["consistency"], table = consistency(tracks)
    tables = [table]
    samples = None
    if truth is not None and causal is not None:
        truth = with_centres(truth, image)
        with progress_span(_CONSISTENCY, 1.0):
            others = _by_gtsam() if gtsam else None
            everything = collect_samples(tracks, truth, causal, lags, instants=instants, others=others)
        samples = everything.uncut()
        if len(samples):
            errors = {name: errors_of(samples, name) for name in samples.states}
            values["errors"] = errors
            values["lag_curve"] = [{"lag_s": lag, **errors[lag_name(lag)]} for lag in lags]
            values["by_availability"] = _by_group(samples, by_availability(samples, sensors))
            tables.insert(0, _error_table(errors, samples.has_motion))
            by_sensors = f"By the sensors that detected the track in the last {RECENT_S:g} s"
            tables.append(_group_table(values["by_availability"], by_sensors, samples.has_motion))
            _add_near_and_far(values, tables, samples, everything)
    return Comparison(values, tables, samples, lags)


def _add_near_and_far(
    values: dict[str, Any], tables: list[Table], uncut: Samples, everything: Samples
) -> None:
    """Add errors by distance, or by height where no distance is known: of uncut objects, and of all."""
    for samples, suffix, who in ((uncut, "", "uncut objects"), (everything, "_all", "all objects")):
        if suffix and not everything.cut.any():
            continue
        groups, key = by_distance(samples), "by_distance"
        if groups is None:
            groups, key = by_height(samples), "by_height"
        values[key + suffix] = _by_group(samples, groups)
        title = f"{key.replace('_', ' ').capitalize()}, {who}"
        tables.append(_group_table(values[key + suffix], title, samples.has_motion))


def _by_gtsam() -> dict[str, WholeTrack]:
    from jeat_graph.smoothers.gtsam.solvers import solve_whole

    return {_GTSAM: solve_whole}


def _by_group(samples: Samples, groups: dict[str, BoolArray]) -> list[dict[str, Any]]:
    """Errors of filter and full smoother in each group that is not empty."""
    return [
        {"group": label, **{name: errors_of(samples, name, rows) for name in ("filter", "full")}}
        for label, rows in groups.items()
        if rows.any()
    ]


def _error_table(errors: dict[str, dict[str, float]], motion: bool) -> Table:
    base = errors["filter"]
    records: list[dict[str, Cell]] = []
    for name, one in errors.items():
        if name == lag_name(0.0):
            continue
        record: dict[str, Cell] = {
            "estimator": {"full": _WHOLE, _GTSAM: f"{_WHOLE}, GTSAM"}.get(name, name),
            "position": one["position_rmse"],
            "velocity": one["velocity_rmse"],
            "acceleration": one["acceleration_rmse"],
            "position/filter": one["position_rmse"] / base["position_rmse"],
            "velocity/filter": one["velocity_rmse"] / base["velocity_rmse"],
            "ANEES position": one["anees_position"],
            "ANEES velocity": one["anees_velocity"],
            "ANEES acceleration": one["anees_acceleration"],
            "ANEES state": one["anees_state"],
        }
        records.append(record if motion else {key: record[key] for key in _OF_PLACES})
    bounds = f"{base['anees_low']:.3f} to {base['anees_high']:.3f}"
    units = _UNITS if motion else "px"
    return Table.from_records(
        records,
        title=f"RMSE ({units}) at {int(base['count'])} instants; ANEES should be 1 (95 %: {bounds})",
    )


def _group_table(groups: Sequence[dict[str, Any]], title: str, motion: bool) -> Table:
    kinds = ("position", "velocity", "acceleration") if motion else ("position",)
    records: list[dict[str, Cell]] = []
    for one in groups:
        for name, label in (("filter", "filter"), ("full", _WHOLE)):
            record: dict[str, Cell] = {
                "group": one["group"],
                "instants": int(one[name]["count"]),
                "estimator": label,
            }
            record |= {part: one[name][f"{part}_rmse"] for part in kinds}
            record |= {f"ANEES {part}": one[name][f"anees_{part}"] for part in kinds}
            records.append(record)
    return Table.from_records(records, title=f"{title} (RMSE in {_UNITS if motion else 'px'})")
