"""New tracks from detections that no track took."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.association.births import choose_births
from jeat_graph.config.kernel_form import SensorArrays, Settings
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.coloured_noise import MOTION
from jeat_graph.filters.existence import track_boxes
from jeat_graph.filters.noise import base_variance
from jeat_graph.tracking.batch import Measurements
from jeat_graph.tracking.stages.ending import confirm
from jeat_graph.tracking.stages.predicting import jerk_of, split_noise
from jeat_graph.tracking.stages.updating import take
from jeat_graph.tracking.state import SceneArrays, TrackArrays
from jeat_graph.tracking.update_log import UpdateLog, log_birth, log_update


@njit(cache=True)
def give_birth(
    tracks: TrackArrays,
    n: int,
    next_id: int,
    t: float,
    batch: Measurements,
    taken: IntArray,
    scene: SceneArrays,
    sensors: SensorArrays,
    settings: Settings,
    log: UpdateLog,
) -> tuple[int, int]:
    """Start tracks from leftovers; returns the number of tracks and the next identity."""
    existence = birth_existence(batch, scene, settings)
    parents, partner = choose_births(
        batch.boxes,
        existence,
        batch.sensor,
        taken,
        track_boxes(tracks.mean[:n], tracks.size_mean[:n]),
        settings.birth_min_existence,
        settings.birth_max_overlap,
    )
    for b in range(len(parents)):
        start_track(tracks, n + b, next_id + b, t, parents[b], batch, sensors, settings, log)
        tracks.existence[n + b] = existence[parents[b]]
        tracks.p_detect[n + b] = scene.p_detect
        tracks.hidden[n + b] = settings.hidden_prior
        tracks.hidden[n + b, batch.sensor[parents[b]]] = 0.0
    for j in range(len(partner)):
        if partner[j] >= 0:
            i = n + partner[j]
            R, lever = own_noise(batch, j, sensors)
            take(tracks, i, t, j, batch, R, lever, sensors, settings, log)
            # Two sensors' false boxes seldom coincide: each view's chance to be false remains.
            tracks.existence[i] = 1.0 - (1.0 - tracks.existence[i]) * (1.0 - batch.precision[j])
    confirm(tracks, n + len(parents), t, settings)
    return n + len(parents), next_id + len(parents)


@njit(cache=True)
def own_noise(batch: Measurements, j: int, sensors: SensorArrays) -> tuple[FloatArray, FloatArray]:
    """Noise of detection `j` by its own size, where no track's is known.

    Returns:
        (2,) variances of the white part (px²) and (2,) levers of the sensor's error state (px).
    """
    s = batch.sensor[j]
    white, lever = np.empty(2), np.empty(2)
    for axis in range(2):
        base = base_variance(sensors.sigma_px[s], sensors.rho[s, axis], batch.boxes[j, 2 + axis])
        r, h = split_noise(base, s, sensors)
        white[axis], lever[axis] = r * batch.weight[j], h
    return white, lever


@njit(cache=True)
def birth_existence(batch: Measurements, scene: SceneArrays, settings: Settings) -> FloatArray:
    """Probability (M,) that a detection which no track took is of a vehicle not tracked before.

    u P_D LR(score) / (u P_D LR(score) + λ): u vehicles in the scene are expected to have no track yet, and
    most leftovers are clutter however high their score (Williams 2015, the Poisson part of the mixture).
    """
    out = np.empty(len(batch.precision))
    for j in range(len(out)):
        s = batch.sensor[j]
        x, y = batch.z[j]
        if settings.leave_picture and not (
            0.0 <= x <= settings.image_width and 0.0 <= y <= settings.image_height
        ):
            out[j] = -1.0  # it would end in the same step
            continue
        true = scene.undetected[0] * scene.p_detect[s] * math.exp(batch.log_score[j])
        out[j] = true / (true + scene.clutter[s])
    return out


@njit(cache=True)
def start_track(
    tracks: TrackArrays,
    i: int,
    track_id: int,
    t: float,
    j: int,
    batch: Measurements,
    sensors: SensorArrays,
    settings: Settings,
    log: UpdateLog,
) -> None:
    """Fill row `i` with a new track at detection `j`; `give_birth` adds what the scene says of it."""
    s = batch.sensor[j]
    side = math.sqrt(batch.boxes[j, 2] * batch.boxes[j, 3])
    tracks.mean[i] = 0.0
    tracks.cov[i] = 0.0
    tracks.size_mean[i] = 0.0
    tracks.size_cov[i] = 0.0
    white, lever = own_noise(batch, j, sensors)
    R = white + lever * lever
    for axis in range(2):
        tracks.mean[i, axis, 0] = batch.z[j, axis]
        tracks.anchor[i, axis] = batch.z[j, axis]
        tracks.anchor_var[i, axis] = R[axis]
        tracks.cov[i, axis, 0, 0] = R[axis]
        tracks.cov[i, axis, 1, 1] = (settings.velocity_std_px + settings.velocity_std_per_size * side) ** 2
        tracks.cov[i, axis, 2, 2] = (
            settings.acceleration_std_px + settings.acceleration_std_per_size * side
        ) ** 2
        for e in range(MOTION, tracks.mean.shape[2]):
            tracks.cov[i, axis, e, e] = 1.0
        if sensors.error[s] >= 0:
            # p = z − h e − w: what the detection is off by, the position is off by the other way.
            e = MOTION + sensors.error[s]
            tracks.cov[i, axis, 0, e] = tracks.cov[i, axis, e, 0] = -lever[axis]
        tracks.size_mean[i, axis, 0] = batch.log_size[j, axis]
        tracks.size_cov[i, axis, 0, 0] = sensors.size_var[s, axis]
        tracks.size_cov[i, axis, 1, 1] = settings.size_rate_std**2
    tracks.anchor_t[i] = t
    tracks.still_odds[i] = 0.0
    tracks.standing[i] = False
    tracks.scale[i] = 1.0
    tracks.confirmed[i] = False
    tracks.track_id[i] = track_id
    tracks.hits[i] = 1
    tracks.t_birth[i] = t
    tracks.t_update[i] = t
    tracks.used[i] = 1 << s
    if len(log.rows) > 0:
        jerk = jerk_of(tracks, i, settings)
        log_update(log, track_id, s, batch.z[j], white, lever, jerk, batch.log_size[j], sensors.size_var[s])
        log_birth(log, tracks.cov[i], tracks.size_cov[i])
