"""Settings of live use: how late scans may come, and when a sensor counts as silent."""

from __future__ import annotations

from dataclasses import dataclass

from jeat_graph.config.fields import Section, number


@dataclass(frozen=True)
class LiveConfig(Section):
    """What a caller needs whose scans come from running sensors; files are read in order of time."""

    late_s: float = number(
        0.3, "s", "a scan may come so late and still be put where it belongs; sensors may have their own"
    )
    wait_s: float = number(
        15.0,
        "s",
        "answers wait up to so long for a sensor whose clock was found while running, and whose scans come "
        "too late to go back for; 0 passes such scans over",
    )
    jump_s: float = number(
        5.0,
        "s",
        "a scan whose time is so far from the newest, and four times as far as usual pauses, is held until "
        "others confirm it; times that all scans are behind for so long are given up",
    )
    silent_s: float = number(
        1.0, "s", "a sensor that declares a rate and gives no scan for so long counts as silent"
    )
    silent_periods: float = number(5.0, "1", "and for so many of its periods", low=1.0)
