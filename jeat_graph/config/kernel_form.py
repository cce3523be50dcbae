"""The configuration as flat numbers and arrays, the form in which compiled kernels take it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jeat_graph.association.joint import JOINT, SEQUENTIAL, SLOTS
from jeat_graph.config.schema import Config, SensorConfig
from jeat_graph.data.arrays import FloatArray, IntArray

# Costs of the paper's problem are d² <= gate; leaving a row out must cost more than any sum of them, so that
# as many pairs as possible are taken. Small enough that sums keep ten digits behind the point.
_TAKE_ALL = 1.0e5


class SensorArrays(NamedTuple):
    """Parameters of the S sensors, in alphabetical order of their names (see `config.SensorConfig`).

    Attributes:
        sigma_px: (S,) px.
        rho: (S, 2) fraction of width and height.
        share: (S,) share of the centre's noise variance that has memory.
        error: (S,) the sensor's error state, counted from 0; -1 where its errors are white.
        memory: (B,) correlation time of each error state (s).
        size_var: (S, 2) variances of ln width, ln height.
        bias: (S, 4) centre x / width, centre y / height, ln width, ln height.
        p_detect: (S,) prior of a new track.
        clutter: (S,) expected false boxes a scan.
        period: (S,) nominal time between scans (s).
        precision: (S,) overall.
        curve_score: (S, K) knots of the calibrated precision, padded with the last.
        curve_precision: (S, K) its values.
        tempering: (S,) exponent on evidence.
        blind_speed: (S,) px/s.
    """

    sigma_px: FloatArray
    rho: FloatArray
    share: FloatArray
    error: IntArray
    memory: FloatArray
    size_var: FloatArray
    bias: FloatArray
    p_detect: FloatArray
    clutter: FloatArray
    period: FloatArray
    precision: FloatArray
    curve_score: FloatArray
    curve_precision: FloatArray
    tempering: FloatArray
    blind_speed: FloatArray


class Settings(NamedTuple):
    """All scalars of `config.Config`; names follow its sections, gates are χ² bounds."""

    image_width: float
    image_height: float
    jerk_px: float
    jerk_per_size: float
    jerk_per_growth: float
    velocity_std_px: float
    velocity_std_per_size: float
    acceleration_std_px: float
    acceleration_std_per_size: float
    standing: bool
    standing_enter: float
    standing_leave: float
    standing_age_s: float
    standing_memory: float
    standing_drift: float
    standing_speed_std: float
    standing_jerk: float
    standing_gap_s: float
    size_rate_density: float
    size_rate_std: float
    adaptation_rate: float
    scale_min: float
    scale_max: float
    score_weighting: bool
    score_floor: float
    method: int
    likelihood: bool
    second_pass: bool
    gate: float
    size_gate: float
    unassigned_cost: float
    log_clutter_volume: float
    scene_memory_s: float
    by_existence: bool
    confirm_existence: float
    delete_existence: float
    lifetime_s: float
    hidden_prior: float
    hidden_memory_s: float
    p_detect_weight: float
    p_detect_min: float
    p_detect_max: float
    confirm_age_s: float
    confirm_hits: int
    max_gap_confirmed_s: float
    max_gap_tentative_s: float
    leave_picture: bool
    arrival_rate: float
    birth_min_existence: float
    birth_max_overlap: float
    merge: bool
    merge_min_overlap: float
    merge_velocity_gate: float
    output_min_existence: float
    output_max_gap_s: float
    output_clip: bool
    output_min_visible: float


def error_states(sensors: Sequence[SensorConfig]) -> tuple[IntArray, FloatArray]:
    """Number the error states of the sensors whose errors have memory, in their order.

    Args:
        sensors: S sensors.

    Returns:
        (S,) the error state of each, counted from 0, or -1; (B,) correlation time of each error state (s).
    """
    lasting = np.array([s.correlated_share > 0.0 for s in sensors])
    return np.where(lasting, np.cumsum(lasting) - 1, -1), np.array([s.memory_s for s in sensors])[lasting]


def sensor_arrays(config: Config) -> SensorArrays:
    """Collect the parameters of the sensors into arrays, in the order of `config.sensor_names`."""
    sensors = [config.sensors[name] for name in config.sensor_names]
    knots = max(len(s.score_precision) for s in sensors)
    curves = [s.score_precision + s.score_precision[-1:] * (knots - len(s.score_precision)) for s in sensors]
    # Knots at one place would make the interpolation ambiguous; the padding lies beyond every score.
    score = np.array(
        [
            [p[0] if k < len(s.score_precision) else 2.0 + k for k, p in enumerate(c)]
            for s, c in zip(sensors, curves, strict=True)
        ]
    )
    error, memory = error_states(sensors)
    return SensorArrays(
        sigma_px=np.array([s.sigma_px for s in sensors]),
        rho=np.array([[s.rho_x, s.rho_y] for s in sensors]),
        share=np.array([s.correlated_share for s in sensors]),
        error=error,
        memory=memory,
        size_var=np.array([[s.sigma_log_width**2, s.sigma_log_height**2] for s in sensors]),
        bias=np.array([s.bias for s in sensors]),
        p_detect=np.array([s.p_detect for s in sensors]),
        clutter=np.array([s.clutter_per_scan for s in sensors]),
        period=np.array([1.0 / s.rate_hz for s in sensors]),
        precision=np.array([s.precision for s in sensors]),
        curve_score=score,
        curve_precision=np.array([[p[1] for p in c] for c in curves]),
        tempering=np.array([s.tempering for s in sensors]),
        blind_speed=np.array([s.blind_speed for s in sensors]),
    )


def kernel_settings(config: Config) -> Settings:
    """Flatten the configuration, with probabilities of gates turned into χ² bounds."""
    c = config
    likelihood = c.association.cost == "likelihood"
    return Settings(
        image_width=c.image.width,
        image_height=c.image.height,
        jerk_px=c.motion.jerk_px,
        jerk_per_size=c.motion.jerk_per_size,
        jerk_per_growth=c.motion.jerk_per_growth,
        velocity_std_px=c.motion.velocity_std_px,
        velocity_std_per_size=c.motion.velocity_std_per_size,
        acceleration_std_px=c.motion.acceleration_std_px,
        acceleration_std_per_size=c.motion.acceleration_std_per_size,
        standing=c.standing.enabled,
        standing_enter=c.standing.enter_odds,
        standing_age_s=c.standing.min_age_s,
        standing_leave=c.standing.leave_odds,
        standing_memory=c.standing.memory,
        standing_drift=c.standing.drift_per_size,
        standing_speed_std=c.standing.speed_std_per_size,
        standing_jerk=c.standing.jerk_factor,
        standing_gap_s=c.standing.max_gap_s,
        size_rate_density=c.size.rate_density,
        size_rate_std=c.size.rate_std,
        adaptation_rate=c.noise.adaptation_rate,
        scale_min=c.noise.scale_min,
        scale_max=c.noise.scale_max,
        score_weighting=c.noise.score_weighting,
        score_floor=c.noise.score_floor,
        method={"slots": SLOTS, "joint": JOINT, "sequential": SEQUENTIAL}[c.association.method],
        likelihood=likelihood,
        second_pass=c.association.second_pass and c.association.method != "slots",
        gate=_chi2_bound(c.association.gate_probability),
        size_gate=_chi2_bound(c.association.gate_probability) if c.association.size_gate else float("inf"),
        unassigned_cost=0.0 if likelihood else _TAKE_ALL,
        log_clutter_volume=float(np.log(c.image.width * c.image.height * c.association.log_size_range**2)),
        scene_memory_s=c.lifecycle.scene_memory_s,
        by_existence=c.lifecycle.method == "existence",
        confirm_existence=c.lifecycle.confirm_existence,
        delete_existence=c.lifecycle.delete_existence,
        lifetime_s=c.lifecycle.lifetime_s,
        hidden_prior=c.lifecycle.hidden_prior,
        hidden_memory_s=c.lifecycle.hidden_memory_s,
        p_detect_weight=c.lifecycle.p_detect_weight,
        p_detect_min=c.lifecycle.p_detect_min,
        p_detect_max=c.lifecycle.p_detect_max,
        confirm_age_s=c.lifecycle.confirm_age_s,
        confirm_hits=c.lifecycle.confirm_hits,
        max_gap_confirmed_s=c.lifecycle.max_gap_confirmed_s,
        max_gap_tentative_s=c.lifecycle.max_gap_tentative_s,
        leave_picture=c.lifecycle.leave_picture,
        arrival_rate=c.birth.arrival_rate_hz,
        birth_min_existence=c.birth.min_existence,
        birth_max_overlap=c.birth.max_overlap,
        merge=c.merge.enabled,
        merge_min_overlap=c.merge.min_overlap,
        merge_velocity_gate=_chi2_bound(c.merge.gate_probability),
        output_min_existence=c.output.min_existence,
        output_max_gap_s=c.output.max_gap_s,
        output_clip=c.output.clip,
        output_min_visible=c.output.min_visible,
    )


def _chi2_bound(probability: float) -> float:
    """Bound below which a χ² variable of 2 degrees of freedom lies with this probability, −2 ln(1 − p)."""
    return -2.0 * math.log1p(-probability)


def priority_order(config: Config) -> IntArray:
    """Sensors in the order in which the sequential association serves them (S,)."""
    names = config.sensor_names
    first = list(config.association.priority)
    rest = [name for name in names if name not in first]
    return np.array([names.index(name) for name in first + rest], dtype=np.int64)
