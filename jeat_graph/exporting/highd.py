"""A road as tables with the columns of the highD data set."""

from __future__ import annotations

from jeat_graph.exporting.record import ExportRequest, ExportTarget
from jeat_graph.exporting.sources import road_frames


def _write(request: ExportRequest) -> str:
    from jeat_graph.road.exports.highd import write_highd

    write_highd(road_frames(request), request.out)
    return ""


EXPORT = ExportTarget(
    name="highd",
    program="readers of the highD data set",
    writes="a folder of tables with its columns",
    write=_write,
    options=("output_rate",),
)
