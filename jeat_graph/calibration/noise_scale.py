"""One factor on the noise of all sensors' centres, with which the variances of the tables come true."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from jeat_graph.calibration.supervised import Recording
from jeat_graph.calibration.verdict import CHANCE, Verdict, better, judge
from jeat_graph.config.schema import Config

#: Factors on the standard deviation of the centre's noise that are tried.
FACTORS = (0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4, 1.6)


def with_noise(config: Config, factor: float) -> Config:
    """Scale the noise of the centre of all sensors."""
    names = ("sigma_px", "rho_x", "rho_y", "rho_size")
    sensors = {
        name: replace(s, **{f: factor * getattr(s, f) for f in names}) for name, s in config.sensors.items()
    }
    return replace(config, sensors=sensors)


def scale_noise(config: Config, folds: Sequence[Sequence[Recording]]) -> tuple[Config, float, Verdict]:
    """Choose the factor on the noise of the centre with which both tables are best and consistent.

    It stays at 1 unless another does better by more than chance (`verdict.better`); of those the one with the
    greatest objective is taken: accuracy less the penalty for variances that are not true.

    Args:
        config: calibrated.
        folds: detections and truth, tracked with each candidate.

    Returns:
        The configuration, the factor and how it does.
    """
    # Of two as good the one nearer to what was measured.
    tried = sorted(FACTORS, key=lambda factor: abs(math.log(factor)))
    verdicts = [judge([with_noise(config, factor)] * len(folds), folds) for factor in tried]
    surer = [k for k, one in enumerate(verdicts) if better(one, verdicts[0], CHANCE, 2.0)]
    best = max([0, *surer], key=lambda k: (verdicts[k].objective, -k))
    return with_noise(config, tried[best]), tried[best], verdicts[best]
