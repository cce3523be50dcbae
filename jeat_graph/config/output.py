"""Settings of the tables: which tracks and which parts of their boxes they report."""

from __future__ import annotations

from dataclasses import dataclass

from jeat_graph.config.fields import Section, flag, number


@dataclass(frozen=True)
class OutputConfig(Section):
    """What the tables report."""

    min_existence: float = number(
        0.5,
        "1",
        "rows are written where the probability that the object exists is at least this; tracks that are "
        "less likely real than not are never written but by the engine `paper`",
        0.0,
        1.0,
    )
    clip: bool = flag(True, "let boxes end at the edge of the picture where the detectors' boxes do")
