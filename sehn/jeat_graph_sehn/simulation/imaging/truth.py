"""Truth of a frame: boxes, poses and motion of the vehicles, with what of them is visible."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.segment import FrameTruth
from jeat_graph_sehn.simulation.world.boxes import project_boxes
from jeat_graph_sehn.simulation.world.camera import Camera
from jeat_graph_sehn.simulation.world.scene import VehicleStates
from jeat_graph_sehn.simulation.world.vehicles import KIND_NAMES

_LEAST_PX = 1.0  # what is smaller is no box


class ImageViews(NamedTuple):
    """What a picture shows of N vehicles: part seen (N,), tight boxes (N, 4), contrast-to-noise (N,)."""

    visible: FloatArray
    tight: FloatArray
    contrast: FloatArray


def frame_truth(
    states: VehicleStates, camera: Camera, views: ImageViews, min_side_px: float, range_m: float
) -> FrameTruth:
    """Make the truth of one time. What can be seen but is not asked for is there, marked `ignore`.

    Args:
        states: N vehicles at that time.
        camera: the camera.
        views: what the picture shows of them.
        min_side_px: vehicles whose clipped box is thinner or lower are `ignore`.
        range_m: vehicles farther from the camera are `ignore`.

    Returns:
        Vehicles by ascending id. Yaw is the direction of the vehicle's front, from +x towards +y.
    """
    projected = project_boxes(states, camera)
    extent = projected.clipped[:, 2:] - projected.clipped[:, :2]
    keep = np.flatnonzero((extent >= _LEAST_PX).all(axis=1) & (views.visible > 0.0))
    rows = keep[np.argsort(states.object_id[keep])]
    front = states.pose[rows, 2] + np.where(states.direction[rows] < 0, np.pi, 0.0)
    yaw = np.pi / 2.0 - front
    zero = np.zeros(len(rows))
    centre = np.column_stack([states.pose[rows, :2], states.size[rows, 2] / 2.0])
    distance = np.linalg.norm(centre - camera.position, axis=1)
    return FrameTruth(
        object_id=states.object_id[rows],
        class_name=KIND_NAMES[states.kind[rows]],
        boxes=np.concatenate([projected.clipped[rows, :2], extent[rows]], axis=1),
        visible=views.visible[rows],
        motion=projected.motion[rows],
        size=states.size[rows],
        pose=np.column_stack(
            [
                states.pose[rows, :2],
                states.size[rows, 2] / 2.0,
                zero,
                zero,
                np.arctan2(np.sin(yaw), np.cos(yaw)),
            ]
        ),
        velocity=np.column_stack([states.velocity[rows, :2], zero]),
        tight=views.tight[rows],
        contrast=views.contrast[rows],
        ignore=(extent[rows] < min_side_px).any(axis=1) | (distance > range_m),
    )
