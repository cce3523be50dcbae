"""Settings of the tables: which tracks they report, and how sure they say they are."""

from __future__ import annotations

from dataclasses import dataclass

from jeat_graph.config.fields import Section, flag, number


@dataclass(frozen=True)
class OutputConfig(Section):
    """Which tracks the causal table reports, and how sure the tables say they are of positions."""

    min_existence: float = number(0.5, "1", "reported only above this probability of existence", 0.0, 1.0)
    max_gap_s: float = number(
        0.12,
        "s",
        "reported only if updated within this time, but for `gap_memory` (paper: as long as it lives)",
    )
    max_gap_scans: float = number(
        0.0, "scans", "the same in scans of the slowest sensor, over P_D⁴; the less counts; 0: no bound"
    )
    scans_of_several: bool = flag(
        False,
        "scans count only while several sensors look; one alone is given `max_gap_s`: nobody fills its gaps",
    )
    gap_memory: float = number(
        0.0,
        "1",
        "what nobody sees is reported for longer where most of about so many such tracks were found again "
        "where they were expected; 0: never",
    )
    min_fit: float = number(
        0.5,
        "1",
        "reported only while boxes fit with this probability by the scores of its detections (`score_fit` of "
        "the sensors)",
        0.0,
        1.0,
    )
    fit_memory_s: float = number(
        0.5, "s", "the scores count for so long, in hindsight both ways", open_low=True
    )
    clip: bool = flag(True, "clip boxes to the picture; drop those outside it")
    min_visible: float = number(
        0.3, "1", "reported only if this fraction of the box lies in the picture", 0.0, 1.0
    )
    position_scale: float = number(
        1.0, "1", "factor on the variances of positions as they are written, and on nothing else", 1e-3, 1e3
    )
    lasting_error: float = number(
        0.0, "1", "std of what boxes are off by as long as they are seen, per height; written, too", 0.0, 1.0
    )
