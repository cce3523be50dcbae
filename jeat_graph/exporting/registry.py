"""The exports that there are."""

from __future__ import annotations

from functools import cache

from jeat_graph.data.errors import DataError
from jeat_graph.data.records import records_in
from jeat_graph.exporting.record import SOME_TAKE, ExportRequest, ExportTarget

_PACKAGE = "jeat_graph.exporting"


@cache
def exports() -> tuple[ExportTarget, ...]:
    """Return the records of all exports, by name."""
    found: list[ExportTarget] = records_in(_PACKAGE, "EXPORT")
    return tuple(sorted(found, key=lambda one: one.name))


def write_export(request: ExportRequest) -> str:
    """Write for another program, and return the text behind `wrote OUT`.

    Raises:
        DataError: no such export, an option that it cannot make use of, or what its writer says.
    """
    found = {one.name: one for one in exports()}
    if request.to not in found:
        raise DataError(f"unknown export {request.to!r}; known: {', '.join(found)}")
    for name in SOME_TAKE:
        if getattr(request, name) is not None and name not in found[request.to].options:
            supporting = " or ".join(one.name for one in found.values() if name in one.options)
            raise DataError(f"--{name.replace('_', '-')} is for --to {supporting}, not {request.to}")
    return found[request.to].write(request)
