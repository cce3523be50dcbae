"""Two cameras side by side over one road, drawn at random: what `register` has to bring together.

Vehicles are boxes on a plane; each camera sees the rectangle around the projected corners. Detectors err as
real ones do: 4.5 % of the size, half of that variance for .7 s; they miss, and invent boxes. Cameras have
other lenses, pictures and clocks, and begin to record at other times.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.picture_map import PictureMap

# Length, width, height (m), and share of traffic.
_KINDS = {
    "car": (4.5, 1.8, 1.5, 0.65),
    "van": (5.5, 2.0, 2.3, 0.15),
    "truck": (11.0, 2.5, 3.6, 0.15),
    "motorbike": (2.2, 0.8, 1.5, 0.05),
}
_PICTURES = ((640, 480), (1024, 768), (1280, 720), (1920, 1080))
_LANE_M, _NEAR_M, _FAR_M = 3.5, 8.0, 130.0
_LEAST_SIDE_PX = 6.0
# Cameras that look at other roads are so far apart (m).
_APART_M = 400.0
_PPM = 1e-6


@dataclass(frozen=True)
class RigLens:
    """A camera over the road: place (3,) in m, world to camera (3, 3), focal length (px), picture (px)."""

    place: FloatArray
    turn: FloatArray
    focal: float
    size: tuple[int, int]

    def see(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixels (..., 2) and depths (...) of points (..., 3)."""
        local = (points - self.place) @ self.turn.T
        pixels = self.focal * local[..., :2] / local[..., 2:] + 0.5 * np.array(self.size)
        return pixels, local[..., 2]


@dataclass(frozen=True)
class RigClock:
    """Reads `rate` · (t − start) + first at time t (s)."""

    start: float
    first: float
    drift_ppm: float

    def reading(self, t: FloatArray) -> FloatArray:
        """Return what it shows at times (N,)."""
        return self.first + (1.0 + self.drift_ppm * _PPM) * (t - self.start)


@dataclass(frozen=True)
class RigScene:
    """A rig and the traffic below it.

    Attributes:
        lenses: of `rgb` and `evt`.
        clocks: of both.
        spans: when each records (s).
        rates: scans per second of each (Hz).
        born: (V,) when each vehicle is at `first` (s).
        first: (V, 2) place across and along (m).
        speed: (V,) along (m/s), negative for those that come.
        gain: (V,) acceleration (m/s²).
        kind: (V,) number in the order of `KINDS`.
    """

    lenses: tuple[RigLens, RigLens]
    clocks: tuple[RigClock, RigClock]
    spans: tuple[tuple[float, float], tuple[float, float]]
    rates: tuple[float, float]
    born: FloatArray
    first: FloatArray
    speed: FloatArray
    gain: FloatArray
    kind: IntArray

    def boxes(self, camera: int, t: float) -> tuple[IntArray, FloatArray]:
        """Which vehicles a camera sees at a time, and their true boxes (N, 4)."""
        age = t - self.born
        along = self.first[:, 1] + self.speed * age + 0.5 * self.gain * age**2
        sides = np.array([one[:3] for one in _KINDS.values()])[self.kind]
        there = (along > _NEAR_M) & (along < _FAR_M)
        rows = np.flatnonzero(there)
        corners = np.array([(a, b, c) for a in (-0.5, 0.5) for b in (-0.5, 0.5) for c in (0.0, 1.0)])
        middle = np.stack([self.first[rows, 0], along[rows], np.zeros(len(rows))], axis=1)
        scale = sides[rows][:, [1, 0, 2]]
        pixels, depth = self.lenses[camera].see(middle[:, None, :] + corners[None] * scale[:, None, :])
        low, high = pixels.min(axis=1), pixels.max(axis=1)
        size = np.array(self.lenses[camera].size)
        whole = (depth > 1.0).all(axis=1) & (low > 0).all(axis=1) & (high < size).all(axis=1)
        whole &= (high - low).min(axis=1) > _LEAST_SIDE_PX
        return rows[whole], np.concatenate([low, high - low], axis=1)[whole]

    def detections(self, camera: int, seed: int) -> Detections:
        """What a detector finds, by the sensor's own clock."""
        rng = np.random.default_rng(seed)
        begin, end = self.spans[camera]
        rate = self.rates[camera]
        times = np.arange(begin, end, 1.0 / rate)
        forget = np.exp(-1.0 / (rate * _MEMORY_S))
        lasting = rng.normal(size=(len(self.born), 4))
        seen = rng.uniform(size=len(self.born)) < _P_DETECT
        name = ("rgb", "evt")[camera]
        t: list[float] = []
        boxes: list[list[float]] = []
        scores: list[float] = []
        empty: list[bool] = []
        for time in times:
            lasting = forget * lasting + np.sqrt(1.0 - forget**2) * rng.normal(size=lasting.shape)
            change = rng.uniform(size=len(seen)) < (1.0 - forget)
            seen = np.where(change, rng.uniform(size=len(seen)) < _P_DETECT, seen)
            rows, true = self.boxes(camera, float(time))
            rows, true = rows[seen[rows]], true[seen[rows]]
            found = _erring(true, lasting[rows], rng)
            false = _clutter(self.lenses[camera].size, rng)
            found = np.concatenate([found, false])
            count = max(len(found), 1)
            t += [float(self.clocks[camera].reading(np.array([time]))[0])] * count
            boxes += found.tolist() or [[np.nan] * 4]
            high = rng.uniform(0.55, 0.97, len(true)).tolist() + rng.uniform(0.1, 0.6, len(false)).tolist()
            scores += high or [np.nan]
            empty += [not len(found)] * count
        return Detections.from_rows(t, [name] * len(t), boxes, scores, empty)


_MEMORY_S, _P_DETECT, _CLUTTER = 0.7, 0.93, 0.2
_SIGMA_CENTRE, _SIGMA_SIZE = 0.045, 0.06


def _erring(true: FloatArray, lasting: FloatArray, rng: np.random.Generator) -> FloatArray:
    size = np.sqrt(true[:, 2] * true[:, 3])[:, None]
    error = np.sqrt(0.5) * (lasting + rng.normal(size=lasting.shape))
    centre = true[:, :2] + 0.5 * true[:, 2:] + _SIGMA_CENTRE * size * error[:, :2]
    sides = true[:, 2:] * np.exp(_SIGMA_SIZE * error[:, 2:])
    return np.concatenate([centre - 0.5 * sides, sides], axis=1)


def _clutter(size: tuple[int, int], rng: np.random.Generator) -> FloatArray:
    count = rng.poisson(_CLUTTER)
    sides = rng.uniform(10.0, 60.0, (count, 2))
    corner = rng.uniform(0.0, 1.0, (count, 2)) * (np.array(size) - sides)
    return np.concatenate([corner, sides], axis=1)


def draw_scene(seed: int, kind: str = "road") -> RigScene:
    """Draw a rig.

    Args:
        seed: another seed, another rig.
        kind: `road`; `lane`, all vehicles in one lane; or `apart`, where the cameras look at other roads.
    """
    rng = np.random.default_rng(seed)
    sizes = [_PICTURES[k] for k in rng.choice(len(_PICTURES), 2)]
    high, pitch, yaw = rng.uniform(6.0, 10.0), np.deg2rad(rng.uniform(10, 18)), np.deg2rad(rng.uniform(-8, 8))
    place = np.array([rng.uniform(-4.0, 4.0), 0.0, high])
    one = RigLens(place, _turn(pitch, yaw, np.deg2rad(rng.normal(0, 0.5))), _focal(sizes[0], rng), sizes[0])
    apart = rng.uniform(0.1, 1.0) * np.array([np.cos(a := rng.uniform(-0.5, 0.5)), 0.0, np.sin(a)])
    off = np.deg2rad(rng.normal(0.0, 1.5, 3))
    other = _turn(pitch + off[0], yaw + off[1], np.deg2rad(rng.normal(0, 0.5)) + off[2])
    two = RigLens(place + apart * rng.choice([-1, 1]), other, _focal(sizes[1], rng), sizes[1])
    wait = rng.uniform(0.0, 30.0)
    spans = [(0.0, wait + 60.0), (wait, wait + 90.0)]
    order = rng.permutation(2)
    spans = [spans[k] for k in order]
    clocks = tuple(
        RigClock(span[0], float(rng.uniform(0, 20)), float(rng.uniform(-25.0, 25.0))) for span in spans
    )
    rates = (float(rng.choice([20.0, 25.0, 30.0])), float(rng.choice([20.0, 30.0, 50.0])))
    traffic = _traffic(spans[0][1] if spans[0][1] > spans[1][1] else spans[1][1], kind, rng)
    scene = RigScene((one, two), (clocks[0], clocks[1]), (spans[0], spans[1]), rates, *traffic)
    if kind == "apart":
        return replace(scene, lenses=(one, replace(two, place=two.place + np.array([_APART_M, 0, 0]))))
    return scene


def other_traffic(scene: RigScene, seed: int) -> RigScene:
    """The same rig over other vehicles."""
    rng = np.random.default_rng(seed)
    born, first, speed, gain, kind = _traffic(max(span[1] for span in scene.spans), "road", rng)
    return replace(scene, born=born, first=first, speed=speed, gain=gain, kind=kind)


def _turn(pitch: float, yaw: float, roll: float) -> FloatArray:
    down = np.array([[1, 0, 0], [0, -np.sin(pitch), -np.cos(pitch)], [0, np.cos(pitch), -np.sin(pitch)]])
    aside = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1.0]])
    about = np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1.0]])
    return np.asarray(about @ down @ aside)


def _focal(size: tuple[int, int], rng: np.random.Generator) -> float:
    return float(0.5 * size[0] / np.tan(0.5 * np.deg2rad(rng.uniform(40.0, 65.0))))


def _traffic(
    until: float, kind: str, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, IntArray]:
    lanes = [0.5] if kind == "lane" else [-2.5, -1.5, -0.5, 0.5, 1.5, 2.5]
    born, first, speed, gain = [], [], [], []
    for lane in lanes:
        for roads in (0.0, _APART_M) if kind == "apart" else (0.0,):
            usual, t = rng.uniform(15.0, 30.0), -15.0
            every = rng.uniform(2.0, 6.0)
            while t < until + 5.0:
                t += 1.0 + rng.exponential(every - 1.0)
                born.append(t)
                first.append((roads + lane * _LANE_M + rng.normal(0, 0.25), _NEAR_M if lane > 0 else _FAR_M))
                speed.append((1 if lane > 0 else -1) * usual * np.exp(rng.normal(0, 0.08)))
                gain.append(rng.normal(0.0, 0.3))
    share = np.array([one[3] for one in _KINDS.values()])
    kinds = rng.choice(len(_KINDS), len(born), p=share / share.sum())
    return np.array(born), np.array(first), np.array(speed), np.array(gain), kinds


def judge(scene: RigScene, way: PictureMap, seconds: float = 40.0) -> dict[str, FloatArray]:
    """Errors (N,) of true boxes of other vehicles that are brought to the first picture (px), by class."""
    held = other_traffic(scene, 991)
    errors: dict[str, list[FloatArray]] = {name: [] for name in _KINDS}
    for t in np.arange(0.0, seconds, 0.5):
        ours, mine = held.boxes(0, float(t))
        theirs, other = held.boxes(1, float(t))
        both = np.intersect1d(ours, theirs)
        if not len(both):
            continue
        a = mine[np.searchsorted(ours, both)]
        b, _ = way.boxes(other[np.searchsorted(theirs, both)])
        error = (a - b)[:, :2] + 0.5 * (a - b)[:, 2:]
        for k, name in enumerate(_KINDS):
            errors[name].append(np.linalg.norm(error[held.kind[both] == k], axis=1))
    return {name: np.concatenate(parts) if parts else np.zeros(0) for name, parts in errors.items()}


def true_offset(scene: RigScene, at_s: float) -> float:
    """What the second clock is ahead of the first, at a reading of the second (s)."""
    ours, theirs = scene.clocks
    t = theirs.start + (at_s - theirs.first) / (1.0 + theirs.drift_ppm * _PPM)
    return at_s - float(ours.reading(np.array([t]))[0])
