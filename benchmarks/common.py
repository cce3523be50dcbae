"""What the benchmarks share: arguments, tables, files."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.judging import METRICS, fold_config, in_processes
from benchmarks.readme import update_readme
from benchmarks.recordings import DURATION_S, KITTI_SEQUENCES, SCENARIOS, SEEDS, find_kitti
from jeat_graph.config.argument_types import counting, natural, positive
from jeat_graph.config.reading import config_from_dict
from jeat_graph.config.schema import Config
from jeat_graph.data.errors import ConfigError, DataError

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Table

QUICK_SEEDS = (0,)
QUICK_DURATION_S = 8.0


#: What an argument takes, of those that several benchmarks have and each explains in its own words.
_OPTIONAL: Mapping[str, dict[str, Any]] = {
    "data": {"metavar": "DIR"},
    "seeds": {"nargs": "+", "type": natural, "metavar": "N"},
    "scenarios": {"nargs": "+", "metavar": "NAME"},
    "duration": {"type": positive, "metavar": "S"},
    "quick": {"action": "store_true"},
}


def declare(parser: argparse.ArgumentParser, name: str, texts: Mapping[str, str]) -> None:
    """Declare the arguments that every benchmark has, and of `_OPTIONAL` those that it has a text for.

    Args:
        parser: of the benchmark.
        name: of the files that it writes.
        texts: help of its optional arguments, by their names.
    """
    add = parser.add_argument
    add("--out", metavar="DIR", help=f"write {name}.json and {name}.md there")
    for option, text in texts.items():
        add(f"--{option}", help=text, **_OPTIONAL[option])
    add("--jobs", type=counting, metavar="N", help="processes (as many as there are processors)")
    add("--readme", metavar="FILE", help="renew the tables between the markers of this Markdown file")
    add("--from", dest="source", metavar="JSON", help="render the tables of an earlier result; run nothing")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of accuracy, ablation and smoothing."""
    texts = {
        "data": "folder that holds kitti/ (../shared/data)",
        "seeds": "of the simulated recordings (0 1 2 3 4)",
        "scenarios": f"simulated scenarios ({' '.join(SCENARIOS)})",
        "duration": f"of a simulated recording ({DURATION_S:g})",
        "quick": "one seed, 8 s, no real data: to see that it runs",
    }
    declare(parser, "NAME", texts)
    parser.add_argument(
        "--folds", metavar="JSON", help="take the leave-one-out configurations from an earlier result"
    )


def measure_or_read(
    args: argparse.Namespace,
    name: str,
    measure: Callable[[argparse.Namespace], dict[str, Any]],
    tables: Callable[[Mapping[str, Any]], Mapping[str, Table]],
) -> int:
    """Run a benchmark, or read what it found earlier (`--from`), then print and write its tables.

    Args:
        args: of the command.
        name: of the benchmark.
        measure: runs it.
        tables: makes tables, by the names of their markers, of what it found.

    Returns:
        The exit code.
    """
    result = earlier(args.source, name) if args.source else measure(args)
    publish(args, name, result, tables(result))
    return 0


def settings(args: argparse.Namespace) -> dict[str, Any]:
    """Seeds, scenarios and duration, with the defaults filled in.

    Raises:
        ConfigError: unknown scenario; or less than the published tables hold would take their places.
    """
    from jeat_graph_sehn.simulation.scenario import load_scenario

    less = [f"--{name}" for name in ("quick", "seeds", "scenarios", "duration") if getattr(args, name)]
    if args.readme and less:
        raise ConfigError(
            f"--readme replaces published tables, which hold {len(SEEDS)} seeds of {DURATION_S:g} s of all "
            f"scenarios; leave out {' '.join(less)}, or write to --out"
        )
    scenarios = tuple(args.scenarios or SCENARIOS)
    for name in scenarios:
        load_scenario(name)
    return {
        "scenarios": scenarios,
        "seeds": tuple(args.seeds or (QUICK_SEEDS if args.quick else SEEDS)),
        "duration_s": args.duration or (QUICK_DURATION_S if args.quick else DURATION_S),
    }


def kitti_folds(args: argparse.Namespace) -> tuple[Path, dict[str, Config]] | None:
    """Leave-one-out configurations of KITTI; None, with a line on stderr, where the data are missing."""
    if args.quick:
        print("--quick: the table on real data is left out", file=sys.stderr)
        return None
    folder = find_kitti(args.data)
    if folder is None:
        where = args.data or "../shared/data"
        print(f"no KITTI sequences in {where}/kitti: the table on real data is left out", file=sys.stderr)
        return None
    if args.folds:
        known = earlier(args.folds, None).get("kitti_configs", {})
        if set(known) != set(KITTI_SEQUENCES):
            raise DataError(f"{args.folds}: holds no leave-one-out configurations")
        return folder, {name: config_from_dict(known[name]) for name in KITTI_SEQUENCES}
    configs = in_processes(
        fold_config, [(folder, name) for name in KITTI_SEQUENCES], args.jobs, "calibrating, one left out"
    )
    return folder, dict(zip(KITTI_SEQUENCES, configs, strict=True))


def scenario_table(
    entries: Sequence[Mapping[str, Any]], title: str, metrics: Sequence[str] = METRICS
) -> Table:
    """One row a tracker, one column a scenario; see `scenario_cell`."""
    from jeat_graph.eval.tables import Cell, Table

    scenarios = list(dict.fromkeys(e["scenario"] for e in entries))
    cells: dict[str, dict[str, Cell]] = {}
    for e in entries:
        cells.setdefault(e["row"], {"": e["row"]})[e["scenario"]] = scenario_cell(e, metrics)
    return Table.from_records(list(cells.values()), ["", *scenarios], title=title)


def scenario_cell(entry: Mapping[str, Any], metrics: Sequence[str]) -> str:
    """Metrics joined by ` / `, each with its spread if there are several seeds.

    No spaces about ±, so that a narrow page breaks the cell between metrics, not within one.
    """
    several = entry["seeds"] > 1
    return " / ".join(f"{entry[m]:.1f}" + (f"±{entry[f'{m}_std']:.1f}" if several else "") for m in metrics)


def over_seeds(count: int) -> str:
    """How the numbers of a simulated table come about."""
    if count == 1:
        return "one seed"
    return f"mean of {count} seeds (± standard deviation over them)"


def pooled_table(entries: Sequence[Mapping[str, Any]], title: str) -> Table:
    """One row a tracker, one column a metric, for recordings whose scores are pooled."""
    from jeat_graph.eval.tables import Cell, Table

    columns = (*METRICS, "FP", "FN", "IDSW")
    records: list[dict[str, Cell]] = [
        {"": e["row"]} | {name: e["scores"][name] for name in columns} for e in entries
    ]
    return Table.from_records(records, title=title, digits=dict.fromkeys(METRICS, 1))


def publish(
    args: argparse.Namespace, name: str, result: Mapping[str, Any], tables: Mapping[str, Table]
) -> None:
    """Print tables, and write JSON, Markdown and the README's tables where asked.

    Args:
        args: of the command.
        name: of the benchmark.
        result: all that was measured.
        tables: by the name they have in the README's markers.
    """
    from jeat_graph.eval.tables import to_json
    from jeat_graph.io.atomic import open_atomic

    sys.stdout.write("\n".join(table.render("text") for table in tables.values()))
    markdown = {key: table.render("markdown") for key, table in tables.items()}
    if args.out and not args.source:
        folder = Path(args.out)
        with open_atomic(folder / f"{name}.json") as file:
            file.write(to_json(result))
        with open_atomic(folder / f"{name}.md") as file:
            file.write("\n".join(markdown.values()))
        print(f"written: {folder / name}.json, {name}.md", file=sys.stderr)
    if args.readme:
        found = update_readme(args.readme, markdown)
        print(f"{args.readme}: renewed {', '.join(found) or 'no table: it has no marker'}", file=sys.stderr)


def earlier(path: str, name: str | None) -> dict[str, Any]:
    """Read the JSON of an earlier benchmark.

    Raises:
        DataError: not a result of benchmark `name` (of any, if None).
    """
    try:
        result = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise DataError(f"{path}: cannot be read: {error}") from None
    kind = result.get("benchmark") if isinstance(result, dict) else None
    if kind is None or name not in (None, kind):
        raise DataError(f"{path}: is not a result of `python -m benchmarks {name or 'accuracy'}`")
    return dict(result)
