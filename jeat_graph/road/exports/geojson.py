"""Vehicles' ways on the map: GeoJSON (RFC 7946), one line a vehicle in longitude and latitude."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.exports.frames import RoadFrames
from jeat_graph.road.exports.utm import to_wgs84

_DECIMALS = 8  # of a degree: a millimetre


def write_geojson(frames: RoadFrames, camera: RoadCamera, path: str | Path) -> None:
    """Write the ways of all vehicles.

    Args:
        frames: the vehicles.
        camera: calibrated with surveyed points in a UTM zone.
        path: the file.

    Raises:
        DataError: it is not known where on the map the road is.
    """
    if camera.georeference is None or not camera.georeference.zone:
        raise DataError(
            "the camera is on no map: calibrate it with --points in UTM metres and say their --zone"
        )
    place = to_wgs84(camera.georeference.to_map(frames.xy), camera.georeference.zone)
    features: list[dict[str, Any]] = []
    for one in np.unique(frames.track_id).tolist():
        rows = np.flatnonzero(frames.track_id == one)
        line = np.round(place[rows], _DECIMALS).tolist()
        geometry: dict[str, Any] = {"type": "LineString", "coordinates": line}
        if len(rows) == 1:  # a line has two ends
            geometry = {"type": "Point", "coordinates": line[0]}
        size = frames.size[rows[0]].tolist()
        properties = {
            "track_id": one,
            "lane": str(frames.lane[rows[0]]),
            "class": str(frames.kind[rows[0]]),
            "length_m": round(size[0], 2) if size[0] else None,
            "t_first": round(float(frames.frame[rows[0]]) / frames.rate_hz, 3),
            "t_last": round(float(frames.frame[rows[-1]]) / frames.rate_hz, 3),
            "mean_kmh": round(3.6 * float(frames.speed[rows].mean()), 2),
        }
        features.append({"type": "Feature", "id": one, "geometry": geometry, "properties": properties})
    with open_atomic(path) as file:
        json.dump({"type": "FeatureCollection", "features": features}, file, ensure_ascii=False)
        file.write("\n")
