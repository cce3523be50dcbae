"""Settings of detectors, from YAML: `frames`, `events`, of networks `model_frames` and others, `camera`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from jeat_graph.config.fields import Section, flag, number
from jeat_graph.config.section_tree import build, merge, read_tree, tree_of_changes
from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.background import BackgroundSettings
from jeat_graph.detection.camera_flow import CameraSettings
from jeat_graph.detection.embedder_settings import EmbedderSettings
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.noise import NoiseSettings

_SAME = 1e-6
_LINK = (
    "pixels across a smaller gap belong together, as a share of the picture's diagonal, at least 2 px: 9 px "
    "at 640 x 384, 18 px at 1280 x 720"
)
_LINK_EVENTS = (
    "pixels across a gap of less than this, divided by the mean number of events in a pixel that has any, "
    "belong together: where events are few, holes in a vehicle are wide; at least 2 px, at most near_share"
)
_NEAR = (
    "pieces lie where one was a moment ago if they are no farther out, as a share of the diagonal: 5 px at "
    "346 x 260, 9 px at 640 x 384, 18 px at 1280 x 720"
)
_TRIM = (
    "columns and rows at the ends of a group with fewer pixels than this share of its fullest one are not of "
    "its box"
)
_INSIDE = "a group is part of a heavier one if this share of its box lies in the other's"
#: Scans of events per second where nothing is declared, and of networks beside pictures. More scans of a
#: network, whose windows overlap, repeat its false boxes: beside pictures 20 Hz are better tracked than 50
#: Hz, and cost two fifths (`docs/benchmarks/raw.md`).
USUAL_RATE_HZ, BESIDE_RATE_HZ = 50.0, 20.0
_RATE = (
    f"scans per second; a step is a whole number of bins; null: {USUAL_RATE_HZ:g}, and {BESIDE_RATE_HZ:g} of "
    "networks beside pictures, and of networks of both"
)
#: Bins that a window may have: one of two seconds takes 200 MB at 640 x 384 px.
_MOST_BINS = 400
#: Steps that are named where a rate has none that is a whole number of bins.
_USUAL_BINS = (20, 10, 8, 5, 4, 2, 1)
_APART = "two groups that run together stay two if they were there, and moved apart, for so long"
_PIECES = (
    "a group that falls into pieces, as a dark body does that is seen at its ends only, is one for so long"
)


@dataclass(frozen=True)
class EventSettings(Section):
    """How moving things are found in events."""

    rate_hz: float | None = number(None, "Hz", _RATE, 1.0, 1000.0)
    window_s: float = number(0.04, "s", "events of so long are linked", open_low=True)
    extent_s: float = number(0.02, "s", "a box reaches as far as the newest events of so long", open_low=True)
    bin_s: float = number(0.005, "s", "length of a bin; the other times are whole multiples of it", 1e-4, 1.0)
    link_events: float = number(10.0, "px", _LINK_EVENTS, 0.1)
    near_share: float = number(0.012, "1", _NEAR, 0.0, 0.2)
    least_events: int = number(12, "1", "a cloud of fewer events in the window is none", 1)
    least_side_px: float = number(3.0, "px", "a cloud that is narrower or lower is none", 1.0)
    trim_share: float = number(0.2, "1", _TRIM, 0.0, 0.9)
    inside_share: float = number(0.6, "1", _INSIDE, 0.0, 1.0)
    apart_s: float = number(0.1, "s", _APART)
    pieces_s: float = number(0.5, "s", _PIECES)
    certain_events: float = number(40.0, "1", "at so many events a score reaches 1 - 1/e", open_low=True)
    longest_gap_s: float = number(
        10.0, "s", "where the time of a file leaps ahead by more, no scans are made for the gap", 0.1
    )
    lamps: bool = flag(
        True, "whether pixels of lamps that flicker with the mains, 100 or 120 times a second, are left out"
    )
    background: BackgroundSettings = field(default_factory=BackgroundSettings)
    # What stands out of the background is no event that stands alone.
    noise: NoiseSettings = field(default_factory=lambda: NoiseSettings(alone=False))

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check("window_s", self.window_s, self.window_s)
        if self.bins(self.window_s) > _MOST_BINS:
            raise ConfigError(
                f"window_s: {self.window_s:g} s are more than {_MOST_BINS} bins of {self.bin_s:g} s: each "
                "takes two bytes a pixel"
            )
        if self.rate_hz is not None:
            self.rate(self.rate_hz)
        if not self._whole(self.extent_s) or self.extent_s > self.window_s:
            raise ConfigError(
                f"extent_s: {self.extent_s:g} s must be a whole number of bins, and no longer than window_s"
            )

    def rate(self, usual_hz: float) -> float:
        """Return the scans per second (Hz): `rate_hz`, or what is usual.

        Raises:
            ConfigError: a step is no whole number of bins.
        """
        hz = usual_hz if self.rate_hz is None else self.rate_hz
        self._check("rate_hz", hz, 1.0 / hz)
        return hz

    def _check(self, name: str, value: float, length_s: float) -> None:
        if not self._whole(length_s):
            whole = ", ".join(f"{1.0 / (bins * self.bin_s):g}" for bins in _USUAL_BINS)
            rates = f"; rates that do: {whole} Hz" if name == "rate_hz" else ""
            raise ConfigError(
                f"{name}: {value:g} gives {length_s:g} s, no whole number of bins of {self.bin_s:g} s{rates}"
            )

    def _whole(self, length_s: float) -> bool:
        bins = length_s / self.bin_s
        return round(bins) >= 1 and abs(bins - round(bins)) < _SAME

    def bins(self, length_s: float) -> int:
        """Return how many bins a time has (s)."""
        return round(length_s / self.bin_s)


@dataclass(frozen=True)
class PictureSettings(Section):
    """How moving things are found in pictures."""

    warm_up_s: float = number(
        4.0,
        "s",
        "the background is first the median of pictures of so long; no scans before a camera has shown it",
    )
    samples: int = number(25, "1", "pictures that the first background is made of", 3, 255)
    adapt_s: float = number(
        0.4,
        "s",
        "the background follows by one grey level in this time: slow light yes, vehicles that wait no",
        open_low=True,
    )
    sigmas: float = number(
        6.0, "σ", "a pixel is foreground if it differs by so much of its own noise", open_low=True
    )
    least_contrast: float = number(12.0, "grey levels", "and by at least this, of 255", 0.0, 255.0)
    link_share: float = number(0.012, "1", _LINK, 0.0, 0.2)
    near_share: float = number(0.012, "1", _NEAR, 0.0, 0.2)
    least_pixels: int = number(12, "px", "a group of fewer pixels is none", 1)
    least_side_px: float = number(4.0, "px", "a group that is narrower or lower is none", 1.0)
    most_share: float = number(
        0.4,
        "1",
        "where more of the picture differs, the light has changed or the camera moved: a new background",
        0.01,
        1.0,
    )
    trim_share: float = number(0.2, "1", _TRIM, 0.0, 0.9)
    inside_share: float = number(0.6, "1", _INSIDE, 0.0, 1.0)
    apart_s: float = number(0.2, "s", _APART)
    pieces_s: float = number(0.5, "s", _PIECES)
    certain_pixels: float = number(
        40.0, "px", "at so many pixels of foreground a score reaches 1 - 1/e", open_low=True
    )


@dataclass(frozen=True)
class DetectionSettings:
    """Settings of both detectors, and of the networks that may take their place."""

    frames: PictureSettings = field(default_factory=PictureSettings)
    events: EventSettings = field(default_factory=EventSettings)
    model_frames: ModelSettings = field(default_factory=ModelSettings)
    model_events: ModelSettings = field(default_factory=ModelSettings)
    model_fused: ModelSettings = field(default_factory=ModelSettings)
    camera: CameraSettings = field(default_factory=CameraSettings)
    embedder: EmbedderSettings = field(default_factory=EmbedderSettings)


def load_settings(path: str | Path | None = None, changes: Sequence[str] = ()) -> DetectionSettings:
    """Read the settings from a YAML file; what it does not name keeps its default.

    Args:
        path: the file, or None.
        changes: `section.key=value` texts over it.

    Raises:
        ConfigError: no such file, unknown key (with the nearest known one) or bad value.
    """
    tree = {} if path is None else read_tree(str(path), (), str, "detection file")
    try:
        out = build(DetectionSettings, merge(tree, tree_of_changes(changes)), "")
    except ConfigError as error:
        if path is None:
            raise
        more = ", and what was set over it" if changes else ""
        raise ConfigError(f"{path}{more}: {error}") from None
    assert isinstance(out, DetectionSettings)
    return out
