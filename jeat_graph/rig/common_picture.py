"""From each sensor's own picture and clock to the common ones, by what a configuration says of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.config.section_tree import build, plain
from jeat_graph.config.sensors import ClockConfig, SensorConfig
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.box_std import scaled_std
from jeat_graph.data.camera_motion import scaled_motion
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.lens import RadialLens
from jeat_graph.data.picture_map import PictureMap

_PPM = 1e-6
# Pictures whose sides have ratios this near to each other are of one shape.
_SAME_SHAPE = 0.01


def common_time(t: FloatArray, clock: ClockConfig) -> FloatArray:
    """Return times (N,) of a sensor's clock on the common one (s)."""
    return np.asarray(t - clock.offset_s - clock.drift_ppm * _PPM * (t - clock.at_s))


def own_time(t: FloatArray, clock: ClockConfig) -> FloatArray:
    """Return common times (N,) on a sensor's clock (s): the inverse of `common_time`."""
    drift = clock.drift_ppm * _PPM
    return np.asarray((t + clock.offset_s - drift * clock.at_s) / (1.0 - drift))


class Way(NamedTuple):
    """What brings the scans of one sensor to the others.

    Attributes:
        picture: the way of its boxes, None where they are in the common picture.
        own: width and height of its own picture (px), None without a way.
        clock: the way of its times, None where they are common ones.
    """

    picture: PictureMap | None
    own: tuple[float, float] | None
    clock: ClockConfig | None


@dataclass
class CommonPicture:
    """Brings scans to the common picture and clock.

    Attributes:
        ways: by sensor, of those that need one.
        lost: boxes that the camera of the common picture cannot see, which were left out.
    """

    ways: Mapping[str, Way]
    lost: int = 0

    @staticmethod
    def of(config: Config) -> CommonPicture:
        """Collect the ways of a configuration's sensors.

        Raises:
            ConfigError: a sensor's picture has another shape than the common one, and no way is given.
        """
        ways = {name: _way(name, one, config) for name, one in sorted(config.sensors.items())}
        return CommonPicture(
            {name: way for name, way in ways.items() if any(part is not None for part in way)}
        )

    def scan(self, scan: Scan) -> Scan:
        """Bring one scan, boxes and time."""
        way = self.ways.get(scan.sensor)
        if way is None:
            return scan
        if way.clock is not None:
            scan = replace(scan, t=float(common_time(np.array([scan.t]), way.clock)[0]))
        return self.boxes(scan)

    def boxes(self, scan: Scan) -> Scan:
        """Bring the boxes of one scan, and leave its time."""
        way = self.ways.get(scan.sensor)
        if way is None or way.picture is None or (not len(scan) and scan.camera_motion is None):
            return scan
        boxes, seen = way.picture.boxes(scan.boxes)
        self.lost += int((~seen).sum())
        return Scan(
            scan.t,
            scan.sensor,
            boxes[seen],
            scan.scores[seen],
            None if scan.classes is None else scan.classes[seen],
            None if scan.embeddings is None else scan.embeddings[seen],
            None if scan.camera_motion is None else _motion_in(way.picture, scan.camera_motion),
            None if scan.box_std is None else scaled_std(scan.box_std, scan.boxes, boxes)[seen],
        )

    def detections(self, detections: Detections) -> Detections:
        """Bring a recording; scans stay, be it without boxes."""
        if not any(name in self.ways for name in detections.sensors):
            return detections
        boxes, seen = detections.boxes.copy(), np.ones(len(detections), dtype=bool)
        t = detections.scan_t.copy()
        of_row = detections.box_sensor
        for code, name in enumerate(detections.sensors):
            way = self.ways.get(name, _NO_WAY)
            if way.clock is not None:
                scans = detections.scan_sensor == code
                t[scans] = common_time(t[scans], way.clock)
            if way.picture is not None:
                rows = np.flatnonzero(of_row == code)
                boxes[rows], seen[rows] = way.picture.boxes(boxes[rows])
        std = detections.box_std
        std = None if std is None else scaled_std(std, detections.boxes, boxes)
        self.lost += int((~seen).sum())
        motions = self._motions(detections)
        moved = replace(detections, boxes=boxes, camera_motion=motions, box_std=std).where(seen)
        return moved if np.array_equal(t, detections.scan_t) else at_times(moved, t)

    def _motions(self, detections: Detections) -> FloatArray | None:
        """Return the cameras' motions (K, 11) in the common picture."""
        if detections.camera_motion is None:
            return None
        motions = detections.camera_motion.copy()
        for k in np.flatnonzero(~np.isnan(motions[:, 0])):
            way = self.ways.get(detections.sensors[detections.scan_sensor[k]], _NO_WAY)
            if way.picture is not None:
                motions[k] = _motion_in(way.picture, motions[k])
        return motions


# What a sensor's configuration says of its way.
_WAY_KEYS = ("image", "to_picture", "to_picture_cov", "lens", "clock")
_NO_WAY = Way(None, None, None)


def at_times(detections: Detections, t: FloatArray) -> Detections:
    """Give the scans of a recording other times (K,), and put them in their order."""
    order = np.argsort(t, kind="stable")
    scans = [replace(detections.scan(int(k)), t=float(t[k])) for k in order]
    return replace(Detections.from_scans(scans), dropped=detections.dropped)


def in_common(detections: Detections, config: Config) -> tuple[Detections, Config, list[str]]:
    """Bring a recording to the common picture and clock.

    Args:
        detections: as its files have it.
        config: its sensors may say `image`, `to_picture` and `clock`.

    Returns:
        The recording; the configuration for it, whose sensors have no way any more but the noise that theirs
        adds; and a line for each thing to be reported.

    Raises:
        ConfigError: as `CommonPicture.of`.
    """
    common = CommonPicture.of(config)
    if not common.ways:
        return detections, config, []
    moved = common.detections(detections)
    notes = [_note(name, way) for name, way in common.ways.items() if name in detections.sensors]
    if common.lost:
        notes.append(
            f"{common.lost} boxes lie where the common picture's camera cannot see, and are left out"
        )
    return moved, without_ways(with_map_noise(config)), notes


def with_map_noise(config: Config) -> Config:
    """Add to each sensor's noise what its way into the common picture does not know exactly."""
    sensors = {}
    for name, one in config.sensors.items():
        picture, own, _ = _way(name, one, config)
        if picture is None or own is None:
            sensors[name] = one
            continue
        sigma = float(np.hypot(one.sigma_px * picture.gain(own), picture.std_px(own)))
        sensors[name] = replace(one, sigma_px=sigma)
    return replace(config, sensors=sensors)


def without_ways(config: Config) -> Config:
    """Take the sensors' own pictures and clocks out of a configuration, for recordings brought together."""
    return replace(
        config,
        sensors={
            name: replace(one, image=None, to_picture=(), to_picture_cov=(), lens=(), clock=None)
            for name, one in config.sensors.items()
        },
    )


def with_ways_of(config: Config, other: Config) -> Config:
    """Put the sensors' own pictures and clocks of another configuration into one that was found beside it."""
    sensors = {
        name: replace(one, **{key: getattr(other.sensors[name], key) for key in _WAY_KEYS})
        if name in other.sensors
        else one
        for name, one in config.sensors.items()
    }
    return replace(config, sensors=sensors)


def recorded_ways(config: Config) -> dict[str, dict[str, Any]]:
    """Return what a configuration says of sensors' own pictures and clocks, as `run.json` keeps it."""
    found: dict[str, dict[str, Any]] = {}
    for name in CommonPicture.of(config).ways:
        one = {key: getattr(config.sensors[name], key) for key in _WAY_KEYS}
        clock = one["clock"]
        found[name] = plain({**one, "clock": None if clock is None else asdict(clock)})
    return found


def by_recorded_ways(detections: Detections, config: Config, ways: Mapping[str, Any]) -> Detections:
    """Bring a recording to the common picture and clock again, as a run did.

    Args:
        detections: as its files have it.
        config: of the run, whose sensors have no ways any more.
        ways: what `recorded_ways` returned then.

    Raises:
        ConfigError: they are no such ways.
    """
    sensors = dict(config.sensors)
    for name, one in ways.items():
        sensor = build(SensorConfig, {"rate_hz": sensors[name].rate_hz, **one}, f"ways.{name}.")
        sensors[name] = replace(sensors[name], **{key: getattr(sensor, key) for key in _WAY_KEYS})
    return CommonPicture.of(replace(config, sensors=sensors)).detections(detections)


def _motion_in(picture: PictureMap, motion: FloatArray) -> FloatArray:
    """Return a camera's motion (11,) in the common picture: as a small box about its centre goes there."""
    x, y = motion[1:3]
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]) + np.array([x - 0.5, y - 0.5])
    boxes, _ = picture.boxes(np.concatenate([corner, np.ones((3, 2))], axis=1))
    place, right, down = boxes[:, :2] + boxes[:, 2:] / 2.0
    return scaled_motion(motion, place, np.stack([right - place, down - place], axis=1))


def _way(name: str, sensor: SensorConfig, config: Config) -> Way:
    if sensor.image is None:
        return Way(None, None, sensor.clock)
    if sensor.to_picture:
        numbers = np.array(sensor.to_picture)
        free = len(numbers) - 1 + len(sensor.lens)
        covariance, lenses = None, None
        if sensor.to_picture_cov:
            covariance = np.array(sensor.to_picture_cov).reshape(free, free)
        if sensor.lens:
            lenses = lenses_of(sensor.lens, sensor.image, (config.image.width, config.image.height))
        try:
            picture = PictureMap.of_numbers(numbers, covariance, lenses)
        except DataError as error:
            raise ConfigError(f"sensors.{name}.to_picture: {error.message}") from None
        return Way(picture, sensor.image, sensor.clock)
    if config.input.picture == "seen":
        raise ConfigError(
            f"sensors.{name}.image: a sensor with a picture of its own needs to know the common one: give "
            "its size with --image WxH"
        )
    own, common = sensor.image, (config.image.width, config.image.height)
    if own == common:
        return Way(None, None, sensor.clock)
    if abs(own[0] * common[1] / (own[1] * common[0]) - 1.0) > _SAME_SHAPE:
        raise ConfigError(
            f"sensors.{name}.image: {own[0]:g} x {own[1]:g} px are of another shape than the common picture, "
            f"{common[0]:g} x {common[1]:g}: say how they lie with sensors.{name}.to_picture, or find "
            "it with `jeat-graph register`"
        )
    return Way(PictureMap.scale(own, common), own, sensor.clock)


def lenses_of(
    k1: Sequence[float], own: tuple[float, float], common: tuple[float, float]
) -> tuple[RadialLens, RadialLens]:
    """Return the lenses of the own and of the common picture (width, height in px) with their distortions."""
    return RadialLens.of_picture(k1[0], own), RadialLens.of_picture(k1[1], common)


def _note(name: str, way: Way) -> str:
    parts = []
    if way.picture is not None and way.own is not None:
        kind = "a matrix with parallax" if way.picture.parallax else "a homography"
        if np.array_equal(way.picture.matrix[:, :3], np.diag(way.picture.matrix[:, :3].diagonal())):
            kind = "scale"
        if way.picture.lenses is not None:
            kind += " between lenses that bend"
        std = way.picture.std_px(way.own)
        sure = f" (± {std:.2g} px)" if std else ""
        parts.append(
            f"boxes go from {way.own[0]:g} x {way.own[1]:g} px to the common picture by {kind}{sure}"
        )
    if way.clock is not None:
        drift = f", drift {way.clock.drift_ppm:.3g} ppm" if way.clock.drift_ppm else ""
        parts.append(f"{way.clock.offset_s:.6g} s are taken off its times{drift}")
    return f"sensor {name!r}: {'; '.join(parts)}"
