"""A recording for the viewer rerun."""

from __future__ import annotations

from pathlib import Path

from jeat_graph.exporting.record import ExportRequest, ExportTarget
from jeat_graph.exporting.sources import run_tables, summary_of


def _write(request: ExportRequest) -> str:
    from jeat_graph.drawing.rerun_log import log_run

    tables = run_tables(request, every=True)
    log_run(tables, Path(request.source).resolve().name, request.out)
    return summary_of(tables)


EXPORT = ExportTarget(
    name="rerun",
    program="rerun (extra `rerun`)",
    writes="`.rrd`: both tables over time",
    write=_write,
    options=("only",),
)
