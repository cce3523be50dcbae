"""Where the camera's motion has taken a point at rest that was in the middle of the picture.

Tracks follow the camera step by step; whoever compares boxes of different times, as one who joins pieces of
tracks does, subtracts this path from both. It moves as a track there would: by what pictures show, by what
all tracks have in common, and by what lasts of that, which is part of the tracks' velocities
(`camera_motion`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.camera_motion import CameraMotion, lasting_rate
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.picture_motion import CameraVelocity, displacement
from jeat_graph.filters.singer import POSITION, VELOCITY


class CameraPath(NamedTuple):
    """A point at rest, as the camera sees it.

    Attributes:
        moved: (2,) how far it has gone (px).
        velocity: (2,) as far as no picture shows it (px/s).
    """

    moved: FloatArray
    velocity: FloatArray

    @staticmethod
    def none() -> CameraPath:
        """Return the path of a camera that has not moved yet."""
        return CameraPath(np.zeros(2), np.zeros(2))

    def predicted(
        self, F: FloatArray, camera: CameraVelocity, picture: tuple[float, float], dt: float
    ) -> CameraPath:
        """Return it after a step.

        Args:
            F: (7, 7) transition of one axis.
            camera: velocity that pictures show.
            picture: width and height (px).
            dt: the step (s).
        """
        moved = self.moved + _rate(camera, picture) * dt + F[POSITION, VELOCITY] * self.velocity
        return CameraPath(moved, F[VELOCITY, VELOCITY] * self.velocity)

    def with_picture(
        self, before: CameraVelocity, now: CameraVelocity, picture: tuple[float, float], step_s: float
    ) -> CameraPath:
        """Return it as a new picture shows it, which corrects the velocity of the step that led to it.

        Args:
            before: velocity that it was predicted with.
            now: that of the picture.
            picture: width and height (px).
            step_s: time of the step before (s).
        """
        change = _rate(now, picture) - _rate(before, picture)
        return self._replace(moved=self.moved + change * (now.picture_s - step_s))

    def with_motion(self, motion: CameraMotion, dt: float, c: ModelConstants) -> CameraPath:
        """Return it after a motion that all tracks have in common.

        Args:
            motion: of the camera.
            dt: the time that it took (s), > 0.
            c: constants.
        """
        shift = motion.theta[:2]
        return CameraPath(self.moved + shift, self.velocity + lasting_rate(dt, c) * shift)


def _rate(camera: CameraVelocity, picture: tuple[float, float]) -> FloatArray:
    """Return the velocity (2,) of the middle of the picture (px/s)."""
    middle = displacement(camera.rate, camera.centre, np.array([picture]) / 2.0)
    return np.asarray(middle[0], dtype=np.float64)
