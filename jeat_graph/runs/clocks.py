"""Do the sensors of a recording have one clock, and do all its times belong together?"""

from __future__ import annotations

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.time_text import exact_text

# Sensors that take turns leave a gap of about the length of what they show; where it is so many times as
# long, and longer than changing over takes (s), their clocks are two.
_GAP_FACTOR, _LEAST_GAP_S = 10.0, 60.0
# A gap of so many hours (s) that makes up so much of a recording comes from a wrong time, not from a pause.
_WRONG_GAP_S, _WRONG_SHARE = 6 * 3600.0, 0.9


def check_clocks(detections: Detections, config: Config, names: str) -> list[str]:
    """Check that sensors look at one time, once what is known of their delays is taken off.

    Args:
        detections: the recording, its times as its files have them.
        config: the sensors' `latency_s`.
        names: what the user calls the recording.

    Returns:
        A line for each sensor that begins after all before it have ended.

    Raises:
        DataError: a gap between two sensors that no change over from one to the other explains.
    """
    late = {name: sensor.latency_s for name, sensor in config.sensors.items()}
    spans = []
    for name in detections.sensors:
        times = detections.sensor_times(name) - late.get(name, 0.0)
        if len(times):
            spans.append((float(times.min()), float(times.max()), name))
    spans.sort()
    warnings = []
    for k in range(1, len(spans)):
        before, after = max(spans[:k], key=lambda span: span[1]), spans[k]
        gap = after[0] - before[1]
        if gap <= 0.0:
            continue
        shown = (before[1] - before[0]) + (after[1] - after[0])
        seen = (
            f"{names}: sensor {after[2]!r} scans from {exact_text(after[0])} to {exact_text(after[1])} s, "
            f"{before[2]!r} from {exact_text(before[0])} to {exact_text(before[1])} s"
        )
        if gap > max(_GAP_FACTOR * shown, _LEAST_GAP_S):
            later = late.get(after[2], 0.0) + after[0] - before[0]
            raise DataError(
                f"{seen}: they have different clocks; take the difference off, if both began together "
                f"--set sensors.{after[2]}.latency_s={exact_text(later)}, or leave one of them out"
            )
        warnings.append(f"{seen}: they never look at one time; have they one clock?")
    return warnings


def wrong_times(detections: Detections, names: str) -> list[str]:
    """Say where one gap of many hours is nearly all of a recording: a time beyond it is most likely wrong.

    Args:
        detections: the recording.
        names: what the user calls it.
    """
    clocks = {name: detections.sensor_times(name) for name in detections.sensors}
    times = np.unique(np.concatenate(list(clocks.values()))) if clocks else np.zeros(0)
    if len(times) < 2:
        return []
    steps = np.diff(times)
    k = int(steps.argmax())
    if not steps[k] > max(_WRONG_GAP_S, _WRONG_SHARE * (times[-1] - times[0])):
        return []
    start, end = times[k], times[k + 1]
    # The fewer ones are the wrong ones.
    few = times[: k + 1] if k + 1 < len(times) - k - 1 else times[k + 1 :]
    whose = ", ".join(repr(name) for name, clock in clocks.items() if np.isin(few, clock).any())
    return [
        f"{names}: nothing for {steps[k] / 3600.0:.6g} h, from t = {exact_text(start)} to "
        f"{exact_text(end)} s, which is nearly all of the recording: is a time of sensor {whose} "
        f"wrong (t = {exact_text(few[0])}" + (f" to {exact_text(few[-1])}" if len(few) > 1 else "") + " s)?"
    ]
