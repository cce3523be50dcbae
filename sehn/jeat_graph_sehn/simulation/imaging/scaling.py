"""The scenario's camera with another number of pixels."""

from __future__ import annotations

from dataclasses import replace

from jeat_graph_sehn.simulation.world.camera import CameraConfig


def scaled_camera(config: CameraConfig, width: int, height: int) -> CameraConfig:
    """Return the camera with a picture of `width` × `height` px, as if its sensor had other pixels.

    The width keeps its field of view. Where the new picture is relatively lower or higher, rows are cut or
    added evenly at the top and the bottom, so that pixels stay square.
    """
    k = width / config.width
    return replace(
        config,
        width=width,
        height=height,
        fx=config.fx * k,
        fy=config.fy * k,
        cx=config.cx * k,
        cy=config.cy * k + (height - config.height * k) / 2.0,
    )
