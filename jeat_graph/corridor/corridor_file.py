"""`corridor.yaml`: what was found out about the gaps of a corridor, and what the next run may begin with."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from jeat_graph.config.yaml_text import load_yaml
from jeat_graph.corridor.corridor_tables import Corridor
from jeat_graph.corridor.handover import Handover, KnownGap
from jeat_graph.corridor.learnt_gap import LearntGap, learnt_gap, model_tree
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.files.atomic import open_atomic

_DIGITS = 6


def write_corridor(corridor: Corridor, path: str | Path, notes: Sequence[str] = ()) -> None:
    """Write a corridor; `notes` become comments at the head of the file."""
    tree: dict[str, Any] = {
        "cameras": {
            name: {"line": corridor.cameras[name].line, "vehicles": len(corridor.cameras[name])}
            for name in corridor.order
        },
        "gaps": [_gap_tree(over) for over in corridor.handovers],
    }
    with open_atomic(path) as file:
        file.writelines(f"# {line}\n" for line in notes)
        yaml.safe_dump(tree, file, sort_keys=False, default_flow_style=None, width=110, allow_unicode=True)


def _gap_tree(over: Handover) -> dict[str, Any]:
    fitted, p = over.fitted, over.fitted.parameters
    slow = np.bincount(fitted.pairs.i, fitted.marginals.pair, len(fitted.slowness))
    tree: dict[str, Any] = {
        "from": over.known.first,
        "to": over.known.second,
        "offset_s": _short(p.offset_s),
        "distance_m": _short(p.distance_m),
        "covariance_of": ["offset_s", "distance_m"],
        "covariance": [[_short(value) for value in row] for row in fitted.covariance],
        "peak": {"height": _short(over.peak.height), "next": _short(over.peak.runner_up)},
        "slowness": _short(float(np.average(fitted.slowness, weights=slow + 1e-12))),
        "spread": _short(p.spread),
        "outliers": _short(p.outliers),
        "matched": _short(p.matched),
        "handed_over": len(over.first),
    }
    for name, table, sides in (
        ("lanes", p.lanes, (fitted.gap.before.lanes, fitted.gap.after.lanes)),
        ("classes", p.kinds, (fitted.gap.before.kinds, fitted.gap.after.kinds)),
    ):
        if table is not None:
            tree[name] = {
                before: {after: _short(value) for after, value in zip(sides[1], row, strict=True)}
                for before, row in zip(sides[0], _shares(over, name), strict=True)
            }
    tree["model"] = model_tree(over)
    return tree


def _shares(over: Handover, name: str) -> FloatArray:
    """Share of those handed over from each lane or class that are in each at the second camera."""
    a, b = over.fitted.gap.before, over.fitted.gap.after
    first, second = (a.lane, b.lane) if name == "lanes" else (a.kind, b.kind)
    shape = (len(a.lanes), len(b.lanes)) if name == "lanes" else (len(a.kinds), len(b.kinds))
    counts = np.zeros(shape)
    i, j = first[over.first], second[over.second]
    both = (i >= 0) & (j >= 0)
    np.add.at(counts, (i[both], j[both]), over.probability[both])
    return np.asarray(counts / np.maximum(counts.sum(axis=1, keepdims=True), 1e-12))


def read_known_gaps(path: str | Path) -> list[KnownGap]:
    """Read what an earlier run found out about the gaps: clocks and distances, with their deviations.

    Raises:
        DataError: names the file and what is missing or not valid.
    """
    return [_known(one, path) for one in _gaps(path)]


def read_learnt_gaps(path: str | Path) -> list[LearntGap]:
    """Read the gaps with their models, for vehicles that are followed while they drive.

    Raises:
        DataError: names the file and what is missing or not valid.
    """
    trees = _gaps(path)
    for one in trees:
        _known(one, path)
    return [learnt_gap(one, path) for one in trees]


def _gaps(path: str | Path) -> list[Any]:
    try:
        tree = load_yaml(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"cannot be read: {error}", path) from None
    except yaml.YAMLError as error:
        raise DataError(f"is not valid YAML: {' '.join(str(error).split())[:80]}", path) from None
    gaps = tree.get("gaps") if isinstance(tree, Mapping) else None
    if not isinstance(gaps, list) or not gaps:
        raise DataError("must hold gaps, a list of those between the cameras", path)
    return gaps


def _known(tree: Any, path: str | Path) -> KnownGap:
    if not isinstance(tree, Mapping):
        raise DataError("a gap must have from, to, offset_s, distance_m and covariance", path)
    covariance = tree.get("covariance")
    try:
        offset, distance = float(tree["offset_s"]), float(tree["distance_m"])
        first, second = str(tree["from"]), str(tree["to"])
        matrix = np.array(covariance, dtype=np.float64)
    except (KeyError, TypeError, ValueError):
        raise DataError("a gap must have from, to, offset_s, distance_m and covariance", path) from None
    sound = matrix.shape == (2, 2) and np.isfinite(matrix).all() and (np.diag(matrix) > 0.0).all()
    if not sound or not (math.isfinite(offset) and math.isfinite(distance) and distance > 0.0):
        raise DataError(
            f"{first}-{second}: offset, distance and covariance must be finite and positive", path
        )
    return KnownGap(first, second, distance, math.sqrt(matrix[1, 1]), offset, math.sqrt(matrix[0, 0]))


def _short(value: float) -> float:
    return float(f"{float(value):.{_DIGITS}g}")
