"""Settings of the common picture."""

from __future__ import annotations

from dataclasses import dataclass

from jeat_graph.config.fields import Section, number


@dataclass(frozen=True)
class ImageConfig(Section):
    """The picture that the sensors' boxes refer to."""

    width: float = number(1280.0, "px", "width of the picture", open_low=True)
    height: float = number(720.0, "px", "height of the picture", open_low=True)
