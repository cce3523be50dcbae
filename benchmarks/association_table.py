"""One slot a sensor against joint and sequential association, from rows that are judged anyway.

Ways of association differ only where scans of several sensors share a timestamp. In the scenarios the clocks
jitter, so none do; that is why one more is simulated, in which both sensors run by one clock.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from benchmarks.common import over_seeds, scenario_cell
from benchmarks.contenders import Ours
from benchmarks.judging import HEADLINE, OursJob, in_processes, judge_ours, summarise

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

SYNCHRONOUS = "night-synchronous"


def judge_synchronous(
    rows: Sequence[Ours], seeds: Sequence[int], duration_s: float, workers: int | None
) -> list[dict[str, Any]]:
    """Judge the rows that differ in association where the sensors' clocks are one."""
    jobs = [
        OursJob(r.row, r.config, r.sensors, SYNCHRONOUS, seed, duration_s)
        for seed in seeds
        for r in rows
        if r.association
    ]
    return in_processes(judge_ours, jobs, workers, "association, one clock")


def association_names(rows: Sequence[Ours]) -> dict[str, str]:
    """Row of a table: the way of association it stands for."""
    return {r.row: r.association for r in rows if r.association}


def association_table(result: Mapping[str, Any]) -> Table | None:
    """Ways of association by scenario, with the real sequences pooled; None where they were not judged.

    Args:
        result: of `benchmarks accuracy`: `summary`, `association` (`names` by row, `records`), `kitti`.
    """
    from jeat_graph.eval.tables import Table

    if "association" not in result:
        return None
    names: Mapping[str, str] = result["association"]["names"]
    summary = [*result["summary"], *summarise(result["association"]["records"])]
    cells: dict[str, dict[str, Cell]] = {}
    for entry in summary:
        if entry["row"] in names:
            name = names[entry["row"]]
            cells.setdefault(name, {"": name})[entry["scenario"]] = scenario_cell(entry, HEADLINE)
    for record in result.get("kitti", ()):
        if record["row"] in names:
            pooled = {"seeds": 1, **record["scores"]}
            cells[names[record["row"]]]["KITTI"] = scenario_cell(pooled, HEADLINE)
    columns = list(dict.fromkeys(k for row in cells.values() for k in row))
    seeds = over_seeds(len(result["settings"]["seeds"]))
    title = f"Ways of association, both sensors: {' / '.join(HEADLINE)}, {seeds}"
    return Table.from_records(list(cells.values()), columns, title=title)
