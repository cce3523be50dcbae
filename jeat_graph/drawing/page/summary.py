"""Makes the page's tables of numbers: scores, counts, consistency, the list of tracks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.diagnostics import NIS_FREEDOM
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.consistency import chi2_bounds
from jeat_graph.eval.judge import ERRORS, breakdown_tables, summary_table
from jeat_graph.eval.tables import Cell, Table
from jeat_graph.runs.recorded import RunData, parts_of_tracks, rows_of_tracks

ERRORS_TITLE = "Errors of matched tracks"


def nis_interval() -> tuple[float, float]:
    """Interval in which 95 % of single NIS of two degrees of freedom lie: −2 ln .975 to −2 ln .025."""
    return float(-2.0 * np.log(0.975)), float(-2.0 * np.log(0.025))


def score_tables(data: RunData) -> list[Table]:
    """Scores of both tables as `eval` prints them, then by groups; empty without truth."""
    if not data.judged:
        return []
    whole = summary_table(data.judged)
    errors = [name for name in whole.columns if name in ERRORS]
    others = [name for name in whole.columns if name not in ERRORS]
    tables = [_columns(whole, others)]
    if errors:
        # In two tables, so that neither is wider than a page.
        tables.append(replace(_columns(whole, ["table", *errors]), title=ERRORS_TITLE))
    return [*tables, *breakdown_tables(data.judged)]


def _columns(table: Table, names: Sequence[str]) -> Table:
    places = [table.columns.index(name) for name in names]
    rows = tuple(tuple(row[k] for k in places) for row in table.rows)
    return Table(tuple(names), rows, table.title, table.digits)


def most_informative(data: RunData, among: Sequence[int]) -> int:
    """Choose the track to be shown first: the one that goes furthest in the picture, not a parked car.

    Args:
        data: the run.
        among: identities to choose from, at least one.
    """
    table = data.causal if data.causal is not None else data.smoothed
    assert table is not None
    wanted = set(among)
    way = {
        track_id: float(np.hypot(*np.ptp(table.mean[rows, :2], axis=0)))
        for track_id, rows in rows_of_tracks(table.track_id, table.t).items()
        if track_id in wanted
    }
    return max(way or dict.fromkeys(among, 0.0), key=lambda track_id: (way.get(track_id, 0.0), -track_id))


def count_table(data: RunData) -> Table:
    """How many tracks and rows each table has, and how long the tracks live."""
    records: list[dict[str, Cell]] = []
    for kind, table in (("causal", data.causal), ("smoothed", data.smoothed)):
        if table is None:
            continue
        lives = _lives(table)
        records.append(
            {
                "table": kind,
                "tracks": len(lives),
                "rows": len(table),
                "shortest (s)": float(lives.min()) if len(lives) else None,
                "median life (s)": float(np.median(lives)) if len(lives) else None,
                "longest (s)": float(lives.max()) if len(lives) else None,
                "rows without any detection (%)": _coasting(table),
            }
        )
    return Table.from_records(records, title="Tracks")


def _lives(table: Trajectories) -> FloatArray:
    parts = rows_of_tracks(table.track_id, table.t).values()
    return np.array([table.t[rows[-1]] - table.t[rows[0]] for rows in parts])


def _coasting(table: Trajectories) -> float | None:
    if not len(table) or not table.sensors:
        return None
    return 100.0 * float((table.used == 0).mean())


def sensor_table(data: RunData) -> Table | None:
    """Consistency of the reported tracks' updates by sensor; None without diagnostics."""
    if data.diagnostics is None:
        return None
    low, high = nis_interval()
    reported = np.isin(data.diagnostics.track_id, data.track_ids())
    records: list[dict[str, Cell]] = []
    for k, name in enumerate(data.diagnostics.sensors):
        mine = data.diagnostics.take(reported & (data.diagnostics.sensor == k))
        nis = mine.nis[np.isfinite(mine.nis)]
        expected = chi2_bounds(len(nis), NIS_FREEDOM)
        scale = mine.noise_scale
        records.append(
            {
                "sensor": name,
                "updates": len(mine),
                "mean NIS / 2": float(nis.mean()) / NIS_FREEDOM if len(nis) else None,
                "expected (95 %)": f"{expected[0]:.3f} to {expected[1]:.3f}" if len(nis) else "–",
                "NIS within 95 % bounds (%)": 100.0 * float(((nis >= low) & (nis <= high)).mean())
                if len(nis)
                else None,
                "median s": float(np.median(scale)) if len(scale) else None,
                "5 % of s below": float(np.quantile(scale, 0.05)) if len(scale) else None,
                "95 % of s below": float(np.quantile(scale, 0.95)) if len(scale) else None,
            }
        )
    digits = {"mean NIS / 2": 3, "NIS within 95 % bounds (%)": 1}
    return Table.from_records(records, title="Consistency by sensor", digits=digits)


def link_table(data: RunData) -> Table | None:
    """One row for each gap over which causal tracks were joined to one identity; None without decisions."""
    if data.links is None:
        return None
    links = data.links.between_tracks()
    terms = links.shown_terms()
    records: list[dict[str, Cell]] = [
        {
            "identity": int(links.track_id[k]),
            "from track": int(links.tail[k]),
            "to track": int(links.head[k]),
            "from (s)": float(links.t_tail[k]),
            "to (s)": float(links.t_head[k]),
            "gap (s)": float(links.t_head[k] - links.t_tail[k]),
            "probability": float(links.probability[k]),
            "log ratio": float(links.log_ratio[k]),
            **{name: float(values[k]) for name, values in terms.items()},
        }
        for k in range(len(links.tail))
    ]
    digits = {"probability": 2} | dict.fromkeys(("log ratio", *terms), 1)
    return Table.from_records(records, title="Causal tracks that were joined", digits=digits)


def track_table(data: RunData) -> Table:
    """One row a track: when it lived, what saw it, how well that fitted."""
    causal = parts_of_tracks(data.causal)
    smoothed = parts_of_tracks(data.smoothed)
    noted = {}
    if data.diagnostics is not None:
        noted = rows_of_tracks(data.diagnostics.track_id, data.diagnostics.t)
    records: list[dict[str, Cell]] = []
    for track_id in data.track_ids().tolist():
        mine = causal.get(track_id) or smoothed[track_id]
        both = [part.t for part in (causal.get(track_id), smoothed.get(track_id)) if part is not None]
        first, last = min(float(t[0]) for t in both), max(float(t[-1]) for t in both)
        record: dict[str, Cell] = {
            "track": track_id,
            "from (s)": first,
            "to (s)": last,
            "life (s)": last - first,
        }
        for k, name in enumerate(mine.sensors):
            record[f"{name} rows"] = int((mine.used >> k & 1).sum())
        record["coasting (%)"] = _coasting(mine)
        if data.diagnostics is not None:
            rows = data.diagnostics.take(noted.get(track_id, np.zeros(0, dtype=np.int64)))
            for k, name in enumerate(data.diagnostics.sensors):
                nis, scale = rows.nis[rows.sensor == k], rows.noise_scale[rows.sensor == k]
                nis = nis[np.isfinite(nis)]
                record[f"{name} NIS / 2"] = float(nis.mean()) / NIS_FREEDOM if len(nis) else None
                record[f"{name} last s"] = float(scale[-1]) if len(scale) else None
        records.append(record)
    return Table.from_records(records, title="All tracks", digits={"coasting (%)": 1})
