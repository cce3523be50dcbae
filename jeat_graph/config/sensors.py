"""Settings of one sensor, and of sensors that nobody declared."""

from __future__ import annotations

from dataclasses import dataclass, field

from jeat_graph.config.fields import LARGEST, Section, choice, number
from jeat_graph.data.errors import ConfigError

#: What a sensor may be: one that sees changes alone, one that sees what is there, something else.
KINDS = EVENT, CAMERA, OTHER = "event", "camera", "other"
# Numbers of a homography, and of one with parallax.
_MATRICES = (9, 12)
# Lenses that a map may have, and the strongest distortion of one.
_LENSES, _MOST_K1 = 2, 1.0


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
    """What is known of one sensor and its detector; the tracker learns the rest while it runs."""

    rate_hz: float = number(
        20.0,
        "Hz",
        "nominal rate of its scans, by which it counts as silent; tracking goes by their times alone",
        open_low=True,
    )
    even_score: float | None = number(
        None,
        "1",
        "score at which a box is as likely real as not; without it that is learnt while tracking",
        0.0,
        1.0,
        open_low=True,
    )
    kind: str | None = choice(
        None,
        KINDS,
        "what it is; an event camera sees nothing that stands, so its silence there says little",
    )
    score_weight: float | None = number(
        None,
        "1",
        "weight of its scores as evidence for or against an object; 0: none; without it 1, and less where "
        "its scores turn out to say nothing beside other sensors",
        0.0,
        10.0,
    )
    lasting_error: float | None = number(
        None,
        "1",
        "standard deviation of what its boxes are off as long as they show one object, as a share of its "
        "size; without it that is learnt from other sensors",
        0.0,
        1.0,
    )
    sigma_px: float = number(3.0, "px", "engine `paper`: standard deviation of a box's centre", open_low=True)
    sigma_log_size: float = number(
        0.1, "ln px", "engine `paper`: standard deviation of ln width and ln height", open_low=True
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
        metadata={
            "doc": "covariance of its numbers but the one that is 1, row by row: 64 or 121 numbers; with "
            "`lens` 169, the two of the lenses last"
        },
    )
    lens: tuple[float, ...] = field(
        default=(),
        metadata={
            "doc": "radial distortion k1 of its own lens and of the common picture's, each with the width of "
            "its picture as the focal length (see `register`); none: neither bends"
        },
    )
    clock: ClockConfig | None = field(
        default=None, metadata={"doc": "offset and drift of its clock against the common one"}
    )
    late_s: float | None = number(
        None, "s", "how late its scans may come in live use, if not as live.late_s says"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_picture()

    def _check_picture(self) -> None:
        if self.image is not None and not all(1.0 <= side <= LARGEST for side in self.image):
            raise ConfigError(f"image: {list(self.image)} must be a width and a height in px")
        count, free = len(self.to_picture), len(self.to_picture_cov)
        if count not in (0, *_MATRICES):
            raise ConfigError(f"to_picture: must have 9 or 12 numbers, or none, not {count}")
        if count and self.image is None:
            raise ConfigError("to_picture: needs `image`, the size of the sensor's own picture")
        if len(self.lens) not in (0, _LENSES) or not all(abs(k1) <= _MOST_K1 for k1 in self.lens):
            raise ConfigError(f"lens: must be two numbers from {-_MOST_K1:g} to {_MOST_K1:g}, or none")
        if self.lens and not count:
            raise ConfigError("lens: needs to_picture")
        wanted = (max(count - 1, 0) + len(self.lens)) ** 2
        if free and free != wanted:
            raise ConfigError(f"to_picture_cov: must have {wanted} numbers")


@dataclass(frozen=True)
class InputConfig(Section):
    """What is done with a recording that the configuration does not quite describe."""

    undeclared: str = choice(
        "declare",
        ("refuse", "declare"),
        "a sensor that is not declared is an error, or is declared by what is seen of it; then the rates of "
        "all sensors are those of the recording too",
    )
    clocks: str = choice(
        "find",
        ("as_given", "find"),
        "times are believed, or clocks that differ are found in a pass over the whole recording before it is "
        "tracked (`rig.agreement`), live while scans come (`live.clock_watch`), and brought together where "
        "the boxes leave no doubt",
    )
    picture: str = choice(
        "seen",
        ("given", "seen"),
        "the picture is as large as `image` says, or reaches as far as the boxes of the recording do; a size "
        "that is given beside the preset always counts",
    )
