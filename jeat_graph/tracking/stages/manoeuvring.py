"""How hard each track manoeuvres, and how hard tracks of this scene usually do."""

from __future__ import annotations

import numpy as np

from jeat_graph.config.kernel_form import Model, SensorArrays
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.filters.cut_boxes import WHOLE, floor_of_centre
from jeat_graph.filters.jerk import track_jerk
from jeat_graph.filters.manoeuvre import (
    density_factor,
    mean_factor,
    predict_manoeuvres,
    relax_weights,
    weigh_manoeuvres,
)
from jeat_graph.filters.running_mean import take_into_mean
from jeat_graph.tracking.batch import Measured
from jeat_graph.tracking.stages.inner import inner
from jeat_graph.tracking.state import USUAL_JERK_S, SceneState, TrackArrays

# How large a sensor's innovations are is their mean over so many seconds of a track.
INNOVATIONS_S = 60.0
# One odd box counts for no more than what one in a hundred exceeds (chi squared, two degrees of freedom).
_MOST_NIS = 9.2
# However small they are: of a detector without noise, rounding errors would decide what is calm.
LEAST_INNOVATION = 0.1


@inner
def choose_jerk(tracks: TrackArrays, n: int, dt: float, scene: SceneState, model: Model) -> None:
    """Say by which factor each track's jerk differs from the usual one over the next `dt` seconds, in place.

    False boxes jump about, which is no manoeuvre: a track that followed them would take in ever more
    of them. So tracks that are not confirmed have the mean jerk of the scene, but no more than the usual.
    """
    motion = model.settings.motion
    calmer, harder = motion.calm_step, motion.manoeuvre_step
    relax_weights(tracks.jerk_weight[:n], scene.usual_jerk, dt, motion.manoeuvre_memory_s)
    usual = min(mean_factor(scene.usual_jerk, calmer, harder), 1.0)
    for i in range(n):
        factor = mean_factor(tracks.jerk_weight[i], calmer, harder)
        tracks.jerk_factor[i] = factor if tracks.confirmed[i] else usual


@inner
def follow_usual(usual: FloatArray, weight: FloatArray, confirmed: BoolArray, n: int, dt: float) -> None:
    """Follow the weights (K,) that are usual of the confirmed among the first `n` tracks, in place.

    Each confirmed track counts for the seconds that it lasts; what is older than a while is forgotten.
    """
    count, share = 0, np.zeros(len(usual))
    for i in range(n):
        if confirmed[i]:
            count += 1
            for k in range(len(usual)):
                share[k] += weight[i, k]
    if count:
        gain = count * dt / (USUAL_JERK_S + count * dt)
        for k in range(len(usual)):
            usual[k] += gain * (share[k] / count - usual[k])


@inner
def predict_manoeuvring(
    tracks: TrackArrays, n: int, dt: float, unseen: BoolArray, scene: SceneState, model: Model
) -> None:
    """Predict the first `n` tracks under every density, and learn what is usual of the confirmed ones."""
    motion = model.settings.motion
    K = tracks.jerk_weight.shape[1]
    jerk, lost = np.empty(n * K), np.empty(n * K, dtype=np.bool_)
    for i in range(n):
        for k in range(K):
            jerk[i * K + k] = track_jerk(
                tracks.size_mean[i],
                motion.jerk_px,
                motion.jerk_per_size,
                motion.jerk_per_growth,
                density_factor(k, motion.calm_step, motion.manoeuvre_step),
            )
            lost[i * K + k] = unseen[i]
    mean, cov, time = tracks.jerk_mean[:n], tracks.jerk_cov[:n], model.sensors.correlation_time_s
    predict_manoeuvres(mean, cov, jerk, time, dt, lost, motion.unseen_memory_s)
    follow_usual(scene.usual_jerk, tracks.jerk_weight, tracks.confirmed, n, dt)


@inner
def weigh_jerk(
    tracks: TrackArrays,
    measured: Measured,
    s: int,
    cut: IntArray,
    nis: FloatArray,
    scene: SceneState,
    sensors: SensorArrays,
) -> None:
    """Weigh the densities of K tracks by the detections of sensor `s` that they have just taken, in place.

    How large the sensor's innovations usually are is followed beside it.

    Args:
        tracks: state of all tracks.
        measured: what these detections measure.
        s: the sensor.
        cut: (M, 2) which sides of all detections the edges of the picture cut.
        nis: (K,) normalised innovation squared; lowered to what of it no manoeuvre explains.
        scene: what is learnt of the sensor's innovations; updated.
        sensors: parameters of the sensors.
    """
    error = sensors.error[s]
    track, detection, z = measured.track, measured.detection, measured.z
    white, coloured_std = measured.white, measured.coloured_std
    mean, cov, weight = tracks.jerk_mean, tracks.jerk_cov, tracks.jerk_weight
    size_mean, size_cov, say = tracks.size_mean, tracks.size_cov, np.empty(2)
    # Noise larger than assumed is the business of its own adaptation.
    exactness = 1.0 / min(max(scene.innovation[s], LEAST_INNOVATION), 1.0)
    for m in range(len(track)):
        i, j = track[m], detection[m]
        for axis in range(2):
            say[axis] = exactness if cut[j, axis] == WHOLE else 0.0
        left, square = weigh_manoeuvres(
            mean[i], cov[i], weight[i], z[m], white[m], coloured_std[m], error, say
        )
        nis[m] = min(nis[m], left)
        if tracks.confirmed[i] and say[0] > 0.0 and say[1] > 0.0:
            square = min(square, _MOST_NIS) / 2.0
            take_into_mean(
                scene.innovation, scene.innovation_seen, s, square, sensors.period_s[s], INNOVATIONS_S
            )
        for axis in range(2):
            if say[axis] == 0.0:
                for k in range(weight.shape[1]):
                    floor_of_centre(
                        cut[j, axis], size_mean[i, axis, 0], size_cov[i, axis, 0, 0], cov[i, k, axis]
                    )


@inner
def start_jerk(tracks: TrackArrays, i: int, scene: SceneState) -> None:
    """Start the filters of a new track `i` with its own state, and the weights that are usual."""
    tracks.jerk_weight[i] = scene.usual_jerk
    for k in range(tracks.jerk_weight.shape[1]):
        tracks.jerk_mean[i, k] = tracks.mean[i]
        tracks.jerk_cov[i, k] = tracks.cov[i]
