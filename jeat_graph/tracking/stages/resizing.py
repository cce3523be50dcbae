"""How fast the box of each track changes its size, and how fast boxes of this scene usually do."""

from __future__ import annotations

import numpy as np

from jeat_graph.config.kernel_form import Model, SensorArrays, Settings
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.filters.coasting import forget_growth
from jeat_graph.filters.cut_boxes import WHOLE
from jeat_graph.filters.kalman import predict_size
from jeat_graph.filters.manoeuvre import density_factor, mean_factor, relax_weights
from jeat_graph.filters.resizing import resizing_density, weigh_resizing
from jeat_graph.filters.running_mean import take_into_mean
from jeat_graph.tracking.batch import Measured
from jeat_graph.tracking.stages.inner import inner
from jeat_graph.tracking.stages.manoeuvring import INNOVATIONS_S, LEAST_INNOVATION, follow_usual
from jeat_graph.tracking.state import SceneState, TrackArrays

# One odd box counts for no more than what one in a hundred exceeds (chi squared, one degree of freedom).
_MOST_NIS = 6.6


@inner
def size_density_of(tracks: TrackArrays, track: IntArray, settings: Settings) -> FloatArray:
    """Root spectral density (K,) of the rate of ln size of the tracks in rows `track` (K,) now (1/s^1.5)."""
    size, out = settings.size, np.empty(len(track))
    for k in range(len(track)):
        i = track[k]
        density = tracks.size_factor[i] * size.rate_density
        out[k] = resizing_density(tracks.size_mean[i], density, size.density_per_growth)
    return out


@inner
def choose_resizing(tracks: TrackArrays, n: int, dt: float, scene: SceneState, model: Model) -> None:
    """Say how much harder than usual each track's size changes over the next `dt` seconds, in place."""
    size = model.settings.size
    relax_weights(tracks.size_weight[:n], scene.usual_resizing, dt, size.change_memory_s)
    usual = mean_factor(scene.usual_resizing, size.calm_step, size.change_step)
    for i in range(n):
        own = mean_factor(tracks.size_weight[i], size.calm_step, size.change_step)
        tracks.size_factor[i] = own if tracks.confirmed[i] else usual


@inner
def predict_resizing(
    tracks: TrackArrays, n: int, dt: float, unseen: BoolArray, scene: SceneState, model: Model
) -> None:
    """Predict the sizes of the first `n` tracks under every density, and learn what is usual, in place."""
    size, K = model.settings.size, tracks.size_weight.shape[1]
    density, lost = np.empty(n * K), np.empty(n * K, dtype=np.bool_)
    for i in range(n):
        for k in range(K):
            alone = size.rate_density * density_factor(k, size.calm_step, size.change_step)
            density[i * K + k] = resizing_density(tracks.size_mean[i], alone, size.density_per_growth)
            lost[i * K + k] = unseen[i]
    mean = tracks.size_trial_mean[:n].reshape((n * K, 2, 2))
    cov = tracks.size_trial_cov[:n].reshape((n * K, 2, 2, 2))
    predict_size(mean, cov, density, dt)
    if model.settings.motion.unseen_memory_s > 0.0:
        forget_growth(mean, cov, lost, dt, model.settings.motion.unseen_memory_s)
    follow_usual(scene.usual_resizing, tracks.size_weight, tracks.confirmed, n, dt)


@inner
def weigh_sizes(
    tracks: TrackArrays,
    measured: Measured,
    s: int,
    cut: IntArray,
    scene: SceneState,
    sensors: SensorArrays,
) -> None:
    """Weigh the densities of K tracks by the sizes of sensor `s` that they are about to take, in place.

    Args:
        tracks: state of all tracks.
        measured: what these detections measure.
        s: the sensor.
        cut: (M, 2) which sides of all detections the edges of the picture cut.
        scene: what is learnt of the sensor's sizes; updated.
        sensors: parameters of the sensors.
    """
    mean, cov, weight = tracks.size_trial_mean, tracks.size_trial_cov, tracks.size_weight
    whole = np.empty(2, dtype=np.bool_)
    exactness = 1.0 / min(max(scene.size_innovation[s], LEAST_INNOVATION), 1.0)
    for m in range(len(measured.track)):
        i, j = measured.track[m], measured.detection[m]
        for side in range(2):
            whole[side] = cut[j, side] == WHOLE
        square = weigh_resizing(
            mean[i], cov[i], weight[i], measured.log_size[m], measured.log_size_var[m], whole, exactness
        )
        if tracks.confirmed[i] and (whole[0] or whole[1]):
            square = min(square, _MOST_NIS)
            take_into_mean(
                scene.size_innovation, scene.size_seen, s, square, sensors.period_s[s], INNOVATIONS_S
            )


@inner
def follow_cut(tracks: TrackArrays, measured: Measured, cut: IntArray) -> None:
    """Give all size filters of K tracks the size of their own where the edge cut the box, in place."""
    K = tracks.size_weight.shape[1]
    for m in range(len(measured.track)):
        i, j = measured.track[m], measured.detection[m]
        for side in range(2):
            if cut[j, side] != WHOLE:
                for k in range(K):
                    tracks.size_trial_mean[i, k, side] = tracks.size_mean[i, side]
                    tracks.size_trial_cov[i, k, side] = tracks.size_cov[i, side]


@inner
def start_sizes(tracks: TrackArrays, i: int, scene: SceneState) -> None:
    """Start the size filters of a new track `i` with its own size, and the weights that are usual."""
    tracks.size_weight[i] = scene.usual_resizing
    for k in range(tracks.size_weight.shape[1]):
        tracks.size_trial_mean[i, k] = tracks.size_mean[i]
        tracks.size_trial_cov[i, k] = tracks.size_cov[i]
