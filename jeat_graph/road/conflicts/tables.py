"""Tables of encounters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.io.tables.rounding import round_decimals
from jeat_graph.road.conflicts.encounters import Encounter

_MEASURES = {"ttc": "ttc_s", "drac": "drac", "pet": "pet_s", "headway": "headway_s"}


def encounter_columns(found: Sequence[Encounter], begin_s: float = 0.0) -> dict[str, npt.NDArray[Any]]:
    """Columns of encounters, each measure with its 95 % interval; what is not known is NaN.

    Args:
        found: the encounters.
        begin_s: the clock's time of the recording's time 0 (s).
    """

    def numbers(values: list[float], decimals: int = 3) -> npt.NDArray[Any]:
        array = np.array(values, dtype=np.float64)
        return round_decimals(np.where(np.isfinite(array), array, np.nan), decimals)

    columns: dict[str, npt.NDArray[Any]] = {
        "t": numbers([one.t + begin_s for one in found]),
        "first_id": np.array([one.first for one in found], dtype=np.int64),
        "second_id": np.array([one.second for one in found], dtype=np.int64),
        "first_class": np.array([one.first_kind for one in found], dtype=np.str_),
        "second_class": np.array([one.second_kind for one in found], dtype=np.str_),
        "kind": np.array([one.kind for one in found], dtype=np.str_),
        "x": numbers([one.x for one in found]),
        "y": numbers([one.y for one in found]),
    }
    for field, name in _MEASURES.items():
        for part, suffix in (("value", ""), ("low", "_low"), ("high", "_high")):
            columns[name + suffix] = numbers([getattr(getattr(one, field), part) for one in found])
    columns["probability"] = numbers([one.probability for one in found])
    return columns
