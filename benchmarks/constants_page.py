"""Tables and page of `python -m benchmarks constants`."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.choosing import TRIED
from benchmarks.judging import CAUSAL, HEADLINE, SMOOTHED
from benchmarks.leaving_out import (
    DIRECTION,
    LOST,
    NEAR,
    NEAR_SPREAD,
    NOTICED,
    SHIPPED,
    START_SPREAD,
    unnoticed,
)
from benchmarks.provenance import made_by
from jeat_graph.io.files.atomic import open_atomic

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

#: Fewer recordings do not tell a standard error.
_LEAST_RECORDINGS = 3
_SUM = "change of the sum"
_THREE = " / ".join(HEADLINE)
_HOW = f"""The [constants of the model](../method.md#results) were chosen with these recordings in view.
This page says how much that matters. All detectors of a set are tracked together, and scores are those of
`jeat-graph eval`, pooled over the recordings of a set. *The sum* is that of {", ".join(HEADLINE)} in
per cent, and constants are chosen by the sum of the causal tables. ± is the standard error by a bootstrap
over the recordings of each set; that of a change is paired, because both tables are drawn in the same way.
For a set it is given where there are three recordings or more, and is rough where they are few."""
_CHOOSING = f"""A chooser sees all sets but one. It judges every single move. Those that gain more than their
standard error, the best {TRIED} of them at most, are tried one after the other on top of those that were
taken before, and taken if they gain again. A move multiplies one constant (of a probability: its odds) by
one of the factors of the last table.

- *Near the shipped* has every constant moved at random, by {100 * (NEAR_SPREAD - 1):.0f} % at most: nothing
  speaks for either value. It is the mean over {{nearby}} such points, and what *as shipped* has over it is
  luck, which choosing among many values by their scores collects.
- *Chosen without this set, from the shipped* is a check of direction. It begins at constants that were
  chosen with the set in view, so it cannot say how good they would be without it. It says whether the
  other sets pull away from it."""
_STARTS = f"""- *Random start* multiplies the {{most}} constants that matter most by random factors between
  1/{START_SPREAD:g} and {START_SPREAD:g}. *Chosen without this set, from there* is what the same search
  reaches: it knows the values of these constants from the other sets alone. Which constants these are, and
  the values of all others, come from all sets.
- *Chosen with it, from there* is the same search from the same start on all sets. What it has over the row
  before is what a chooser gains on a set by seeing it.

The constants of the random starts: {{names}}. Starts: {{starts}}{{averaged}}."""


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of a result, by their names: `constants-mean`, `-sets`, `-direction`, `-influence`."""
    return {
        "constants-mean": _mean(result["rows"]),
        "constants-sets": _sets(result["rows"]),
        "constants-direction": _direction(result),
        "constants-influence": _influence(result["singles"]),
    }


def _mean(rows: Sequence[Mapping[str, Any]]) -> Table:
    from jeat_graph.eval.tables import Table

    out: list[dict[str, Cell]] = []
    for label in dict.fromkeys(row["label"] for row in rows):
        mine = [row for row in rows if row["label"] == label]
        line: dict[str, Cell] = {"constants": label}
        for kind in (CAUSAL, SMOOTHED):
            mean = [sum(row[kind]["scores"][k] for row in mine) / len(mine) for k in range(len(HEADLINE))]
            line[f"{kind} {_THREE}"] = " / ".join(f"{x:.1f}" for x in mean)
            if label != SHIPPED:
                change = sum(row[kind]["change"] for row in mine) / len(mine)
                errors = [row[kind]["change_error"] for row in mine]
                error = math.sqrt(sum(e**2 for e in errors if e is not None and math.isfinite(e))) / len(mine)
                line[f"{kind}, {_SUM}"] = f"{change:+.1f}±{error:.1f}"
            else:
                line[f"{kind}, {_SUM}"] = None
        out.append(line)
    return Table.from_records(out, title="Mean over the sets")


def _sets(rows: Sequence[Mapping[str, Any]]) -> Table:
    from jeat_graph.eval.tables import Table

    out: list[dict[str, Cell]] = []
    for row in rows:
        line: dict[str, Cell] = {"set": row["set"], "constants": row["label"]}
        few = row["recordings"] < _LEAST_RECORDINGS
        for kind in (CAUSAL, SMOOTHED):
            one = row[kind]
            errors = [None] * len(HEADLINE) if few else one["std_errors"]
            cells = [_with_error(x, e) for x, e in zip(one["scores"], errors, strict=True)]
            line[f"{kind} {_THREE}"] = " / ".join(cells)
            changed = _with_error(one["change"], None if few else one["change_error"], "+")
            line[f"{kind}, {_SUM}"] = None if row["label"] == SHIPPED else changed
        out.append(line)
    return Table.from_records(out, title="Each set, by constants that were chosen with it and without it")


def _with_error(value: float, error: float | None, sign: str = "") -> str:
    measured = error is not None and math.isfinite(error)
    return f"{value:{sign}.1f}" + (f"±{error:.1f}" if measured else "")


def _direction(result: Mapping[str, Any]) -> Table:
    from jeat_graph.eval.tables import Table

    rows = {row["set"]: row for row in result["rows"] if row["label"] == DIRECTION}
    out: list[dict[str, Cell]] = []
    for one in result["direction"]:
        row = rows[one["set"]]
        few = row["recordings"] < _LEAST_RECORDINGS
        out.append(
            {
                "set left out": one["set"],
                "moves": one["tried"],
                "that gain by themselves": one["gained"],
                "taken": _listed(one["moves"]),
                "change on the others": _with_error(one["others"], one["others_error"], "+"),
                "change on this set": _with_error(
                    row[CAUSAL]["change"], None if few else row[CAUSAL]["change_error"], "+"
                ),
            }
        )
    return Table.from_records(out, title="Moves from the shipped constants, chosen without a set")


def _listed(moves: Sequence[str]) -> str:
    counted = Counter(moves)
    return "; ".join(f"{one}, {n} times" if n > 1 else one for one, n in counted.items()) or "none"


def _influence(singles: Sequence[Mapping[str, Any]]) -> Table:
    from jeat_graph.eval.tables import Table

    factors = sorted({row["factor"] for row in singles})
    by_name: dict[str, dict[float, Mapping[str, Any]]] = {}
    for row in singles:
        by_name.setdefault(row["name"], {})[row["factor"]] = row
    ordered = sorted(by_name, key=lambda name: (-max(abs(r["change"]) for r in by_name[name].values()), name))
    out: list[dict[str, Cell]] = []
    for name in ordered:
        mine = by_name[name]
        line: dict[str, Cell] = {"constant": f"`{name}`", "value": f"{next(iter(mine.values()))['value']:g}"}
        for factor in factors:
            line[f"× {factor:g}"] = _with_error(mine[factor]["change"], mine[factor]["std_error"], "+")
        worst, group, factor = min(
            (change, group, factor) for factor, row in mine.items() for group, change in row["by_set"].items()
        )
        losing = {g for row in mine.values() for g, change in row["by_set"].items() if change < -LOST}
        line["greatest loss of a set"] = f"{worst:+.1f} {group} (× {factor:g})" if worst < 0.0 else None
        line[f"sets that lose more than {LOST:g}"] = len(losing)
        out.append(line)
    return Table.from_records(
        out, title="Change of the sum over all sets, of one constant moved alone (causal)"
    )


def write_page(path: Path, result: Mapping[str, Any], found: Mapping[str, Table]) -> None:
    """Write the page.

    Args:
        path: of the page.
        result: what was measured.
        found: its tables.
    """
    shown = {key: table.render("markdown").strip() for key, table in found.items()}
    count, starts = len({row["name"] for row in result["singles"]}), len(result["random"])
    how = _CHOOSING.format(nearby=result["settings"]["nearby"])
    if starts:
        how += "\n" + _STARTS.format(
            most=len(result["searched"]),
            names=", ".join(f"`{name}`" for name in result["searched"]),
            starts=starts,
            averaged=", over which scores are averaged" if starts > 1 else "",
        )
    parts = [
        "# Constants",
        made_by(result),
        _HOW,
        "## Chosen without a set",
        how,
        f"Sweeps of a search over all moves: {result['settings']['sweeps']}.",
        shown["constants-mean"],
        _scatter(result["rows"]),
        shown["constants-sets"],
        shown["constants-direction"],
        "## What each constant does",
        f"{count} constants are moved: those that are single numbers, but for counts, and but for these, "
        "which are no part of what the model says: "
        + "; ".join(f"`{name}` ({why})" for name, why in result["left_out"].items())
        + ".",
        _noticed(result["singles"]),
        shown["constants-influence"],
    ]
    with open_atomic(path) as file:
        file.write("\n\n".join(parts) + "\n")


def _scatter(rows: Sequence[Mapping[str, Any]]) -> str:
    measured = ", ".join(f"{row['set']} {row[CAUSAL]['spread']:.1f}" for row in rows if row["label"] == NEAR)
    return f"Over the points near the shipped, the standard deviation of a set's sum (causal) is: {measured}."


def _noticed(singles: Sequence[Mapping[str, Any]]) -> str:
    names = unnoticed([dict(row) for row in singles])
    listed = ", ".join(f"`{name}`" for name in names) if names else "none"
    return (
        f"No set notices these at any of the factors (its sum changes by less than {NOTICED:g}, causal and "
        f"smoothed), so they are candidates for removal: {listed}."
    )
