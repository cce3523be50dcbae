"""What one instant teaches of where each sensor's boxes end, beside those of the others."""

from __future__ import annotations

import math

import numpy as np

from jeat_graph.config.kernel_form import Model
from jeat_graph.filters.box_offsets import PairTerms, compare_boxes, noise_factors, solve_offsets
from jeat_graph.filters.cut_boxes import WHOLE
from jeat_graph.tracking.batch import Batch
from jeat_graph.tracking.stages.associating import Association
from jeat_graph.tracking.stages.inner import inlined, inner
from jeat_graph.tracking.state import SceneState, TrackArrays


@inner
def compares(model: Model) -> bool:
    """Whether anything may be learnt: there are several sensors, and one of them may be off."""
    return bool(len(model.sensors.bias_std) > 1 and np.max(model.sensors.bias_std) > 0.0)


@inlined
def learn_boxes(
    tracks: TrackArrays, n: int, batch: Batch, association: Association, scene: SceneState, model: Model
) -> None:
    """Learn from the detections that the first `n` tracks took what their sensors are off by, in place."""
    if not compares(model):
        return
    settings, pairs = model.settings.boxes, 0
    # Loops in place: a function that takes the state of all tracks for each of them, takes ten times as long.
    match, cut, plain, last = association.match, batch.cut, batch.plain, tracks.last_box
    mean, size_mean = tracks.mean, tracks.size_mean
    for s in range(len(batch.present)):
        if not batch.present[s]:
            continue
        for i in range(n):
            j = match[i, s]
            if j >= 0 and cut[j, 0] == WHOLE and cut[j, 1] == WHOLE:
                last[i, s, 0] = batch.t
                for k in range(4):
                    last[i, s, 1 + k] = plain[j, k]
        for o in range(len(batch.present)):
            if not its_turn(s, o, model):
                continue
            first, second = min(s, o), max(s, o)
            known = scene.offsets[first] - scene.offsets[second]
            factors, sums = scene.pair_factors[first, second], scene.pair_sums[first, second]
            terms = terms_of(s, o, model)
            kept = math.exp(-model.sensors.period_s[s] / settings.memory_s)
            for i in range(n):
                if last[i, s, 0] == batch.t and batch.t - last[i, o, 0] <= settings.pair_s:
                    if kept < 1.0:
                        # What is old fades while there is something newer
                        sums *= kept
                        kept = 1.0
                    compare_boxes(last[i, s], last[i, o], mean[i], size_mean[i], known, factors, terms, sums)
                    pairs += 1
    if pairs:
        settle_offsets(scene, model)


@inner
def its_turn(s: int, o: int, model: Model) -> bool:
    """Whether boxes of sensor `s` are compared with the last ones of `o`: those of the slower of the two."""
    own, other = model.sensors.period_s[s], model.sensors.period_s[o]
    return bool(other < own or (other == own and o < s))


@inner
def _square(x: float) -> float:
    """Return x²; a product, so that compiled and plain code round alike."""
    return x * x


@inner
def terms_of(s: int, o: int, model: Model) -> PairTerms:
    """On what terms a box of sensor `s` is compared with one of `o`."""
    sensors, settings = model.sensors, model.settings.boxes
    return PairTerms(
        1.0 if s < o else -1.0,
        _square(sensors.sigma_px[s]) + _square(sensors.sigma_px[o]),
        _square(sensors.rho[s, 0]) + _square(sensors.rho[o, 0]),
        _square(sensors.rho[s, 1]) + _square(sensors.rho[o, 1]),
        _square(sensors.rho_size[s]) + _square(sensors.rho_size[o]),
        sensors.size_var[s, 0] + sensors.size_var[o, 0],
        sensors.size_var[s, 1] + sensors.size_var[o, 1],
        # Boxes of one vehicle are no independent witnesses: so much time of it is one.
        sensors.period_s[s] / settings.witness_s,
        settings.tail_freedom,
    )


@inlined
def remember_box(tracks: TrackArrays, i: int, batch: Batch, j: int) -> None:
    """Keep detection `j`, if it is whole, as the last box of its sensor on track `i`."""
    if batch.cut[j, 0] == WHOLE and batch.cut[j, 1] == WHOLE:
        tracks.last_box[i, batch.sensor[j], 0] = batch.t
        for k in range(4):
            tracks.last_box[i, batch.sensor[j], 1 + k] = batch.plain[j, k]


@inner
def settle_offsets(scene: SceneState, model: Model) -> None:
    """Draw the conclusions for the next step: how noisy the differences are, then what sensors are off by."""
    sensors, settings = model.sensors, model.settings.boxes
    S = len(sensors.bias_std)
    std = np.empty((S, 5))
    for s in range(S):
        std[s, 0] = settings.centre_share * sensors.bias_std[s]
        std[s, 1] = settings.centre_px * sensors.bias_std[s]
        std[s, 2] = sensors.bias_std[s]
        std[s, 3] = settings.place_share * sensors.bias_std[s]
        std[s, 4] = settings.lag_s * sensors.bias_std[s]
        for o in range(s + 1, S):
            for axis in range(2):
                difference = scene.offsets[s, axis] - scene.offsets[o, axis]
                found = noise_factors(scene.pair_sums[s, o, axis], difference, settings.prior_s)
                scene.pair_factors[s, o, axis, 0], scene.pair_factors[s, o, axis, 1] = found
    solve_offsets(scene.pair_sums, scene.pair_factors, std, scene.offsets)
