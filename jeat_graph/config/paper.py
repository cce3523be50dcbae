"""Settings of the engine `paper`: the numbers of the paper, and those that it leaves open."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jeat_graph.config.fields import Section, number
from jeat_graph.data.errors import ConfigError


@dataclass(frozen=True)
class PaperConfig(Section):
    """The paper's method to the letter; used by `tracker.engine=paper` alone."""

    jerk_px: float = number(200.0, "px/s^2.5", "root spectral density σ_j of jerk (eq. 2)", open_low=True)
    velocity_std_px: float = number(150.0, "px/s", "std of a new track's velocity", open_low=True)
    acceleration_std_px: float = number(100.0, "px/s²", "std of a new track's acceleration", open_low=True)
    size_rate_density: float = number(
        0.5, "1/s^1.5", "root spectral density of the rate of ln width and ln height", open_low=True
    )
    size_rate_std: float = number(0.5, "1/s", "std of a new track's rate of ln size", open_low=True)
    adaptation_rate: float = number(0.1, "1", "η of the noise's adaptation", 0.0, 1.0)
    scale_min: float = number(0.5, "1", "s_min of the noise's adaptation", open_low=True)
    scale_max: float = number(5.0, "1", "s_max of the noise's adaptation", open_low=True)
    score_floor: float = number(
        0.1, "1", "R is divided by max(score, this); 1: scores do not count", 0.0, 1.0, open_low=True
    )
    gate_probability: float = number(0.99, "1", "probability mass of the χ² gate", 0.5, 1.0 - 1e-12)
    confirm_age_s: float = number(0.5, "s", "τ_confirm: least age of a confirmed track")
    confirm_hits: int = number(5, "1", "n_min: least number of its detections", low=1)
    max_gap_confirmed_s: float = number(0.5, "s", "τ_max of confirmed tracks")
    max_gap_tentative_s: float = number(0.2, "s", "τ_max of tentative tracks")
    pair_within_s: float = number(
        0.0,
        "s",
        "scans of different sensors no further apart than this are associated jointly, at the last one's "
        "time; in recordings and with `stream --joint`",
        0.0,
        1.0,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.scale_min > self.scale_max:
            raise ConfigError(f"scale_min: {self.scale_min} is above scale_max, {self.scale_max}")

    @property
    def gate(self) -> float:
        """Bound on d² that holds `gate_probability` of χ² with two degrees of freedom."""
        return -2.0 * math.log1p(-self.gate_probability)
