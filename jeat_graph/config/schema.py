"""The whole configuration of a tracker: every setting with unit, bounds and meaning.

A configuration is a tree of frozen dataclasses, one a section; a setting is declared once, in the class
of its section. `config.reading` reads the tree from YAML. Constants of the model that no user changes stand
in `filters.model_constants`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from jeat_graph.config.image import ImageConfig
from jeat_graph.config.live import LiveConfig
from jeat_graph.config.output import OutputConfig
from jeat_graph.config.paper import PaperConfig
from jeat_graph.config.sensors import InputConfig, SensorConfig
from jeat_graph.config.smoothing import SmootherConfig
from jeat_graph.config.tracker import TrackerConfig
from jeat_graph.data.errors import ConfigError

__all__ = [
    "Config",
    "ImageConfig",
    "InputConfig",
    "LiveConfig",
    "OutputConfig",
    "PaperConfig",
    "SensorConfig",
    "SmootherConfig",
    "TrackerConfig",
]
#: Names of the presets, for types.
Preset = Literal["default", "paper"]
#: Most sensors: which of them saw a track is kept in the bits of a signed 64-bit number.
MOST_SENSORS = 63


@dataclass(frozen=True)
class Config:
    """All settings of a tracker. Frozen: make another with `dataclasses.replace` or `load_config`."""

    sensors: dict[str, SensorConfig] = field(default_factory=dict)
    image: ImageConfig = field(default_factory=ImageConfig)
    input: InputConfig = field(default_factory=InputConfig)
    output: OutputConfig = field(default_factory=OutputConfig)
    tracker: TrackerConfig = field(default_factory=TrackerConfig)
    smoother: SmootherConfig = field(default_factory=SmootherConfig)
    live: LiveConfig = field(default_factory=LiveConfig)
    paper: PaperConfig = field(default_factory=PaperConfig)

    def __post_init__(self) -> None:
        if self.tracker.engine == "paper" and self.smoother.identities in ("lag", "whole"):
            given = repr(self.smoother.identities)
            raise ConfigError(f"smoother.identities: {given} needs another engine than tracker.engine=paper")
        if not self.sensors and self.input.undeclared != "declare":
            raise ConfigError("sensors: at least one sensor must be declared")
        if len(self.sensors) > MOST_SENSORS:
            raise ConfigError(f"sensors: at most {MOST_SENSORS}, not {len(self.sensors)}")
        for name in self.sensors:
            if not name or any(c in name for c in '|,"') or name != name.strip() or not name.isprintable():
                raise ConfigError(
                    f"sensors: {name!r} cannot be a name (empty, or holds | , quote or what has no sign)"
                )

    @property
    def pair_within_s(self) -> float:
        """How far apart scans of different sensors may be to be taken jointly (s): 0 but for `paper`."""
        return self.paper.pair_within_s if self.tracker.engine == "paper" else 0.0

    @property
    def sensor_names(self) -> tuple[str, ...]:
        """Names of the declared sensors, in alphabetical order."""
        return tuple(sorted(self.sensors))
