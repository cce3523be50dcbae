"""How often the boxes of tracks fit, by the scores of the detections that they are made of.

A detection's precision is not it: a track is more than its last detection. One whose sensor is inexact
smooths its errors away; one that lives on what shows of a hidden vehicle does not get better by their number.
So each sensor tracks alone, and what is compared with the truth are the boxes of its tracks, those too for
which nothing was found: by the mean score of what each has taken of late, as the tracker has it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numba import njit

from jeat_graph.calibration.cuts import folds
from jeat_graph.calibration.matches import SensorMatches, match_sensor
from jeat_graph.calibration.parts import PartChoice
from jeat_graph.calibration.sensor import fit_precision
from jeat_graph.calibration.supervised import Recording
from jeat_graph.calibration.tracked import taken_in_scan
from jeat_graph.calibration.verdict import CHANCE, judge, scene_error
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import with_progress
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.filters.fit import MEAN, WEIGHT, fade, take
from jeat_graph.runs.declaring import own_picture
from jeat_graph.tracking.whole import track

#: Name of the choice.
SCORE_FIT = "rows by how their scores fit"
# Of fewer boxes of tracks nothing is said.
_LEAST = 200


def measure_score_fit(config: Config, recordings: Sequence[Recording]) -> Config:
    """Track with each sensor alone and find its `score_fit`.

    Args:
        config: calibrated, but for these; declares all sensors.
        recordings: detections and truth.
    """
    every = replace(config, output=replace(config.output, min_fit=0.0))
    sensors = dict(config.sensors)
    for name in config.sensor_names:
        parts = []
        for k, (detections, truth) in enumerate(with_progress(recordings)):
            if name not in detections.sensors:
                continue
            alone = detections.select([name])
            found = _scored_boxes(track(own_picture(every, alone), alone), alone, config, name)
            try:
                parts.append(match_sensor(found, truth, name, k))
            except DataError:  # it tracks nothing while there is truth
                continue
        if parts:
            pooled = SensorMatches.pool(parts)
            if len(pooled.score) >= _LEAST:
                knots = fit_precision(pooled.score, pooled.correct)
                sensors[name] = replace(sensors[name], score_fit=knots)
    return replace(config, sensors=sensors)


def choose_score_fit(config: Config, recordings: Sequence[Recording]) -> tuple[Config, PartChoice | None]:
    """Measure `score_fit`, and keep it unless it loses on recordings that it was not measured from.

    It is a share that was counted, not a setting that was tried, and where scores say nothing it changes
    nothing. Asked to win by more than chance, three recordings of walkers never kept what gained the other
    three nine points of MOTA; half of three are too few to measure it at all. So it has to lose by more than
    scenes scatter.

    Returns:
        The configuration, and what was decided; None where there are too few recordings to decide.
    """
    parts = folds(recordings)
    if len(parts) < 2:
        return measure_score_fit(config, recordings), None
    halves = [measure_score_fit(config, other) for other in reversed(parts)]
    now, then = judge([config] * len(parts), parts), judge(halves, parts)
    kept = then.mean >= now.mean - max(CHANCE, scene_error(recordings))
    choice = PartChoice(SCORE_FIT, kept, then.mean - now.mean)
    return (measure_score_fit(config, recordings) if kept else config), choice


def _scored_boxes(table: Trajectories, detections: Detections, config: Config, name: str) -> Detections:
    """The boxes of a table as detections, each with the mean score of what its track took of late."""
    score = np.full(len(table), np.nan)
    for rows, scan, j in taken_in_scan(table, detections, name, config.sensor_names.index(name)):
        score[rows] = scan.scores[j]
    order = np.lexsort((table.t, table.track_id))
    mean = np.empty(len(table))
    mean[order] = _recent_means(
        table.track_id[order], table.t[order], score[order], config.output.fit_memory_s
    )
    known = np.isfinite(mean)
    names = np.full(int(known.sum()), name)
    return Detections.from_rows(table.t[known], names, table.boxes[known], mean[known])


@njit(cache=True)
def _recent_means(track: IntArray, t: FloatArray, value: FloatArray, memory_s: float) -> FloatArray:
    """Mean (K,) of what each track has had by each row, over a short memory; NaN before the first.

    Args:
        track: (K,) its number; rows of one follow one another in order of time.
        t: (K,) s.
        value: (K,) NaN where there is none.
        memory_s: time in which a value's weight falls to 1/e.
    """
    out = np.full(len(t), np.nan)
    kept = np.zeros((1, 2))
    for k in range(len(t)):
        if k == 0 or track[k] != track[k - 1]:
            kept[:] = 0.0
        else:
            fade(kept, t[k] - t[k - 1], memory_s)
        if not math.isnan(value[k]):
            take(kept[0], value[k], 1.0)
        if kept[0, WEIGHT] > 0.0:
            out[k] = kept[0, MEAN]
    return out
