"""What it costs a configuration, in tuning, that the covariances it makes are not true.

Scores do not see covariances: a tracker that believes its detectors too much may even score a little more.
Whoever uses the tables' variances would then be misled, so a mean squared error that is far from what the
table says is charged like lost accuracy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.eval.metrics import evaluate
from jeat_graph.eval.position_nees import position_nees
from jeat_graph.tracking.whole import both_tables

#: Mean squared errors between these multiples of the variance cost nothing.
HONEST = (0.7, 1.5)
# Points of (MOTA + IDF1 + HOTA) / 3 for each factor of e outside.
_PRICE = 5.0
#: Factors on the standard deviation of the centre's noise that are tried.
FACTORS = (0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4, 1.6)


def price(anees: float) -> float:
    """What variances that are wrong by this factor cost (per cent); nothing where nothing matched."""
    if not math.isfinite(anees) or anees <= 0.0:
        return 0.0
    low, high = HONEST
    return _PRICE * max(math.log(low / anees), math.log(anees / high), 0.0)


def with_noise(config: Config, factor: float) -> Config:
    """Scale the noise of the centre of all sensors."""
    names = ("sigma_px", "rho_x", "rho_y", "rho_size")
    sensors = {
        name: replace(s, **{f: factor * getattr(s, f) for f in names}) for name, s in config.sensors.items()
    }
    return replace(config, sensors=sensors)


def merit_of_both(config: Config, recordings: Sequence[tuple[Detections, GroundTruth]]) -> float:
    """(MOTA + IDF1 + HOTA) / 3 less what untrue variances cost, mean of the causal and the smoothed table."""
    tables = [both_tables(config, detections) for detections, _ in recordings]
    out = []
    for k, kind in enumerate(("causal", "smoothed")):
        pairs = [(truth, both[k]) for (_, truth), both in zip(recordings, tables, strict=True)]
        instants = [np.unique(d.scan_t) for d, _ in recordings] if kind == "causal" else None
        scores = evaluate(pairs, kind=kind, instants=instants)  # type: ignore[arg-type]
        anees = position_nees(pairs, kind).anees  # type: ignore[arg-type]
        out.append((scores.MOTA + scores.IDF1 + scores.HOTA) / 3.0 - price(anees))
    return float(np.mean(out))


def scale_noise(
    config: Config, recordings: Sequence[tuple[Detections, GroundTruth]]
) -> tuple[Config, float, float]:
    """Choose the factor on the noise of the centre with which both tables are best and honest.

    Args:
        config: calibrated.
        recordings: detections and truth, tracked with each candidate.

    Returns:
        The configuration, the factor and its merit.
    """
    # Of two as good the one nearer to what was measured.
    tried = sorted(FACTORS, key=lambda factor: abs(math.log(factor)))
    merits = [merit_of_both(with_noise(config, factor), recordings) for factor in tried]
    best = int(np.argmax(merits))
    return with_noise(config, tried[best]), tried[best], merits[best]
