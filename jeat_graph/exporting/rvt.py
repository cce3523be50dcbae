"""A simulated set as RVT has it after its preprocessing."""

from __future__ import annotations

from jeat_graph.exporting.record import ExportTarget
from jeat_graph.exporting.sources import write_set

EXPORT = ExportTarget(
    name="rvt",
    program="training of other people's detectors (needs jeat-graph-sehn)",
    writes="a folder: RVT's preprocessed form",
    write=write_set,
)
