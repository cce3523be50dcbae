"""Gives the probability that a detector finds a vehicle: a product of factors, each with one cause."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.world.truth import Views


@dataclass(frozen=True)
class DetectabilityConfig:
    """What a detector needs to find a vehicle. A half-value of 0 switches its factor off."""

    p_max: float = number(0.99, "1", "probability under the best conditions", 0.0, 1.0)
    half_lux: float = number(0.5, "lux", "visibility at which half of the vehicles are found")
    lux_power: float = number(1.5, "1", "how sharply that falls with light", 0.1, 10.0)
    half_size_px: float = number(6.0, "px", "box size sqrt(w h) at which half of the vehicles are found")
    size_power: float = number(6.0, "1", "how sharply that falls with size", 0.1, 20.0)
    half_range_m: float = number(0.0, "m", "distance at which half of the vehicles are found")
    range_power: float = number(6.0, "1", "how sharply that falls with distance", 0.1, 20.0)
    half_visible: float = number(
        0.3, "1", "uncovered fraction at which half of the vehicles are found", 0.0, 1.0
    )
    visible_power: float = number(4.0, "1", "how sharply that falls with occlusion", 0.1, 20.0)
    blind_speed: float = number(0.0, "px/s", "image speed v_b in 1 - exp(-(v / v_b)²): blind below (events)")
    exposure_s: float = number(0.001, "s", "exposure time; image speed times it is the motion blur")
    half_blur: float = number(0.5, "1", "blur as a fraction of the box size that halves the probability")

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, eq=False)
class Conditions:
    """Under which conditions a sensor sees each of N vehicles.

    Attributes:
        p_detect: (N,) probability of detection.
        light: (N,) the factor by light alone: 1 bright, 0 dark.
        blur: (N,) motion blur as a fraction of the box size.
    """

    p_detect: FloatArray
    light: FloatArray
    blur: FloatArray


def judge(views: Views, config: DetectabilityConfig) -> Conditions:
    """Probability of detection of every view, with the causes that also raise the noise."""
    size = np.sqrt(views.boxes[:, 2] * views.boxes[:, 3])
    speed = np.hypot(views.motion[:, 2], views.motion[:, 3])
    light = _rising(views.lux, config.half_lux, config.lux_power)
    blur = speed * config.exposure_s / size
    factors = [
        light,
        _rising(size, config.half_size_px, config.size_power),
        _rising(views.visible, config.half_visible, config.visible_power),
        _falling(views.distance, config.half_range_m, config.range_power),
        _falling(blur, config.half_blur, 2.0),
    ]
    if config.blind_speed > 0.0:
        factors.append(-np.expm1(-((speed / config.blind_speed) ** 2)))
    return Conditions(config.p_max * np.prod(factors, axis=0), light, blur)


def _rising(value: FloatArray, half: float, power: float) -> FloatArray:
    """Rise from 0 to 1 with value ½ at `half` (Hill function); 1 everywhere for `half` = 0."""
    if half <= 0.0:
        return np.ones_like(value)
    return 1.0 - _falling(value, half, power)


def _falling(value: FloatArray, half: float, power: float) -> FloatArray:
    """Fall from 1 to 0 with value ½ at `half` (Hill function); 1 everywhere for `half` = 0."""
    if half <= 0.0:
        return np.ones_like(value)
    out: FloatArray = 1.0 / (1.0 + (value / half) ** power)
    return out
