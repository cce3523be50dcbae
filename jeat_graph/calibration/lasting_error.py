"""What boxes are off by as long as a vehicle is seen: no look averages it out, so the tables have to say it.

A detector that puts the boxes of one walker too low puts nearly all of them too low. The filter's model of
errors with memory lets them go after a second, so of a track that is seen for long it becomes too sure. To
widen the sensors' noise instead would make the tables true as well, but that noise also says which box is
whose: of recordings that a calibration was not made from it cost up to three points of MOTA.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from jeat_graph.calibration.supervised import Recording
from jeat_graph.config.schema import Config
from jeat_graph.eval.frames import Kind
from jeat_graph.eval.position_nees import PositionErrors, position_errors
from jeat_graph.runs.declaring import own_picture
from jeat_graph.tracking.whole import both_tables

_KINDS: tuple[Kind, ...] = ("causal", "smoothed")
# As much as a setting may be: a box that is off by its own size is no box of that vehicle.
_MOST = 1.0
_DIGITS = 4


def with_lasting_error(config: Config, share: float) -> Config:
    """The configuration with `output.lasting_error` at this share of sqrt(width height)."""
    return replace(config, output=replace(config.output, lasting_error=share))


def measure_lasting_error(config: Config, recordings: Sequence[Recording]) -> float:
    """Track recordings and find the `output.lasting_error` with which their tables say what they are off by.

    Args:
        config: calibrated; the error it has already counts as none.
        recordings: detections and truth.
    """
    config = with_lasting_error(config, 0.0)
    tables = [both_tables(own_picture(config, detections), detections) for detections, _ in recordings]
    return lasting_share(
        [
            position_errors(
                [(truth, pair[k]) for (_, truth), pair in zip(recordings, tables, strict=True)], kind
            )
            for k, kind in enumerate(_KINDS)
        ]
    )


def lasting_share(tables: Sequence[PositionErrors]) -> float:
    """Share b with which e² / (var + b² width height) is 1 in the mean, the geometric one over tables.

    Args:
        tables: errors of each table, and what it says of them.

    Returns:
        b, at most 1; 0 where the variances are large enough as they are, or nothing matched.
    """
    found = [one for one in tables if len(one.error)]

    def excess(share: float) -> float:
        ratios = [np.mean(one.error**2 / (one.var + share**2 * one.area[:, None])) for one in found]
        return float(np.mean(np.log(np.maximum(ratios, np.finfo(float).tiny))))

    if not found or excess(0.0) <= 0.0:
        return 0.0
    if excess(_MOST) >= 0.0:
        return _MOST
    return round(float(brentq(excess, 0.0, _MOST)), _DIGITS)
