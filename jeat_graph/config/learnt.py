"""What was learnt of one sensor while other recordings were tracked: where a tracker begins with it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from jeat_graph.config.fields import LARGEST, Section, number
from jeat_graph.data.errors import ConfigError

# Of two numbers that were rounded, so much more than is possible (relative) is possible.
_ROUNDING = 1e-2


@dataclass(frozen=True)
class LearntConfig(Section):
    """What a tracker has learnt of one sensor, to begin with in the next recording.

    `calibrate` writes it; `Tracker.learnt` has it at any time. None of it is fixed: the tracker goes on
    learning, and the seconds say how much of it the next ones outweigh.
    """

    worth: tuple[float, float] = number(
        (0.0, 1.0),
        "1",
        "log odds that what has such scores lasts, with the log odds of the scores: at 0, and slope",
        low=-LARGEST,
    )
    worth_cov: tuple[float, float, float] = number(
        (1.0, 0.0, 1.0), "1", "variance of the one, covariance, variance of the other", low=-LARGEST
    )
    lasting_odds: float = number(1.5, "1", "mean log odds of the scores of what lasts", low=-LARGEST)
    lasting_s: float = number(0.0, "s", "seconds of a track on which that rests")
    vain: float = number(
        0.02, "1", "share of its detections that came again and still came to nothing", 0.0, 1.0
    )
    vain_s: float = number(0.0, "s", "seconds of a track on which that rests")
    agreed_s: float = number(0.0, "s", "its detections that other sensors bear out, in seconds of a track")
    lonely_s: float = number(0.0, "s", "those where another sensor looks and sees nothing")
    agreed_high_s: float = number(0.0, "s", "those of the former that move and score above `agreed_odds`")
    lonely_high_s: float = number(0.0, "s", "those of the latter")
    agreed_odds: float = number(0.0, "1", "mean log odds of the scores of the former", low=-LARGEST)
    score_spread: float = number(
        0.0, "s", "sum over both of the squared deviation of a track's mean log odds from that mean"
    )
    score_square: float = number(0.0, "s", "sum of the squares of the log odds' own deviations")
    score_kept: float = number(0.0, "s", "sum of the products of both", low=-LARGEST)
    agreed_without: tuple[tuple[str, float], ...] = field(
        default=(),
        metadata={"doc": "those on tracks that a sensor besides it and this one has seen: (name, seconds)"},
    )
    borne_out: float = number(
        1.0, "1", "factor on its evidence by how far others bear it out", 0.0, 1.0, open_low=True
    )
    trust: float = number(1.0, "1", "factor on its evidence by all of that", 0.0, 1.0, open_low=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        a, ab, b = self.worth_cov
        if not (a > 0.0 and b > 0.0 and ab * ab <= (1.0 + _ROUNDING) * a * b):
            raise ConfigError(f"worth_cov: {list(self.worth_cov)} is no covariance")
        if self.worth[1] < 0.0:
            raise ConfigError(f"worth: the slope must not be negative, got {self.worth[1]}")
        for name, part, whole in (
            ("agreed_high_s", self.agreed_high_s, self.agreed_s),
            ("lonely_high_s", self.lonely_high_s, self.lonely_s),
        ):
            if part > (1.0 + _ROUNDING) * whole:
                raise ConfigError(f"{name}: {part} is more than all of them, {whole}")
        for name, seconds in self.agreed_without:
            if not 0.0 <= seconds <= LARGEST:
                raise ConfigError(f"agreed_without: {seconds} s of {name!r} is not in [0, {LARGEST:g}]")

    def counting_for(self, share: float, worth_std: float) -> LearntConfig:
        """Return the same, resting on a share of what it rests on: elsewhere it may not be so.

        Args:
            share: in [0, 1].
            worth_std: what is known of both numbers of `worth` before anything was seen.
        """
        a, ab, b = self.worth_cov
        known = np.linalg.inv(np.array([[a, ab], [ab, b]]))
        first = np.eye(2) / (worth_std * worth_std)
        cov = np.linalg.inv(share * known + (1.0 - share) * first)
        seconds = {name: share * getattr(self, name) for name in _SECONDS}
        return replace(
            self,
            **seconds,
            worth_cov=(float(cov[0, 0]), float(cov[0, 1]), float(cov[1, 1])),
            agreed_without=tuple((name, share * s) for name, s in self.agreed_without),
        )


# What grows with the time that it rests on.
_SECONDS = (
    "lasting_s",
    "vain_s",
    "agreed_s",
    "lonely_s",
    "agreed_high_s",
    "lonely_high_s",
    "score_spread",
    "score_square",
    "score_kept",
)
