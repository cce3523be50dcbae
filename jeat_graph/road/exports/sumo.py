"""Floating car data as SUMO writes and reads them: XML, one element a time step, one a vehicle in it.

SUMO's x, y are the middle of the front bumper, and its angle is clockwise from the y axis, in degrees.
"""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.road.camera import Georeference
from jeat_graph.road.exports.frames import RoadFrames

#: Types of SUMO's own vehicle classes.
_TYPES = {"car": "passenger", "van": "delivery", "truck": "truck", "motorcycle": "motorcycle"}


def write_fcd(frames: RoadFrames, path: str | Path, georeference: Georeference | None = None) -> None:
    """Write a table of the road for SUMO.

    Args:
        frames: the vehicles.
        path: the file, XML.
        georeference: if given, x and y are easting and northing (m), and angles are from north.
    """
    ahead = np.stack([np.sin(frames.heading), np.cos(frames.heading)], axis=1)
    place = frames.xy + ahead * frames.size[:, :1] / 2.0
    angle = np.degrees(frames.heading)
    if georeference is not None:
        place = georeference.to_map(place)
        angle = angle + np.degrees(georeference.bearing_rad)
    angle = np.round(angle, 2) % 360.0
    cuts = np.flatnonzero(np.diff(frames.frame)) + 1
    with open_atomic(path) as file:
        file.write('<?xml version="1.0" encoding="UTF-8"?>\n<fcd-export>\n')
        for rows in np.split(np.arange(len(frames.frame)), cuts) if len(frames.frame) else []:
            file.write(f'    <timestep time="{frames.frame[rows[0]] / frames.rate_hz:.3f}">\n')
            for k in rows.tolist():
                kind = _TYPES.get(str(frames.kind[k]), "passenger")
                lane = quoteattr(str(frames.lane[k]))
                file.write(
                    f'        <vehicle id="{frames.track_id[k]}" x="{place[k, 0]:.3f}" y="{place[k, 1]:.3f}"'
                    f' angle="{angle[k]:.2f}" type="{kind}" speed="{frames.speed[k]:.3f}" pos="0.00"'
                    f' lane={lane} slope="0.00" acceleration="{frames.acceleration[k]:.3f}"/>\n'
                )
            file.write("    </timestep>\n")
        file.write("</fcd-export>\n")
