"""Who decides who is who in the smoothed table of a whole recording, where its settings leave it open."""

from __future__ import annotations

import warnings
from dataclasses import replace

from jeat_graph.config.schema import Config
from jeat_graph.data.errors import InputWarning

#: A recording of more detections keeps causal identities: 300 to 400 bytes of each would be in memory.
MOST_DETECTIONS = 5_000_000


def with_identities(config: Config, detections: int) -> tuple[Config, str]:
    """Return the configuration that tracks a recording from beginning to end, with `auto` resolved.

    With `smoother.identities=auto` the whole recording decides, unless something of it does not go with that.

    Args:
        config: as it was asked for.
        detections: how many the recording has.

    Returns:
        The configuration, and why `auto` has kept causal identities; empty where it has not.
    """
    smoother = config.smoother
    if smoother.identities != "auto" or smoother.engine == "none":
        return config, ""
    why = ""
    if config.tracker.engine == "paper":
        why = "tracker.engine=paper follows no identities"
    elif smoother.road == "fixed-lag":
        why = "smoother.road=fixed-lag writes what a stream would"
    elif detections > MOST_DETECTIONS:
        why = f"of more than {MOST_DETECTIONS} detections whole ones would take too much memory"
        line = f"smoothed identities are causal: {why} (smoother.identities=whole decides all the same)"
        warnings.warn(line, InputWarning, stacklevel=2)
    return replace(config, smoother=replace(smoother, identities="causal" if why else "whole")), why
