"""A road as floating car data of SUMO."""

from __future__ import annotations

from jeat_graph.exporting.record import ExportRequest, ExportTarget
from jeat_graph.exporting.sources import road_frames


def _write(request: ExportRequest) -> str:
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.exports.sumo import write_fcd

    place = None if request.camera is None else read_camera(request.camera).georeference
    write_fcd(road_frames(request), request.out, place)
    return ""


EXPORT = ExportTarget(
    name="sumo",
    program="SUMO",
    writes="`.xml`: floating car data",
    write=_write,
    options=("output_rate", "camera"),
)
