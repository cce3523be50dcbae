"""A simulated set in the layout of DSEC-Detection."""

from __future__ import annotations

from jeat_graph.exporting.record import ExportTarget
from jeat_graph.exporting.sources import write_set

EXPORT = ExportTarget(
    name="dsec-det",
    program="training of other people's detectors (needs jeat-graph-sehn)",
    writes="a folder in the layout of DSEC-Detection",
    write=write_set,
)
