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
# Recordings of one kind of scene differ by so much in ln of the error squared over the variance.
_BETWEEN_RECORDINGS = 0.5
# What is held of objects before they are seen weighs as much as so many of them: each has one error (of two
# axes, which varies by 1 around 1), nearly the same in both tables.
_PRIOR_OBJECTS = 4.0
_ALIKE = 0.9
# How well errors are known depends on what is sought: first as held beforehand, then as found.
_ROUNDS = 2


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
    return with_written_variances(config, *truest(errors, base.position_scale, base.lasting_error))


def truest(tables: Sequence[PositionErrors], scale: float, lasting: float) -> tuple[float, float]:
    """Factor s and share b with which the variances s P + (b height)² of all tables are true.

    True means that the mean A of error² / variance is 1, in each table: ln A is the residual. The likeliest
    values would not do: errors have long tails and go with P, and a normal likelihood pays for that by one
    table that says too much and one that says too little. How well ln A is known follows from how much the
    objects differ, each of which is nearly one error however many boxes it has, and the recordings, which
    differ more than their objects tell. A few of either leave what was held beforehand nearly as it was.

    Args:
        tables: errors of each table on the same recordings, with the variances P.
        scale: s as it is held to be beforehand, to within a factor of e.
        lasting: b, to within .05.

    Returns:
        s and b.
    """
    before = np.array([np.log(scale), lasting])
    known = [one for one in tables if len(one.error)]
    if not known:
        return scale, lasting
    low, high = np.array(_BOUNDS).T
    found = np.clip(before, low, high)
    for _ in range(_ROUNDS):
        covariance = _covariance(known, [_squares(one, found) for one in known])
        weight: FloatArray = np.asarray(np.linalg.inv(covariance), dtype=np.float64)

        def cost(x: FloatArray, weight: FloatArray = weight) -> float:
            residual = np.log([_squares(one, x).mean() for one in known])
            return 0.5 * float(residual @ weight @ residual + np.sum(((x - before) / _SPREAD) ** 2))

        found = minimize(cost, found, bounds=_BOUNDS, method="L-BFGS-B").x
    return round(float(np.exp(found[0])), _DIGITS), round(float(found[1]), _DIGITS)


def _squares(one: PositionErrors, x: FloatArray) -> FloatArray:
    """Error² / variance (K,) of each box, mean of both axes, with ln s and b in `x` (2,)."""
    var = np.exp(x[0]) * one.var + (x[1] * one.height[:, None]) ** 2
    return np.asarray(np.mean(one.error**2 / var, axis=1))


def _covariance(tables: Sequence[PositionErrors], squares: Sequence[FloatArray]) -> FloatArray:
    """Covariance (T, T) of ln of the mean of each table's `squares`, by objects and by recordings.

    Args:
        tables: T tables.
        squares: (K,) of each table's boxes.
    """
    objects = np.unique(np.concatenate([one.object_id for one in tables]))
    recordings = np.unique(np.concatenate([one.recording for one in tables]))
    count = len(objects)
    influence, share = np.zeros((count, len(tables))), np.zeros((len(recordings), len(tables)))
    for k, (one, square) in enumerate(zip(tables, squares, strict=True)):
        off = count * (square / square.mean() - 1.0) / len(square)
        np.add.at(influence[:, k], np.searchsorted(objects, one.object_id), off)
        np.add.at(share[:, k], np.searchsorted(recordings, one.recording), 1.0 / len(square))
    alike = np.full((len(tables), len(tables)), _ALIKE)
    np.fill_diagonal(alike, 1.0)
    of_object = (influence.T @ influence + _PRIOR_OBJECTS * alike) / (count - 1.0 + _PRIOR_OBJECTS)
    return np.asarray(of_object / count + _BETWEEN_RECORDINGS**2 * alike * (share.T @ share))
