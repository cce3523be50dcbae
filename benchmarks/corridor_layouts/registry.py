"""All layouts of several cameras, found by the files of this folder."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from benchmarks import corridor_layouts
from benchmarks.corridor_layouts.record import CorridorLayout
from jeat_graph.data.errors import DataError
from jeat_graph.data.records import records_in

_RECORD = "LAYOUT"


@cache
def all_layouts() -> dict[str, CorridorLayout]:
    """Return all layouts by name, in the order of their files' names."""
    return {record.name: record for record in records_in(corridor_layouts.__name__, _RECORD)}


def recognise(root: Path) -> CorridorLayout:
    """Return the layout that a folder or a file has.

    Raises:
        DataError: none, or it is not there.
    """
    if not root.exists():
        raise DataError("is not there", root)
    found = [layout for layout in all_layouts().values() if layout.recognise(root)]
    if not found:
        known = "; ".join(f"{layout.name} ({layout.holds})" for layout in all_layouts().values())
        raise DataError(f"has none of the layouts that are known: BrnoCompSpeed; {known}", root)
    return found[0]
