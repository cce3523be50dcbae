"""The whole configuration of a tracker: every constant of the method, with unit, bounds and source.

A configuration is a tree of frozen dataclasses, one a section; a setting is declared once, in the class
of its section. `config.reading` reads the tree from YAML, `config.kernel_form` gives it to compiled code.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from jeat_graph.config.filtering import (
    BoxesConfig,
    ImageConfig,
    MotionConfig,
    NoiseConfig,
    SizeConfig,
    StandingConfig,
)
from jeat_graph.config.lifecycle import (
    AssociationConfig,
    BirthConfig,
    LifecycleConfig,
    MergeConfig,
)
from jeat_graph.config.live import LiveConfig
from jeat_graph.config.output import OutputConfig
from jeat_graph.config.paper import PaperConfig
from jeat_graph.config.sensors import InputConfig, SensorConfig
from jeat_graph.config.smoothing import SmootherConfig
from jeat_graph.config.tracker import TrackerConfig
from jeat_graph.data.errors import ConfigError

__all__ = [
    "AssociationConfig",
    "BirthConfig",
    "BoxesConfig",
    "Config",
    "ImageConfig",
    "InputConfig",
    "LifecycleConfig",
    "LiveConfig",
    "MergeConfig",
    "MotionConfig",
    "NoiseConfig",
    "OutputConfig",
    "PaperConfig",
    "SensorConfig",
    "SizeConfig",
    "SmootherConfig",
    "StandingConfig",
]


@dataclass(frozen=True)
class Config:
    """All settings of a tracker. Frozen: make another with `dataclasses.replace` or `override`."""

    sensors: dict[str, SensorConfig]
    image: ImageConfig = field(default_factory=ImageConfig)
    input: InputConfig = field(default_factory=InputConfig, metadata={"kernels": False})
    motion: MotionConfig = field(default_factory=MotionConfig)
    standing: StandingConfig = field(default_factory=StandingConfig)
    size: SizeConfig = field(default_factory=SizeConfig)
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    boxes: BoxesConfig = field(default_factory=BoxesConfig)
    association: AssociationConfig = field(default_factory=AssociationConfig)
    lifecycle: LifecycleConfig = field(default_factory=LifecycleConfig)
    birth: BirthConfig = field(default_factory=BirthConfig)
    merge: MergeConfig = field(default_factory=MergeConfig)
    output: OutputConfig = field(default_factory=OutputConfig)
    tracker: TrackerConfig = field(default_factory=TrackerConfig, metadata={"kernels": False})
    paper: PaperConfig = field(default_factory=PaperConfig, metadata={"kernels": False})
    smoother: SmootherConfig = field(default_factory=SmootherConfig, metadata={"kernels": False})
    live: LiveConfig = field(default_factory=LiveConfig, metadata={"kernels": False})

    def __post_init__(self) -> None:
        if not self.sensors:
            raise ConfigError("sensors: at least one sensor must be declared")
        if len(self.sensors) > 63:
            raise ConfigError(f"sensors: at most 63, not {len(self.sensors)}")
        for name in self.sensors:
            if not name or any(c in name for c in '|,"') or name != name.strip() or not name.isprintable():
                raise ConfigError(
                    f"sensors: {name!r} cannot be a name (empty, or holds | , quote or what has no sign)"
                )
        unknown = [name for name in self.association.priority if name not in self.sensors]
        if unknown:
            raise ConfigError(f"association.priority: {unknown[0]!r} is not a declared sensor")

    @property
    def sensor_names(self) -> tuple[str, ...]:
        """Names of the declared sensors, in alphabetical order: the order of all per-sensor arrays."""
        return tuple(sorted(self.sensors))

    @property
    def log_clutter_volume(self) -> float:
        """Logarithm of the space over which false boxes spread: picture (px²) and sizes ((ln px)²)."""
        area = self.image.width * self.image.height
        return float(np.log(area * self.association.log_size_range**2))
