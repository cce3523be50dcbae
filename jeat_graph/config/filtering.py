"""Settings of the filters: picture, motion in it, standing still, growth of boxes, measurement noise."""

from __future__ import annotations

from dataclasses import dataclass

from jeat_graph.config.fields import Section, flag, number
from jeat_graph.data.errors import ConfigError

# Densities of jerk between which innovations choose: a calm one, the usual one, that of a manoeuvre.
_DENSITIES = 3


@dataclass(frozen=True)
class ImageConfig(Section):
    """The picture that both sensors' boxes refer to."""

    width: float = number(1280.0, "px", "width of the picture", open_low=True)
    height: float = number(720.0, "px", "height of the picture", open_low=True)
    edge_px: float = number(
        0.0,
        "px",
        "a side of a box so near to the edge of the picture is where the picture ends, and measures nothing; "
        "0: all boxes are whole",
    )


@dataclass(frozen=True)
class MotionConfig(Section):
    """Constant acceleration driven by white jerk (paper eq. 2) and the prior of a new track."""

    jerk_px: float = number(0.0, "px/s^2.5", "root spectral density of jerk that does not depend on size")
    jerk_per_size: float = number(
        1.5, "1/s^2.5", "root spectral density of jerk per px of box size sqrt(w h)"
    )
    jerk_per_growth: float = number(
        0.0, "1", "root spectral density of jerk by perspective, in units of box size · growth rate^2.5"
    )
    manoeuvre_step: float = number(
        1.0,
        "1",
        "how many times as hard as usual a manoeuvre is, by the root density of its jerk; with `calm_step` "
        "1, too, a track's innovations choose nothing",
        1.0,
        100.0,
    )
    calm_step: float = number(
        1.0,
        "1",
        "how many times calmer than usual a track may go, by the same; 1: no calmer",
        1.0,
        100.0,
    )
    calm_prior: float = number(
        0.1, "1", "odds that it does against the usual, before anything is known", 0.0, 100.0
    )
    manoeuvre_memory_s: float = number(2.0, "s", "how long a manoeuvre lasts", open_low=True)
    manoeuvre_prior: float = number(
        0.05,
        "1",
        "odds of a manoeuvre against the usual, before anything is known",
        0.0,
        1.0,
    )
    velocity_std_px: float = number(20.0, "px/s", "std of a new track's velocity")
    velocity_std_per_size: float = number(3.0, "1/s", "std of a new track's velocity per px of box size")
    acceleration_std_px: float = number(1.0, "px/s²", "std of a new track's acceleration", open_low=True)
    acceleration_std_per_size: float = number(1.0, "1/s²", "the same per px of box size")
    unseen_memory_s: float = number(
        0.0, "s", "time constant with which acceleration and growth of an unseen track die away; 0: they stay"
    )

    @property
    def densities(self) -> int:
        """Number of densities of jerk between which a track's innovations choose; 0: there is no choice."""
        return _DENSITIES if max(self.manoeuvre_step, self.calm_step) > 1.0 else 0

    @property
    def first_odds(self) -> tuple[float, float]:
        """Odds of the calm density and of a manoeuvre's against the usual one; 0 of one that is not there."""
        return (
            self.calm_prior if self.calm_step > 1.0 else 0.0,
            self.manoeuvre_prior if self.manoeuvre_step > 1.0 else 0.0,
        )


@dataclass(frozen=True)
class StandingConfig(Section):
    """Tracks that stand still: hard to see for either sensor in the dark, and not to be lost."""

    enabled: bool = flag(True, "look for tracks that stand still")
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
class SizeConfig(Section):
    """Filter of ln width and ln height: a nearly constant rate of change."""

    rate_density: float = number(0.5, "1/s^1.5", "root spectral density of the rate's white driving noise")
    density_per_growth: float = number(
        0.0, "1", "root spectral density of the rate's noise by perspective, in units of growth rate^1.5"
    )
    rate_std: float = number(0.5, "1/s", "std of a new track's rate of ln size")
    change_step: float = number(
        1.0,
        "1",
        "how many times as hard as usual boxes may change their size, by the root density of the rate; with "
        "`calm_step` 1, too, a track's sizes choose nothing",
        1.0,
        100.0,
    )
    calm_step: float = number(
        1.0, "1", "how many times calmer than usual they may change, by the same; 1: no calmer", 1.0, 100.0
    )
    change_prior: float = number(
        1.0, "1", "odds of the hard changes against the usual, before anything is known", 0.0, 100.0
    )
    calm_prior: float = number(0.1, "1", "odds of the calm ones, likewise", 0.0, 100.0)
    change_memory_s: float = number(2.0, "s", "how long boxes go on to change so", open_low=True)

    @property
    def hardest_density(self) -> float:
        """Root spectral density of the rate where boxes change hardest (1/s^1.5)."""
        return self.rate_density * self.change_step

    @property
    def densities(self) -> int:
        """Number of densities between which a track's sizes choose; 0: there is no choice."""
        return _DENSITIES if max(self.calm_step, self.change_step) > 1.0 else 0

    @property
    def first_odds(self) -> tuple[float, float]:
        """Odds of the calm density and of the hard one against the usual; 0 of one that is not there."""
        return (
            self.calm_prior if self.calm_step > 1.0 else 0.0,
            self.change_prior if self.change_step > 1.0 else 0.0,
        )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rate_density == self.rate_std == 0.0:
            raise ConfigError("rate_std: must not be 0 where rate_density is: sizes could not change")


@dataclass(frozen=True)
class BoxesConfig(Section):
    """What is learnt of each sensor's boxes beside those of other sensors (`filters.box_offsets`)."""

    centre_share: float = number(
        0.5,
        "1",
        "std of a systematic error of the centre, as a share of the side, next to sensors.*.bias_std",
    )
    centre_px: float = number(
        20.0, "px", "std of a systematic error of the centre that all boxes have, next to sensors.*.bias_std"
    )
    place_share: float = number(
        0.03,
        "1",
        "std of how a systematic error of the centre grows with the place in the picture (px per px), next "
        "to sensors.*.bias_std",
    )
    lag_s: float = number(0.3, "s", "std of how late a sensor's clock is, next to sensors.*.bias_std")
    pair_s: float = number(0.1, "s", "two sensors' boxes so close in time are compared")
    witness_s: float = number(
        1.0, "s", "boxes of one vehicle are one independent witness in so much time", open_low=True
    )
    tail_freedom: float = number(
        4.0, "1", "degrees of freedom of Student's t for the difference of two boxes", 0.5
    )
    prior_s: float = number(
        1.0,
        "s",
        "what is assumed of the noise of these differences weighs as much as so long a look at a vehicle",
        open_low=True,
    )
    memory_s: float = number(1000.0, "s", "memory of what was learnt", open_low=True)


@dataclass(frozen=True)
class NoiseConfig(Section):
    """Adaptive measurement noise R = s R_base / g (paper eq. 5 and section on adaptive noise)."""

    adaptation_rate: float = number(0.1, "1", "η of eq. 5", 0.0, 1.0)
    scale_min: float = number(1.0, "1", "s_min of eq. 5 (paper .5)", open_low=True)
    scale_max: float = number(5.0, "1", "s_max of eq. 5", open_low=True)
    score_weighting: bool = flag(False, "divide R by max(score, score_floor)")
    score_floor: float = number(0.1, "1", "floor of the score in R", 0.001, 1.0)
    hidden_growth: float = number(
        0.0, "1", "growth of the error's std, as a share of it, where all of a vehicle is hidden by another"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.scale_min > self.scale_max:
            raise ConfigError("scale_min: must not be greater than scale_max")
