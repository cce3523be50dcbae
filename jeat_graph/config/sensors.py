"""Settings of one sensor: how often it looks, how exact and how reliable its boxes are."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, fields

from jeat_graph.config.fields import LARGEST, Section, choice, number
from jeat_graph.config.learnt import LearntConfig
from jeat_graph.data.errors import ConfigError

#: A score never says that a box is more exact, or less, than this against what its sensor's usually are.
LEAST_FACTOR, MOST_FACTOR = 0.1, 10.0
# Numbers of a homography, and of one with parallax.
_MATRICES = (9, 12)
# What scores mean where nobody says so: the precision itself.
_ANY_SCORES = ((0.0, 0.02), (1.0, 0.98))


@dataclass(frozen=True)
class ClockConfig(Section):
    """How a sensor's times become those of the common clock: t − offset_s − drift · (t − at_s)."""

    offset_s: float = number(0.0, "s", "what its times are later than the common ones, at at_s", low=-LARGEST)
    drift_ppm: float = number(0.0, "1e-6", "by how much its clock is too fast", low=-1e5, high=1e5)
    at_s: float = number(0.0, "s", "its time at which the offset holds", low=-LARGEST)
    offset_std_s: float = number(0.0, "s", "standard deviation of the offset")
    drift_std_ppm: float = number(0.0, "1e-6", "standard deviation of the drift")


@dataclass(frozen=True)
class SensorConfig(Section):
    """What is known of one sensor and its detector. `calibrate` estimates all of it from data."""

    rate_hz: float = number(20.0, "Hz", "nominal rate of its scans", open_low=True)
    kind: str = choice(
        "any",
        ("any", "event"),
        "any: it may see whatever is in the picture; event: it sees changes alone, so that it does not speak "
        "against what stands still (engines core and reference)",
    )
    even_score: float | None = number(
        None,
        "1",
        "score at which its box is as likely of an object as not; none: it is learnt from which boxes come "
        "again (engines core and reference)",
        0.0,
        1.0,
        open_low=True,
    )
    sigma_px: float = number(2.0, "px", "noise of the box centre that does not depend on size", open_low=True)
    rho_x: float = number(0.03, "1", "noise of the box centre in x as a fraction of the width (method: rho)")
    rho_y: float = number(0.03, "1", "noise of the box centre in y as a fraction of the height (method: rho)")
    rho_size: float = number(
        0.0, "1", "noise of the box centre in both as a fraction of the box size sqrt(w h)"
    )
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
    bias_std: float = number(
        0.0,
        "ln px",
        "standard deviation of a systematic error of ln width and ln height beyond `bias`, which is learnt "
        "where other sensors see the same vehicles; 0: there is none",
    )
    p_detect: float = number(0.9, "1", "probability that a visible vehicle is detected", 0.01, 0.999)
    clutter_per_scan: float = number(0.3, "boxes", "mean number of false boxes a scan", open_low=True)
    precision: float = number(0.9, "1", "fraction of its boxes that are vehicles", 0.001, 0.999)
    score_precision: tuple[tuple[float, float], ...] = field(
        default=_ANY_SCORES,
        metadata={
            "doc": "calibrated precision of a box of this score: (score, precision) knots, both rising"
        },
    )
    score_fit: tuple[tuple[float, float], ...] = field(
        default=(),
        metadata={
            "doc": "probability that a track's box fits if its detection has this score and no other sensor "
            "sees it: (score, probability) knots, both rising; none: its scores say nothing of that"
        },
    )
    score_noise: tuple[tuple[float, float], ...] = field(
        default=(),
        metadata={
            "doc": "how exact a box of this score is: (score, factor on standard deviations of its noise) "
            "knots, scores rising, factors falling; none: its scores say nothing of that"
        },
    )
    tempering: float = number(
        0.4, "1", "exponent on evidence, below 1 where false boxes repeat in time", 0.01, 1.0
    )
    blind_speed: float = number(
        0.0, "px/s", "image speed below which the sensor sees nothing (events); 0: it sees what stands still"
    )
    disagreement: float | None = number(
        None, "1", "`lifecycle.disagreement` for this sensor, if another than for all", 0.0
    )
    least_overlap: float = number(
        0.0,
        "1",
        "least IoU of its box with that of a track which another sensor has seen; one that fits less is not "
        "taken for the track's",
        0.0,
        1.0,
    )
    latency_s: float = number(
        0.0,
        "s",
        "known constant delay of its times: so much is taken off the time of every scan; negative where they "
        "are early",
        low=-LARGEST,
    )
    image: tuple[float, float] | None = field(
        default=None,
        metadata={
            "doc": "width and height (px) of its own picture, where that is another than the common one, "
            "`image`; its boxes are in it, and go to the common one by `to_picture`"
        },
    )
    to_picture: tuple[float, ...] = field(
        default=(),
        metadata={
            "doc": "matrix, row by row, from its own picture to the common one: 9 numbers (a homography) or "
            "12 (with parallax, see `register`); none: by the pictures' sizes, which must be of one shape"
        },
    )
    to_picture_cov: tuple[float, ...] = field(
        default=(),
        metadata={"doc": "covariance of its numbers but the one that is 1, row by row: 64 or 121 numbers"},
    )
    clock: ClockConfig | None = field(
        default=None, metadata={"doc": "offset and drift of its clock against the common one"}
    )
    late_s: float | None = number(
        None, "s", "how late its scans may come in live use, if not as live.late_s says"
    )
    learnt: LearntConfig | None = field(
        default=None,
        metadata={"doc": "what was learnt of it in other recordings, to begin with"},
    )

    @property
    def knows_scores(self) -> bool:
        """Whether somebody said what its scores mean."""
        return self.score_precision != _ANY_SCORES

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.score_precision:
            raise ConfigError("score_precision: needs at least one knot")
        for name, what in (("score_precision", "precisions"), ("score_fit", "probabilities")):
            knots = getattr(self, name)
            inside = all(0 <= s <= 1 and 0 <= p <= 1 for s, p in knots)
            rising = all(b[0] > a[0] and b[1] >= a[1] for a, b in itertools.pairwise(knots))
            if not (inside and rising):
                raise ConfigError(f"{name}: scores must rise, {what} must not fall, all in [0, 1]")
        self._check_picture()
        factors = self.score_noise
        inside = all(0 <= s <= 1 and LEAST_FACTOR <= f <= MOST_FACTOR for s, f in factors)
        falling = all(b[0] > a[0] and b[1] <= a[1] for a, b in itertools.pairwise(factors))
        if not (inside and falling):
            raise ConfigError(
                "score_noise: scores must rise in [0, 1], factors must not rise, "
                f"from {MOST_FACTOR:g} to {LEAST_FACTOR:g}"
            )

    def _check_picture(self) -> None:
        if self.image is not None and not all(1.0 <= side <= LARGEST for side in self.image):
            raise ConfigError(f"image: {list(self.image)} must be a width and a height in px")
        count, free = len(self.to_picture), len(self.to_picture_cov)
        if count not in (0, *_MATRICES):
            raise ConfigError(f"to_picture: must have 9 or 12 numbers, or none, not {count}")
        if count and self.image is None:
            raise ConfigError("to_picture: needs `image`, the size of the sensor's own picture")
        if free and (not count or free != (count - 1) ** 2):
            raise ConfigError(f"to_picture_cov: must have {max(count - 1, 0)} rows and columns")


@dataclass(frozen=True)
class InputConfig(Section):
    """What is done with a recording that the configuration does not quite describe."""

    undeclared: str = choice(
        "refuse",
        ("refuse", "declare"),
        "a sensor that is not declared is an error, or is declared by what is seen of it; then the rates of "
        "all sensors are those of the recording too",
    )
    clocks: str = choice(
        "as_given",
        ("as_given", "find"),
        "times are believed, or clocks that differ are found in a pass over the whole recording before it is "
        "tracked (`rig.agreement`), and brought together where the boxes leave no doubt",
    )
    slow_scans: str = choice(
        "as_set",
        ("as_set", "bound"),
        "where scans come less than five times a second, motion and patience are as set, or bounded by what "
        "can be told apart from one scan to the next (`config.slow_scans`)",
    )
    sigma_px: float = number(2.0, "px", "of a sensor that is declared by what is seen of it", open_low=True)
    rho_x: float = number(0.03, "1", "of such a sensor")
    rho_y: float = number(0.03, "1", "of such a sensor")
    rho_size: float = number(0.0, "1", "of such a sensor")
    correlated_share: float = number(0.0, "1", "of such a sensor", 0.0, 0.99)
    memory_s: float = number(0.2, "s", "of such a sensor", 1e-3, 1e4)
    disagreement: float | None = number(None, "1", "of such a sensor", 0.0)
    bias_std: float = number(0.0, "ln px", "of such a sensor")
    picture: str = choice(
        "given",
        ("given", "seen"),
        "the picture is as large as `image` says, or reaches as far as the boxes of the recording do; a size "
        "that is given beside the preset always counts",
    )

    def of_any_sensor(self) -> dict[str, float]:
        """Return what is assumed of a sensor of which nothing is known, by the name of its key."""
        shared = {one.name for one in fields(self)} & {one.name for one in fields(SensorConfig)}
        said = {name: getattr(self, name) for name in sorted(shared)}
        return {name: value for name, value in said.items() if value is not None}

    def undeclared_sensor(self) -> SensorConfig:
        """Return a sensor of which nothing is known but that it is there."""
        return SensorConfig(**self.of_any_sensor())  # type: ignore[arg-type]
