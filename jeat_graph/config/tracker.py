"""Settings of the tracker as a whole."""

from __future__ import annotations

from dataclasses import dataclass

from jeat_graph.config.fields import Section, choice

ENGINES = ("compiled", "core", "reference", "paper")


@dataclass(frozen=True)
class TrackerConfig(Section):
    """What computes the tracks."""

    engine: str = choice(
        "compiled",
        ENGINES,
        "core: one model of what a sensor says, in C++, to replace `compiled`; of the other settings "
        "it takes the picture's size and the smoother's engine and lag alone; reference: the same in NumPy, "
        "to be read; paper: the paper's method to the letter, with the settings of `paper`",
    )
