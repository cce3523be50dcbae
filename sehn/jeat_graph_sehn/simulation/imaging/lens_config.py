"""Settings of what lies between the ideal picture and the pixels: lens, mount, drops."""

from __future__ import annotations

from dataclasses import dataclass

from jeat_graph.config.fields import check, number


@dataclass(frozen=True)
class LensConfig:
    """Radial distortion (Brown's model, as OpenCV has it), sway of the mount, and drops on the lens; none."""

    k1: float = number(
        0.0, "1", "radial distortion with the square of the radius; negative: barrel", -1.0, 1.0
    )
    k2: float = number(0.0, "1", "radial distortion with its fourth power", -1.0, 1.0)
    sway_deg: float = number(
        0.0, "deg", "rms by which wind turns the camera about each of its upright and level axes", 0.0, 2.0
    )
    sway_hz: float = number(
        1.5, "Hz", "natural frequency of the mast or gantry; steel ones have 0.5 to 4 Hz", 0.05, 20.0
    )
    drops: int = number(0, "1", "drops on the lens", 0, 200)
    drop_radius: float = number(
        0.03, "1", "their mean radius, as a fraction of the picture's width", 0.001, 0.2
    )

    def __post_init__(self) -> None:
        check(self)
