"""What the sensors of a run did to its tracks, in words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from jeat_graph.config.schema import Config

# Boxes that are off by less are not mentioned (sizes).
_LEAST = 0.02


def sensor_texts(config: Config, learnt: Mapping[str, Any]) -> list[str]:
    """Return a line for each of several sensors whose boxes are off, or whose scores have another weight.

    Args:
        config: of the run.
        learnt: what its `run.json` says of each sensor; what is no number there is left out.
    """
    lines = []
    for name, sensor in sorted(config.sensors.items()):
        found = learnt.get(name)
        error = found.get("lasting_error") if isinstance(found, Mapping) else None
        parts = []
        if isinstance(error, float) and math.isfinite(error) and error >= _LEAST:
            source = "learnt from the other sensors" if sensor.lasting_error is None else "as given"
            parts.append(
                f"its boxes are off by {100.0 * error:.0f} % of an object for as long as they show it "
                f"({source}), so they move tracks less"
            )
        if sensor.score_weight != 1.0:
            parts.append(f"its scores count {sensor.score_weight:g} times (as given)")
        if parts:
            lines.append(f"sensor {name}: {'; '.join(parts)}")
    return lines
