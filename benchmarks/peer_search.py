"""Says which of the other trackers are installed, and searches for their best parameters."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.contenders import NAMES, SEARCH_DURATION_S, SEARCH_SEED, key, streams
from benchmarks.judging import METRICS, in_processes
from benchmarks.recordings import SCENARIOS, kitti, simulated
from jeat_graph.data.extras import install

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

_INSTALL = {
    "trackers": f"{install('baselines')} && pip install --no-deps trackers",
    "supervision": install("baselines"),
    "norfair": "pip install rich filterpy && pip install --no-deps norfair",
}


def peers_here() -> list[str]:
    """Names of the baselines whose packages are installed; a line on stderr says which are left out."""
    from benchmarks.baselines import missing_packages

    here, lacking = [], dict[str, list[str]]()
    for name, shown in NAMES.items():
        missing = missing_packages(name)
        if missing:
            lacking.setdefault(missing[0], []).append(shown)
        else:
            here.append(name)
    for package, left_out in lacking.items():
        print(
            f"the package {package} is not installed: {', '.join(left_out)} left out ({_INSTALL[package]})",
            file=sys.stderr,
        )
    return here


def recorded_best(name: str) -> dict[str, dict[str, Any]]:
    """Read what a search has found before: `peers/<name>.yaml`, by `contenders.key`."""
    import yaml

    file = resources.files("benchmarks") / "peers" / f"{name}.yaml"
    found: dict[str, dict[str, Any]] = yaml.safe_load(file.read_text(encoding="utf-8"))
    return found


def search_parameters(
    names: Sequence[str], sensors: Sequence[str], folder: Path | None, workers: int | None
) -> dict[str, dict[str, Any]]:
    """Search the grids of baselines on each stream.

    Args:
        names: baselines.
        sensors: sensors of the recordings.
        folder: of the KITTI sequences, which are searched as they are judged; None: simulated recordings,
            others than those that are judged.
        workers: processes.

    Returns:
        By `key(name, stream)`: `parameters` (of best MOTA; empty where the defaults are best), `default` and
        `best` (scores), `tried` (sets of parameters).
    """
    jobs = [(name, stream, folder) for stream in streams(sensors) for name in names]
    label = f"searching parameters, {'simulated' if folder is None else 'KITTI'}"
    found = in_processes(search_one, jobs, workers, label)
    return {key(name, stream): one for (name, stream, _), one in zip(jobs, found, strict=True)}


def search_one(job: tuple[str, tuple[str, ...], Path | None]) -> dict[str, Any]:
    """Search one baseline on one stream: (name, sensors, KITTI folder or None); see `search_parameters`."""
    from benchmarks.baselines import best_baseline

    name, sensors, folder = job
    if folder is None:
        recordings = [simulated(s, SEARCH_SEED, SEARCH_DURATION_S) for s in SCENARIOS]
    else:
        recordings = list(kitti(folder))
    found = best_baseline(name, [(r.truth, r.detections) for r in recordings], sensors)
    default = found.scores if found.default is None else found.default
    return {
        "parameters": dict(found.parameters),
        "default": default.as_dict(),
        "best": found.scores.as_dict(),
        "tried": found.tried,
    }


def search_table(found: dict[str, dict[str, Any]], title: str) -> Table:
    """Scores before and after a search, and what was found."""
    from jeat_graph.eval.tables import Table

    records: list[dict[str, Cell]] = []
    for name, one in found.items():
        before, after = one["default"], one["best"]
        record: dict[str, Cell] = {"": name}
        record |= {m: f"{before[m]:.1f} → {after[m]:.1f}" for m in METRICS}
        record["tried"] = one["tried"]
        record["best"] = ", ".join(f"{k} {v}" for k, v in one["parameters"].items()) or "defaults"
        records.append(record)
    return Table.from_records(records, title=title)
