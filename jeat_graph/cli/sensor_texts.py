"""What the sensors of a run did to its tracks, in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from jeat_graph.config.schema import Config
from jeat_graph.config.sensors import CAMERA, EVENT
from jeat_graph.tracking.hypotheses import SensorEffect

# Boxes that are off by less are not mentioned (sizes).
_LEAST = 0.02
# Nor changes of log odds that are smaller, nor boxes that count for nearly as much as the most exact ones.
_LEAST_CHANGE, _NEARLY = 0.05, 0.95
# Nor scores that have a meaning with this probability.
_MEANS = 0.9
_KINDS = {EVENT: "an event camera", CAMERA: "a camera"}


def sensor_texts(config: Config, learnt: Mapping[str, Any]) -> list[str]:
    """Return a line for each sensor of which something is given, or whose boxes are off.

    Args:
        config: of the run.
        learnt: what its `run.json` says of each sensor; what is no number there is left out.
    """
    lines = []
    for name, sensor in sorted(config.sensors.items()):
        found = learnt.get(name)
        error = found.get("lasting_error") if isinstance(found, Mapping) else None
        weight = found.get("score_weight") if isinstance(found, Mapping) else None
        parts = []
        if sensor.kind is not None:
            blind = found.get("stationary_unseen") if isinstance(found, Mapping) else None
            parts.append(f"{_KINDS.get(sensor.kind, 'no camera')} (as given)")
            if isinstance(blind, float) and math.isfinite(blind):
                parts[-1] += f", {100.0 * blind:.0f} % of what stands it does not see"
        if isinstance(error, float) and math.isfinite(error) and error >= _LEAST:
            source = "learnt from the other sensors" if sensor.lasting_error is None else "as given"
            parts.append(
                f"its boxes are off by {100.0 * error:.0f} % of an object for as long as they show it "
                f"({source}), so they move tracks less"
            )
        if sensor.score_weight is not None:
            if sensor.score_weight != 1.0:
                parts.append(f"its scores count {sensor.score_weight:g} times (as given)")
        elif isinstance(weight, float) and weight < _MEANS:
            parts.append(
                f"its scores count {weight:.2g} times: they do not correlate from scan to scan, so they are "
                "no property of what its boxes show"
            )
        if parts:
            lines.append(f"sensor {name}: {'; '.join(parts)}")
    return lines


def effect_texts(effects: Sequence[SensorEffect]) -> list[str]:
    """Return a line for each sensor that counted for a track as it did because of what is known of it."""
    lines = []
    for one in effects:
        parts = []
        if one.exactness < _NEARLY:
            parts.append(f"a box of it counts {one.exactness:.2f} of one of {one.most_exact}")
        if abs(one.stood) >= _LEAST_CHANGE:
            parts.append(f"that it may not see what stands changed the log odds by {one.stood:+.1f}")
        if abs(one.scores) >= _LEAST_CHANGE:
            parts.append(f"the weight of its scores, by {one.scores:+.1f}")
        if parts:
            lines.append(f"by what is known of {one.sensor}: {'; '.join(parts)}")
    return lines
