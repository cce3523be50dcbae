"""How sure the tables may say they are of positions: measured against truth, used for what is written alone.

The filter that tracks best need not be the one whose variances are true. Its noise also says which box is
whose: where it was widened until the tables were true, recordings that a calibration was not made from lost
up to three points of MOTA. And what a vehicle's boxes are off by as long as it is seen (a detector that puts
a walker's box too low puts nearly all of them too low) no number of looks averages out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from jeat_graph.calibration.supervised import Recording
from jeat_graph.config.schema import Config, OutputConfig
from jeat_graph.data.arrays import FloatArray
from jeat_graph.eval.frames import Kind
from jeat_graph.eval.position_nees import PositionErrors, position_errors
from jeat_graph.runs.declaring import own_picture
from jeat_graph.tracking.whole import both_tables

_KINDS: tuple[Kind, ...] = ("causal", "smoothed")
# How far off the base's values may be: ln of the scale, and what lasts per height.
_SPREAD = np.array([1.0, 0.05])
_BOUNDS = ((np.log(0.05), np.log(50.0)), (0.0, 0.2))
_DIGITS = 4


def with_written_variances(config: Config, scale: float, lasting: float) -> Config:
    """The configuration with `output.position_scale` and `output.lasting_error`."""
    return replace(config, output=replace(config.output, position_scale=scale, lasting_error=lasting))


def measure_written_variances(config: Config, recordings: Sequence[Recording], base: OutputConfig) -> Config:
    """Track recordings and find the `output.position_scale` and `lasting_error` that make their tables true.

    Args:
        config: calibrated, but for these two.
        recordings: detections and truth.
        base: what is held of both beforehand.
    """
    plain = with_written_variances(config, 1.0, 0.0)
    tables = [both_tables(own_picture(plain, detections), detections) for detections, _ in recordings]
    errors = [
        position_errors([(truth, pair[k]) for (_, truth), pair in zip(recordings, tables, strict=True)], kind)
        for k, kind in enumerate(_KINDS)
    ]
    return with_written_variances(config, *likeliest(errors, base.position_scale, base.lasting_error))


def likeliest(tables: Sequence[PositionErrors], scale: float, lasting: float) -> tuple[float, float]:
    """Factor s and share b under which errors with the variances s P + (b height)² are likeliest.

    Errors of one object are nearly one error, so each object counts once, however many boxes it has: a few of
    them leave what was held beforehand nearly as it was.

    Args:
        tables: errors of each table, with the variances P.
        scale: s as it is held to be beforehand, to within a factor of e.
        lasting: b, to within .05.

    Returns:
        s and b.
    """
    before = np.array([np.log(scale), lasting])

    def cost(x: FloatArray) -> float:
        total = 0.5 * float(np.sum(((x - before) / _SPREAD) ** 2))
        for one in tables:
            if len(one.error):
                var = np.exp(x[0]) * one.var + (x[1] * one.height[:, None]) ** 2
                terms = np.log(var) + one.error**2 / var
                total += 0.5 * len(np.unique(one.object_id)) * float(terms.sum(axis=1).mean())
        return total

    low, high = np.array(_BOUNDS).T
    found = minimize(cost, np.clip(before, low, high), bounds=_BOUNDS, method="L-BFGS-B").x
    return round(float(np.exp(found[0])), _DIGITS), round(float(found[1]), _DIGITS)
