"""A simulated set as the preprocessing of RVT takes it."""

from __future__ import annotations

from jeat_graph.exporting.record import ExportTarget
from jeat_graph.exporting.sources import write_set

EXPORT = ExportTarget(
    name="rvt-input",
    program="training of other people's detectors (needs jeat-graph-sehn)",
    writes="a folder: the input of RVT's preprocessing",
    write=write_set,
)
