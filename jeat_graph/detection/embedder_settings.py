"""How a network that describes crops is fed, where its file does not say it."""

from __future__ import annotations

from dataclasses import dataclass

from jeat_graph.config.fields import Section, choice, number
from jeat_graph.data.errors import ConfigError

_COLOURS = 3
_LARGEST_SIDE = 4096


@dataclass(frozen=True)
class EmbedderSettings(Section):
    """A network from an ONNX file that makes a vector of a crop."""

    backend: str = choice(
        "auto", ("auto", "opencv", "onnxruntime"), "what runs it; auto: onnxruntime if installed, else OpenCV"
    )
    threads: int = number(0, "1", "threads that run it; 0: as many as the backend takes", 0, 1024)
    color: str = choice(
        "auto",
        ("auto", "bgr", "rgb"),
        "order of the colours; auto: as the note `color` of its file, else rgb",
    )
    width: int = number(
        0, "px", "of its input, where its file leaves it open; 0: as the note `imgsz` says", 0, _LARGEST_SIDE
    )
    height: int = number(
        0, "px", "of its input, where its file leaves it open; 0: as the note `imgsz` says", 0, _LARGEST_SIDE
    )
    mean: tuple[float, ...] = number(
        (), "grey levels", "taken off each colour; empty: as the note `mean` says, else ImageNet's", -1e4
    )
    std: tuple[float, ...] = number(
        (), "grey levels", "then divided by; empty: as the note `std` says, else ImageNet's", open_low=True
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, values in (("mean", self.mean), ("std", self.std)):
            if len(values) not in (0, _COLOURS):
                raise ConfigError(f"{name}: must be {_COLOURS} numbers, one a colour, or none")
        if bool(self.width) != bool(self.height):
            raise ConfigError("width and height: give both, or neither")
