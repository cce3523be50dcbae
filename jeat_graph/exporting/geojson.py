"""A road as lines on the map."""

from __future__ import annotations

from jeat_graph.data.errors import DataError
from jeat_graph.exporting.record import ExportRequest, ExportTarget
from jeat_graph.exporting.sources import road_frames


def _write(request: ExportRequest) -> str:
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.exports.geojson import write_geojson

    if request.camera is None:
        raise DataError("--to geojson needs to know where the road is: give --camera")
    write_geojson(road_frames(request), read_camera(request.camera), request.out)
    return ""


EXPORT = ExportTarget(
    name="geojson",
    program="maps",
    writes="`.geojson`: one line a vehicle; needs `--camera`",
    write=_write,
    options=("output_rate", "camera"),
)
