"""Configuration: every constant of the method, with its unit, its bounds and where it comes from.

A configuration is a tree of frozen dataclasses. `config_io` reads it from YAML and writes it back.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, fields
from typing import Any

from jeat_graph.data.errors import ConfigError


def number(
    default: Any, unit: str, doc: str, low: float = 0.0, high: float = math.inf, open_low: bool = False
) -> Any:
    """Declare a numeric field with unit, meaning and closed bounds (open at `low` if `open_low`)."""
    meta = {"unit": unit, "doc": doc, "low": low, "high": high, "open_low": open_low}
    return field(default=default, metadata=meta)


def choice(default: str, options: tuple[str, ...], doc: str) -> Any:
    """Declare a text field that takes one of `options`."""
    return field(default=default, metadata={"options": options, "doc": doc})


def check(section: Any, where: str) -> None:
    """Check each field of a section against its declared bounds or options.

    Raises:
        ConfigError: names the field as `where.field`, its value and what would be right.
    """
    for f in fields(section):
        value, meta = getattr(section, f.name), f.metadata
        if "options" in meta and value not in meta["options"]:
            raise ConfigError(f"{where}{f.name}: {value!r} is not one of {', '.join(meta['options'])}")
        if "low" in meta and value is not None:
            for v in value if isinstance(value, tuple) else (value,):
                too_low = v <= meta["low"] if meta["open_low"] else v < meta["low"]
                if not math.isfinite(v) or too_low or v > meta["high"]:
                    bracket = "(" if meta["open_low"] else "["
                    bounds = f"{bracket}{meta['low']}, {meta['high']}]"
                    raise ConfigError(f"{where}{f.name}: {v} is not in {bounds} ({meta['unit']})")


@dataclass(frozen=True)
class SensorConfig:
    """What is known of one sensor and its detector. `calibrate` estimates all of it from data."""

    rate_hz: float = number(20.0, "Hz", "nominal rate of its scans", open_low=True)
    sigma_px: float = number(2.0, "px", "noise of the box centre that does not depend on size", open_low=True)
    rho_x: float = number(0.03, "1", "noise of the box centre in x as a fraction of the width (method: rho)")
    rho_y: float = number(0.03, "1", "noise of the box centre in y as a fraction of the height (method: rho)")
    correlated_share: float = number(
        0.0, "1", "share of the centre's noise variance that persists from scan to scan", 0.0, 0.99
    )
    memory_s: float = number(0.2, "s", "correlation time of that share", 1e-3, 1e4)
    sigma_log_width: float = number(0.08, "ln px", "noise of the logarithm of the width", open_low=True)
    sigma_log_height: float = number(0.08, "ln px", "noise of the logarithm of the height", open_low=True)
    bias: tuple[float, float, float, float] = number(
        (0.0, 0.0, 0.0, 0.0),
        "1",
        "systematic error: centre x / width, centre y / height, ln width, ln height",
        low=-1.0,
        high=1.0,
    )
    p_detect: float = number(0.9, "1", "probability that a visible vehicle is detected", 0.01, 0.999)
    clutter_per_scan: float = number(0.3, "boxes", "mean number of false boxes a scan", open_low=True)
    precision: float = number(0.9, "1", "fraction of its boxes that are vehicles", 0.001, 0.999)
    score_precision: tuple[tuple[float, float], ...] = field(
        default=((0.0, 0.02), (1.0, 0.98)),
        metadata={
            "doc": "calibrated precision of a box of this score: (score, precision) knots, both rising"
        },
    )
    tempering: float = number(
        1.0, "1", "exponent on evidence, below 1 where false boxes repeat in time", 0.01, 1.0
    )
    blind_speed: float = number(
        0.0, "px/s", "image speed below which the sensor sees nothing (events); 0: it sees what stands still"
    )

    def __post_init__(self) -> None:
        check(self, "sensor.")
        knots = self.score_precision
        ok = len(knots) >= 1 and all(0 <= s <= 1 and 0 <= p <= 1 for s, p in knots)
        rising = all(b[0] > a[0] and b[1] >= a[1] for a, b in itertools.pairwise(knots))
        if not (ok and rising):
            raise ConfigError(
                "sensor.score_precision: scores must rise, precisions must not fall, all in [0, 1]"
            )


@dataclass(frozen=True)
class ImageConfig:
    """The picture that both sensors' boxes refer to."""

    width: float = number(1280.0, "px", "width of the picture", open_low=True)
    height: float = number(720.0, "px", "height of the picture", open_low=True)


@dataclass(frozen=True)
class MotionConfig:
    """Constant acceleration driven by white jerk (paper eq. 2) and the prior of a new track."""

    jerk_px: float = number(0.0, "px/s^2.5", "root spectral density of jerk that does not depend on size")
    jerk_per_size: float = number(
        1.5, "1/s^2.5", "root spectral density of jerk per px of box size sqrt(w h)"
    )
    jerk_per_growth: float = number(
        0.0, "1", "root spectral density of jerk by perspective, in units of box size · growth rate^2.5"
    )
    velocity_std_px: float = number(20.0, "px/s", "std of a new track's velocity")
    velocity_std_per_size: float = number(3.0, "1/s", "std of a new track's velocity per px of box size")
    acceleration_std_px: float = number(1.0, "px/s²", "std of a new track's acceleration", open_low=True)
    acceleration_std_per_size: float = number(1.0, "1/s²", "the same per px of box size")


@dataclass(frozen=True)
class StandingConfig:
    """Tracks that stand still: hard to see for either sensor in the dark, and not to be lost."""

    enabled: bool = field(default=True, metadata={"doc": "look for tracks that stand still"})
    enter_odds: float = number(5.0, "1", "log odds at which a track counts as standing", -30.0, 30.0)
    min_age_s: float = number(0.7, "s", "time at one place before a track may count as standing")
    leave_odds: float = number(-2.0, "1", "log odds at which it no longer does", -30.0, 30.0)
    memory: float = number(0.95, "1", "part of the log odds kept from one measurement to the next", 0.0, 1.0)
    drift_per_size: float = number(0.02, "1/√s", "random walk of the point that stays, per px of box size")
    speed_std_per_size: float = number(
        0.05, "1/s", "std of the zero-velocity pseudo-measurement per px of box size", open_low=True
    )
    jerk_factor: float = number(0.1, "1", "factor on the jerk of a standing track", 0.0, 1.0)
    max_gap_s: float = number(
        10.0, "s", "a confirmed standing track is kept, and reported, this long without update"
    )


@dataclass(frozen=True)
class SizeConfig:
    """Filter of ln width and ln height: a nearly constant rate of change."""

    rate_density: float = number(0.5, "1/s^1.5", "root spectral density of the rate's white driving noise")
    rate_std: float = number(0.5, "1/s", "std of a new track's rate of ln size")


@dataclass(frozen=True)
class NoiseConfig:
    """Adaptive measurement noise R = s R_base / g (paper eq. 5 and section on adaptive noise)."""

    adaptation_rate: float = number(0.1, "1", "η of eq. 5", 0.0, 1.0)
    scale_min: float = number(1.0, "1", "s_min of eq. 5 (paper .5)", open_low=True)
    scale_max: float = number(5.0, "1", "s_max of eq. 5", open_low=True)
    score_weighting: bool = field(default=False, metadata={"doc": "divide R by max(score, score_floor)"})
    score_floor: float = number(0.1, "1", "floor of the score in R", 0.001, 1.0)

    def __post_init__(self) -> None:
        check(self, "noise.")
        if self.scale_min > self.scale_max:
            raise ConfigError("noise.scale_min is greater than noise.scale_max")


@dataclass(frozen=True)
class AssociationConfig:
    """How detections are given to tracks."""

    method: str = choice(
        "slots",
        ("slots", "joint", "sequential"),
        "slots: one joint problem with a slot per track and sensor; joint: the paper's, one match a track "
        "and a second pass; sequential: sensor after sensor in the order of `priority`",
    )
    cost: str = choice("likelihood", ("likelihood", "mahalanobis"), "cost of a pair")
    gate_probability: float = number(
        1.0 - 1e-12,
        "1",
        "probability mass of the χ² gates; wide, for the likelihood decides",
        0.5,
        1.0 - 1e-13,
    )
    size_gate: bool = field(default=True, metadata={"doc": "gate ln size too"})
    priority: tuple[str, ...] = field(
        default=(), metadata={"doc": "order of sensors for `sequential`; those not named follow by name"}
    )
    second_pass: bool = field(
        default=True,
        metadata={"doc": "joint and sequential: a matched track takes another sensor's leftover"},
    )
    log_size_range: float = number(
        3.0, "ln px", "range of ln width and of ln height over which false boxes spread", open_low=True
    )


@dataclass(frozen=True)
class LifecycleConfig:
    """When a track is confirmed, reported and given up."""

    method: str = choice("existence", ("existence", "hits"), "Bernoulli existence, or the paper's hit counts")
    confirm_existence: float = number(0.95, "1", "confirmed at this probability of existence", 0.0, 1.0)
    delete_existence: float = number(0.001, "1", "deleted below this probability of existence", 0.0, 1.0)
    lifetime_s: float = number(
        20.0, "s", "mean time a vehicle stays in the picture (decay of existence)", open_low=True
    )
    hidden_prior: float = number(
        0.1,
        "1",
        "share of the time for which a vehicle is hidden from a sensor, whatever the reason",
        0.0,
        0.9,
    )
    hidden_memory_s: float = number(
        0.3, "s", "time after which a hidden vehicle may be visible again", open_low=True
    )
    scene_memory_s: float = number(
        10.0, "s", "memory of the running estimates of each sensor's clutter and P_D; 0 keeps the configured"
    )
    p_detect_weight: float = number(0.05, "1", "weight of one look in a track's own P_D per sensor", 0.0, 1.0)
    p_detect_min: float = number(0.05, "1", "least P_D of a track", 0.001, 0.999)
    p_detect_max: float = number(0.98, "1", "greatest P_D of a track", 0.001, 0.999)
    confirm_age_s: float = number(0.5, "s", "paper: age before confirmation")
    confirm_hits: int = number(5, "1", "paper: hits before confirmation", low=1)
    max_gap_confirmed_s: float = number(
        1.0, "s", "a confirmed track without update is deleted after this (paper .5)"
    )
    max_silence_s: float = number(
        300.0,
        "s",
        "after so long without any scan all tracks are over (longer predictions outgrow a double's digits)",
        high=1000.0,
        open_low=True,
    )
    leave_picture: bool = field(
        default=True, metadata={"doc": "a track whose centre leaves the picture ends"}
    )
    max_gap_tentative_s: float = number(
        0.3, "s", "a tentative track without update is deleted after this (paper .2)"
    )


@dataclass(frozen=True)
class BirthConfig:
    """When a detection that no track took starts a new one."""

    arrival_rate_hz: float = number(2.0, "1/s", "rate at which vehicles enter the scene")
    initial: float = number(10.0, "1", "expected number of vehicles in the scene at the start")
    min_existence: float = number(
        0.002, "1", "least probability of existence with which a detection starts a track", 0.0, 1.0
    )
    max_overlap: float = number(
        0.5,
        "1",
        "no birth where the IoU with a track, or with another birth of this batch, is above",
        0.0,
        1.0,
    )


@dataclass(frozen=True)
class MergeConfig:
    """When two tracks are one vehicle; the older confirmed identity survives."""

    enabled: bool = field(default=True, metadata={"doc": "merge duplicates"})
    min_overlap: float = number(0.7, "1", "IoU above which two tracks may be one", 0.0, 1.0)
    gate_probability: float = number(
        0.99, "1", "χ² mass within which their velocities agree", 0.5, 1.0 - 1e-12
    )


@dataclass(frozen=True)
class OutputConfig:
    """Which tracks the causal table reports."""

    min_existence: float = number(0.5, "1", "reported only above this probability of existence", 0.0, 1.0)
    max_gap_s: float = number(
        0.12, "s", "reported only if updated within this time (paper: as long as it lives)"
    )
    clip: bool = field(default=True, metadata={"doc": "clip boxes to the picture; drop those outside it"})
    min_visible: float = number(
        0.3, "1", "reported only if this fraction of the box lies in the picture", 0.0, 1.0
    )


@dataclass(frozen=True)
class SmootherConfig:
    """How the trajectories of confirmed tracks are smoothed."""

    engine: str = choice(
        "fixed-lag",
        ("fixed-lag", "fixed-lag-rts", "full", "rts", "none"),
        "fixed-lag: GTSAM with a window; full: GTSAM over each whole track once it has ended; fixed-lag-rts "
        "and rts: the same by our own Rauch-Tung-Striebel pass; none: no smoothing",
    )
    lag_s: float = number(
        1.0, "s", "fixed lag: a state is final once this much time has followed", open_low=True
    )
    chunk: int = number(48, "1", "fixed lag: measurements of a track per update", low=1)
    robust: str = choice(
        "none",
        ("none", "cauchy", "student-t"),
        "full and rts: kernel that weighs down outlying measurements",
    )
    output_rate_hz: float = number(0.0, "Hz", "rows per second of the smoothed table; 0: one at each scan")
    worker: bool = field(
        default=False,
        metadata={"doc": "smooth in a process of its own, so that no step of the tracker waits for it"},
    )
    stitch: bool = field(
        default=True,
        metadata={"doc": "full and rts: join the fragments of one vehicle when the recording ends"},
    )
    stitch_max_gap_s: float = number(3.0, "s", "longest time between two fragments of one vehicle")
    stitch_hidden_s: float = number(
        0.5, "s", "mean time for which a vehicle is hidden while others are seen", open_low=True
    )
    stitch_gate_probability: float = number(
        0.9999, "1", "probability mass of the χ² gate within which two fragments agree", 0.5, 1.0 - 1e-12
    )


@dataclass(frozen=True)
class Config:
    """All settings of a tracker. Frozen: make another with `dataclasses.replace` or `override`."""

    sensors: dict[str, SensorConfig]
    image: ImageConfig = field(default_factory=ImageConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    standing: StandingConfig = field(default_factory=StandingConfig)
    size: SizeConfig = field(default_factory=SizeConfig)
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    association: AssociationConfig = field(default_factory=AssociationConfig)
    lifecycle: LifecycleConfig = field(default_factory=LifecycleConfig)
    birth: BirthConfig = field(default_factory=BirthConfig)
    merge: MergeConfig = field(default_factory=MergeConfig)
    output: OutputConfig = field(default_factory=OutputConfig)
    smoother: SmootherConfig = field(default_factory=SmootherConfig)

    def __post_init__(self) -> None:
        if not self.sensors:
            raise ConfigError("sensors: at least one sensor must be declared")
        if len(self.sensors) > 63:
            raise ConfigError(f"sensors: at most 63, not {len(self.sensors)}")
        for name in self.sensors:
            if not name or any(c in name for c in '|,\n\r"') or name != name.strip():
                raise ConfigError(
                    f"sensors: {name!r} cannot be a name (empty, or holds | , quote or newline)"
                )
        unknown = [name for name in self.association.priority if name not in self.sensors]
        if unknown:
            raise ConfigError(f"association.priority: {unknown[0]!r} is not a declared sensor")
        for f in fields(self):
            if f.name not in ("sensors", "noise"):
                check(getattr(self, f.name), f.name + ".")

    @property
    def sensor_names(self) -> tuple[str, ...]:
        """Names of the declared sensors, in alphabetical order: the order of all per-sensor arrays."""
        return tuple(sorted(self.sensors))
