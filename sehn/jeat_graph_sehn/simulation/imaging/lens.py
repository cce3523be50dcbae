"""A real lens on a swaying mount before the ideal picture: where each pixel looks, and where points are seen.

The scene is rendered as a pinhole camera at rest would see it, on a canvas a little larger than the sensor. A
pixel's ray goes backwards through the lens and the mount's turn to its place on the canvas.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.simulation.imaging.lens_config import LensConfig
from jeat_graph_sehn.simulation.imaging.sway import Sway, draw_sway, turn
from jeat_graph_sehn.simulation.world.camera import Camera

_SPARE_PX = 3  # of the canvas beyond what is looked at
_NEWTON = 30
_STEP_S = 1e-3  # of differences in time, for image motion
_DROP_POWER = -1.6  # a drop is a lens: it shows its middle small and upside down
_BLUR_TIMES = 3  # of the mount's turn within an exposure,
_BLUR_PX = 0.1  # if it takes the picture as far as this meanwhile


class Lens:
    """Distortion, sway and drops of one segment.

    Attributes:
        camera: of the sensor: what a pinhole there would be.
        canvas: pinhole camera at rest, of the same pose and focal length, that sees all that pixels look at.
        rays: (H, W, 2) X / Z and Y / Z of what each pixel's centre looks at, in the camera's axes.
        sway: the mount's turns.
    """

    def __init__(self, config: LensConfig, camera: Camera, rng: np.random.Generator) -> None:
        """Draw sway and drops.

        Args:
            config: settings.
            camera: of the sensor.
            rng: of the segment's lens.

        Raises:
            ConfigError: a distortion that folds the picture over.
        """
        self.config, self.camera = config, camera
        self.sway = draw_sway(config, rng)
        x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
        y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
        bent = np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)
        self.rays = np.ascontiguousarray(straighten(bent, config))
        turns = self.sway.most()
        reach = np.abs(self.rays).max(axis=(0, 1)) + (1.0 + np.abs(self.rays).max() ** 2) * turns[[1, 0]]
        reach += turns[2]
        focal, centre = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
        size = np.array([camera.width, camera.height])
        spare = np.maximum(focal * reach - np.minimum(centre, size - centre), 0.0)
        margin = np.ceil(spare).astype(int) + _SPARE_PX
        self.margin_px = (int(margin[0]), int(margin[1]))
        self.canvas = replace(
            camera,
            width=camera.width + 2 * self.margin_px[0],
            height=camera.height + 2 * self.margin_px[1],
            cx=camera.cx + self.margin_px[0],
            cy=camera.cy + self.margin_px[1],
        )
        _add_drops(self.rays, config, camera, rng)
        self._lens = np.array([self.canvas.fx, self.canvas.fy, self.canvas.cx, self.canvas.cy])

    def homography(self, t: float | FloatArray) -> FloatArray:
        """Matrix (3, 3) that takes a ray (X / Z, Y / Z, 1) of time t (s) to the canvas (px, homogeneous).

        Of J times there are as many (J, 3, 3).
        """
        fx, fy, cx, cy = self._lens
        matrix: FloatArray = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        return matrix @ turn(self.sway.angles(np.asarray(t)[..., None, None]))

    def look(self, picture: FloatArray, t: float, exposure_s: float, readout_s: float) -> FloatArray:
        """What the pixels see of a picture (Hc, Wc, C) on the canvas: (H, W, C).

        Args:
            picture: on the canvas.
            t: middle of the middle row's exposure (s).
            exposure_s: of each row (s); the mount turns meanwhile.
            readout_s: from the first to the last row (s).
        """
        rows = self.camera.height
        out = np.zeros((*self.rays.shape[:2], picture.shape[2]))
        times = _BLUR_TIMES if self._moves(t, exposure_s) > _BLUR_PX else 1
        for k in range(times):
            moment = (
                t
                + exposure_s * ((k + 0.5) / times - 0.5)
                + readout_s * ((np.arange(rows) + 0.5) / rows - 0.5)
            )
            if self.config.sway_deg > 0.0:
                maps = self.homography(moment)
            else:
                maps = np.broadcast_to(self.homography(t), (rows, 3, 3))
            _look(picture, self.rays, np.ascontiguousarray(maps), out)
        return out / times

    def _moves(self, t: float, exposure_s: float) -> float:
        """How far the mount takes the picture within an exposure (px)."""
        turns = self.sway.angles(np.array([t - 0.5 * exposure_s, t + 0.5 * exposure_s])[:, None, None])
        across, up = np.diff(turns[:, :2], axis=0).ravel()
        return self.canvas.fx * float(np.hypot(across, up))

    def nearest(self, picture: IntArray, t: float) -> IntArray:
        """What the pixels' centres see at a time (s) of numbers (Hc, Wc) on the canvas: (H, W)."""
        m = self.homography(t)
        place = self.rays @ m[:, :2].T + m[:, 2]
        column, row = place[..., 0] / place[..., 2], place[..., 1] / place[..., 2]
        # A pixel's number is that of its left and upper border, whose centre is half a pixel on.
        high, wide = picture.shape
        at = np.clip(np.floor(row), 0, high - 1).astype(np.int64)
        out: IntArray = picture[at, np.clip(np.floor(column), 0, wide - 1).astype(np.int64)]
        return out

    def covered(self) -> BoolArray:
        """Part of the canvas, (Hc, Wc) true or false, that the pixels look at while the mount is at rest."""
        x = (np.arange(self.canvas.width) + 0.5 - self.canvas.cx) / self.canvas.fx
        y = (np.arange(self.canvas.height) + 0.5 - self.canvas.cy) / self.canvas.fy
        place = bend(np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1), self.config, self.limit)
        u = self.camera.fx * place[..., 0] + self.camera.cx
        v = self.camera.fy * place[..., 1] + self.camera.cy
        inside: BoolArray = (u >= 0.0) & (u <= self.camera.width) & (v >= 0.0) & (v <= self.camera.height)
        return inside

    @property
    def limit(self) -> float:
        """Radius (of X / Z, Y / Z) up to which the lens is modelled; beyond it goes on in a straight line."""
        return 1.1 * float(np.hypot(self.canvas.cx / self.canvas.fx, self.canvas.cy / self.canvas.fy))

    def boxes(self, boxes: FloatArray, t: float) -> FloatArray:
        """Boxes (V, 4) left, top, width, height on the canvas as the pixels see them at a time (s), clipped.

        They must be clipped to the canvas.

        The middles of a box's sides say where its sides are seen, for outlines reach their box about there.
        """
        left, top = boxes[:, 0], boxes[:, 1]
        right, low = left + boxes[:, 2], top + boxes[:, 3]
        x, y = (left + right) / 2.0, (top + low) / 2.0
        sides = np.stack([[left, y], [right, y], [x, top], [x, low]])
        centre = np.array([[self.canvas.cx], [self.canvas.cy]])
        rays = (sides - centre) / np.array([[self.canvas.fx], [self.canvas.fy]])
        local = np.concatenate([np.moveaxis(rays, 1, 2), np.ones((4, len(boxes), 1))], axis=2)
        seen = local @ turn(self.sway.angles(t))
        place = bend(seen[..., :2] / seen[..., 2:], self.config, self.limit)
        u = np.clip(self.camera.fx * place[..., 0] + self.camera.cx, 0.0, self.camera.width)
        v = np.clip(self.camera.fy * place[..., 1] + self.camera.cy, 0.0, self.camera.height)
        out: FloatArray = np.stack([u[0], v[2], u[1] - u[0], v[3] - v[2]], axis=1)
        return np.maximum(out, 0.0)

    def camera_at(self, t: float) -> LensCamera:
        """Return the camera with lens and sway at a time (s)."""
        names = ("width", "height", "fx", "fy", "cx", "cy", "position", "rotation")
        return LensCamera(
            **{name: getattr(self.camera, name) for name in names},
            config=self.config,
            sway=self.sway,
            t=t,
            limit=self.limit,
        )


@dataclass(frozen=True, eq=False)
class LensCamera(Camera):
    """A camera whose projection has the lens and the mount's turn at time `t` (s) in it."""

    config: LensConfig
    sway: Sway
    t: float
    limit: float

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Project points; see `Camera.project`."""
        local = self.to_camera(points)
        return self._pixel(local, 0.0), local[..., 2]

    def project_motion(
        self, points: FloatArray, velocity: FloatArray, acceleration: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Project moving points, the mount's motion included, by differences of 1 ms; see `Camera`."""
        P, V, A = self.to_camera(points), velocity @ self.rotation.T, acceleration @ self.rotation.T
        h = _STEP_S
        before, now, after = (self._pixel(P + s * V + 0.5 * s * s * A, s) for s in (-h, 0.0, h))
        return now, (after - before) / (2.0 * h), (after - 2.0 * now + before) / (h * h)

    def _pixel(self, local: FloatArray, after_s: float) -> FloatArray:
        seen: FloatArray = local @ turn(self.sway.angles(self.t + after_s))
        with np.errstate(divide="ignore", invalid="ignore"):
            ray = seen[..., :2] / seen[..., 2:]
        focal, centre = np.array([self.fx, self.fy]), np.array([self.cx, self.cy])
        out: FloatArray = bend(ray, self.config, self.limit) * focal + centre
        return out


def bend(rays: FloatArray, config: LensConfig, limit: float) -> FloatArray:
    """Where the lens puts rays (..., 2) of X / Z, Y / Z; beyond `limit` the radius grows evenly."""
    r = np.sqrt((rays**2).sum(axis=-1, keepdims=True))
    inner = np.minimum(r, limit)
    bent = inner * _gain(inner, config) + (r - inner) * max(_slope(limit, config), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        out: FloatArray = np.where(r > 1e-12, rays * (bent / r), rays)
    return out


def straighten(bent: FloatArray, config: LensConfig) -> FloatArray:
    """Rays (..., 2) that the lens puts at `bent` (..., 2), by Newton's method on the radius.

    Raises:
        ConfigError: there are none, for the distortion folds the picture over.
    """
    target = np.sqrt((bent**2).sum(axis=-1, keepdims=True))
    r = before = target.copy()
    with np.errstate(all="ignore"):
        for k in range(_NEWTON):
            r, before, last = r - (r * _gain(r, config) - target) / _slope(r, config), r, before
            # Once all radii are where they were two steps ago, rounding takes them to and fro for ever.
            if np.array_equal(r, last):
                r = before if (_NEWTON - 1 - k) % 2 else r
                break
        worst = np.abs(r * _gain(r, config) - target).max()
        monotone = _slope(np.linspace(0.0, float(r.max()), 200), config).min() > 0.0
    if not (np.isfinite(worst) and worst < 1e-9 and monotone):
        raise ConfigError(f"lens: k1 = {config.k1:g}, k2 = {config.k2:g} folds this camera's picture over")
    out: FloatArray = np.where(target > 1e-12, bent * (r / np.maximum(target, 1e-12)), bent)
    return out


def _gain(r: Any, config: LensConfig) -> Any:
    inner = 1.0 + config.k1 * r**2
    return inner + config.k2 * r**4 if config.k2 else inner  # a fourth power is dear


def _slope(r: Any, config: LensConfig) -> Any:
    inner = 1.0 + 3.0 * config.k1 * r**2
    return inner + 5.0 * config.k2 * r**4 if config.k2 else inner


def _add_drops(rays: FloatArray, config: LensConfig, camera: Camera, rng: np.random.Generator) -> None:
    """Bend the rays of pixels behind drops; a drop's rim joins smoothly."""
    v, u = np.mgrid[0 : camera.height, 0 : camera.width] + 0.5
    for _ in range(config.drops):
        at = rng.uniform((0.0, 0.0), (camera.width, camera.height))
        radius = config.drop_radius * camera.width * float(np.exp(0.4 * rng.standard_normal()))
        away = np.hypot(u - at[0], v - at[1]) / radius
        power = _DROP_POWER * (1.0 - np.minimum(away, 1.0) ** 2) ** 2
        rays[..., 0] += power * (u - at[0]) / camera.fx
        rays[..., 1] += power * (v - at[1]) / camera.fy


@njit(cache=True, error_model="numpy")
def place_on_canvas(x: float, y: float, m: FloatArray, height: int, width: int) -> tuple[float, float]:
    """Row and column, pixels' centres at whole numbers, of a ray on the canvas, within it."""
    z = m[2, 0] * x + m[2, 1] * y + m[2, 2]
    u = (m[0, 0] * x + m[0, 1] * y + m[0, 2]) / z - 0.5
    v = (m[1, 0] * x + m[1, 1] * y + m[1, 2]) / z - 0.5
    return min(max(v, 0.0), height - 1.001), min(max(u, 0.0), width - 1.001)


@njit(cache=True, error_model="numpy")
def _look(picture: FloatArray, rays: FloatArray, maps: FloatArray, out: FloatArray) -> None:
    """Add what each pixel sees, between the four nearest places of the canvas, by one map (3, 3) a row."""
    height, width, channels = picture.shape
    for row in range(rays.shape[0]):
        m = maps[row]
        for column in range(rays.shape[1]):
            v, u = place_on_canvas(rays[row, column, 0], rays[row, column, 1], m, height, width)
            r, c = math.floor(v), math.floor(u)
            a, b = v - r, u - c
            for k in range(channels):
                top = picture[r, c, k] + b * (picture[r, c + 1, k] - picture[r, c, k])
                low = picture[r + 1, c, k] + b * (picture[r + 1, c + 1, k] - picture[r + 1, c, k])
                out[row, column, k] += top + a * (low - top)
