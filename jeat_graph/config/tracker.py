"""Settings of the tracker as a whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from jeat_graph.config.fields import Section, choice

#: What computes the tracks, for types.
Engine = Literal["core", "reference", "paper"]
ENGINES = ("core", "reference", "paper")


@dataclass(frozen=True)
class TrackerConfig(Section):
    """What computes the tracks."""

    engine: str = choice(
        "core",
        ENGINES,
        "core: the model of docs/method.md in C++; reference: the same in NumPy, to be read and stepped "
        "through; paper: the paper's filter to the letter, with the settings of the section `paper`",
    )
