"""Prediction of all tracks to the time of a batch, and what each sensor may then see of them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.association.boxes import occluded_fraction, track_boxes, visible_fraction
from jeat_graph.config.kernel_form import Model, SensorArrays, Settings
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.coasting import forget
from jeat_graph.filters.coloured_noise import MOTION, expected, predict_errors
from jeat_graph.filters.existence import motion_visibility, unsure_visibility
from jeat_graph.filters.fit import fade
from jeat_graph.filters.jerk import track_jerk
from jeat_graph.filters.kalman import predict, predict_size
from jeat_graph.filters.noise import base_variance, hidden_excess
from jeat_graph.filters.sides import MOST_LOG_SIZE, mean_side
from jeat_graph.tracking.batch import Batch
from jeat_graph.tracking.stages.inner import inlined, inner
from jeat_graph.tracking.stages.looking import known_fields, looks_at
from jeat_graph.tracking.stages.manoeuvring import choose_jerk, predict_manoeuvring
from jeat_graph.tracking.stages.resizing import choose_resizing, predict_resizing, size_density_of
from jeat_graph.tracking.state import SceneState, TrackArrays

# A small rest remains: what should be invisible is still taken if it is detected.
_LEAST_VISIBLE = 1e-5
# A camera that has not looked in so many of its periods is not there.
_LATE_PERIODS = 3.0


@inner
def jerk_of(tracks: TrackArrays, track: IntArray, settings: Settings) -> FloatArray:
    """Root spectral density (K,) of the jerk of the tracks in rows `track` (K,) now (px/s^2.5)."""
    motion, still = settings.motion, settings.standing.jerk_factor
    size_mean, factor, standing, out = (
        tracks.size_mean,
        tracks.jerk_factor,
        tracks.standing,
        np.empty(len(track)),
    )
    for k in range(len(track)):
        i = track[k]
        part = still if standing[i] else 1.0
        out[k] = part * track_jerk(
            size_mean[i],
            motion.jerk_px,
            motion.jerk_per_size,
            motion.jerk_per_growth,
            max(factor[i], 1.0) if standing[i] else factor[i],
        )
    return out


@inner
def most_trusted(seen_by: int, trust: FloatArray) -> float:
    """Greatest trust among the sensors that have seen a track.

    "Hidden from you" is an excuse for a sensor that misses a track; what only a sensor of little trust has
    ever seen is excused less.

    Args:
        seen_by: bit s is set where sensor s counts as having seen it.
        trust: (S,) of the sensors.
    """
    best = 0.0
    for s in range(len(trust)):
        if seen_by >> s & 1:
            best = max(best, trust[s])
    return best


@inner
def has_looked(s: int, t: float, scene: SceneState, model: Model) -> bool:
    """Whether sensor `s` has looked of late, before time `t` (s)."""
    return bool(t - scene.last_look[s] <= model.settings.lifecycle.max_gap_confirmed_s)


@inner
def last_sight(scene: SceneState) -> float:
    """Return the time of the last scan (s) of a sensor that sees as likely as not, compared to the others."""
    sharpest = 1.0 - np.min(scene.blind)
    newest = -np.inf
    for s in range(len(scene.blind)):
        if 1.0 - scene.blind[s] >= 0.5 * sharpest:
            newest = max(newest, scene.last_look[s])
    return newest


@njit(cache=True)
def predict_all(tracks: TrackArrays, n: int, dt: float, scene: SceneState, model: Model) -> None:
    """Predict motion, size and existence of the first `n` tracks by `dt` seconds, in place."""
    tracks.used[:n] = 0
    if dt <= 0.0:
        return
    sensors, settings = model.sensors, model.settings
    manoeuvring = tracks.jerk_weight.shape[1] > 0
    if manoeuvring:
        choose_jerk(tracks, n, dt, scene, model)
    jerk = jerk_of(tracks, np.arange(n), settings)
    for i in range(n):
        side = mean_side(tracks.size_mean[i])
        drift = settings.standing.drift_per_size * side
        tracks.rest_var[i] += drift * drift * dt
    predict(tracks.mean[:n], tracks.cov[:n], jerk, dt)
    if len(sensors.correlation_time_s):
        predict_errors(tracks.mean[:n], tracks.cov[:n], sensors.correlation_time_s, dt)
    resizing = tracks.size_weight.shape[1] > 0
    if resizing:
        choose_resizing(tracks, n, dt, scene, model)
    density = size_density_of(tracks, np.arange(n), settings)
    predict_size(tracks.size_mean[:n], tracks.size_cov[:n], density, dt)
    unseen = tracks.t_update[:n] < last_sight(scene)
    if manoeuvring:
        predict_manoeuvring(tracks, n, dt, unseen, scene, model)
    if resizing:
        predict_resizing(tracks, n, dt, unseen, scene, model)
    if settings.motion.unseen_memory_s > 0.0:
        memory_s = settings.motion.unseen_memory_s
        forget(
            tracks.mean[:n], tracks.cov[:n], tracks.size_mean[:n], tracks.size_cov[:n], unseen, dt, memory_s
        )
    fade(tracks.fit[:n], dt, settings.output.fit_memory_s)
    lifecycle = settings.lifecycle
    if lifecycle.by_existence:
        survival = math.exp(-dt / lifecycle.lifetime_s)
        relax = 1.0 - math.exp(-dt / lifecycle.hidden_memory_s)
        for i in range(n):
            tracks.existence[i] *= survival
            believed = lifecycle.hidden_prior * most_trusted(tracks.seen_by[i], scene.trust)
            for s in range(tracks.hidden.shape[1]):
                known = tracks.seen_by[i] >> s & 1
                usual = lifecycle.hidden_prior if known else believed
                tracks.hidden[i, s] += relax * (usual - tracks.hidden[i, s])


@inner
def occlusion(tracks: TrackArrays, n: int) -> FloatArray:
    """Fraction (n,) of each track's box that nearer tracks hide."""
    return occluded_fraction(track_boxes(tracks.mean[:n], tracks.size_mean[:n]), tracks.existence[:n])


@inner
def current_p_detect(
    tracks: TrackArrays, n: int, batch: Batch, occluded: FloatArray, scene: SceneState, model: Model
) -> tuple[FloatArray, FloatArray]:
    """Probability (n, S) that each sensor detects each track now, twice; 0 for sensors that did not look.

    The track's own running P_D times what is known of this moment: the part of the box inside the picture and
    not hidden by nearer vehicles, whether the sensor looks there at all, and for an event camera the image
    speed.

    Returns:
        For a detection, and for a miss. They differ for an event camera as far as nobody else will find the
        track: a new track's speed is not known, which is not to stand still. A miss goes by the most likely
        speed: misses in a row all follow from one and the same unknown speed, and to count the doubt anew
        with each would soon end a vehicle that is far and slow.
    """
    sensors, image, present = model.sensors, model.settings.image, batch.present
    missed = np.zeros((n, len(present)))
    boxes = track_boxes(tracks.mean[:n], tracks.size_mean[:n])
    fields, width = known_fields(scene, model), image.width
    found = np.zeros((n, len(present))) if np.max(sensors.blind_speed) > 0.0 else missed
    waits_for, usual = _who_sees_still(batch, scene, model), model.settings.lifecycle.hidden_prior
    for i in range(n):
        inside = visible_fraction(boxes[i], image.width, image.height) * (1.0 - occluded[i])
        for s in range(len(present)):
            if present[s]:
                v, blind_speed = tracks.mean[i, :, 1], sensors.blind_speed[s]
                here, own = inside * (1.0 - tracks.hidden[i, s]), tracks.p_detect[i, s]
                likely = motion_visibility(v, blind_speed)
                here *= looks_at(tracks.mean[i, 0, 0], scene.field[s], fields[s], width)
                visible = likely
                if blind_speed > 0.0:
                    alone = _without_others(tracks.hidden[i], waits_for, usual)
                    if alone > likely:
                        prior_var = new_velocity_var(mean_side(tracks.size_mean[i]), model.settings)
                        unsure = unsure_visibility(v, tracks.cov[i, :, 1, 1], prior_var, blind_speed)
                        visible = max(likely, alone * unsure)
                missed[i, s] = own * max(here * likely, _LEAST_VISIBLE)
                found[i, s] = own * max(here * visible, _LEAST_VISIBLE)
    return found, missed


@inner
def _without_others(hidden: FloatArray, waits_for: FloatArray, usual: float) -> float:
    """Return the probability that a track will be found by none of the sensors that see what stands still.

    What one of them has not looked for yet waits for its look, and counts as found: boxes of events repeat,
    false ones too. A miss says that the track may be hidden from it.

    Args:
        hidden: (S,) probability that the track is hidden from each sensor.
        waits_for: (S,) of `_who_sees_still`.
        usual: `hidden` of what no look has missed.
    """
    alone = 1.0
    for s in range(len(hidden)):
        alone *= 1.0 - waits_for[s] * min((1.0 - hidden[s]) / (1.0 - usual), 1.0)
    return alone


@inner
def _who_sees_still(batch: Batch, scene: SceneState, model: Model) -> FloatArray:
    """Probability (S,) that a sensor looks, or has of late, that sees what stands still and is not blind."""
    sensors, begin = model.sensors, np.min(scene.first_look)
    sees = np.zeros(len(batch.present))
    for s in range(len(sees)):
        looks = batch.present[s] or has_looked(s, batch.t, scene, model)
        # One that has not looked at all may still begin.
        looks = looks or batch.t - begin <= _LATE_PERIODS * sensors.period_s[s]
        if looks and sensors.blind_speed[s] <= 0.0:
            sees[s] = 1.0 - max(scene.blind[s], scene.unproven[s])
    return sees


@inlined
def new_velocity_var(side: float, settings: Settings) -> float:
    """Variance (px²/s²) of the velocity of a new track whose box has this size (px)."""
    std = settings.motion.velocity_std_px + settings.motion.velocity_std_per_size * side
    # A product, not a power: compiled and plain code then round alike.
    return float(std * std)


@inner
def detection_variance(tracks: TrackArrays, i: int, s: int, axis: int, sensors: SensorArrays) -> float:
    """Variance (px²) of a detection of sensor `s` on track `i`, one axis, at weight 1: s · R_base(size)."""
    side = math.exp(min(tracks.size_mean[i, axis, 0], MOST_LOG_SIZE))
    size = mean_side(tracks.size_mean[i])
    base = base_variance(sensors.sigma_px[s], sensors.rho[s, axis], side, sensors.rho_size[s], size)
    return float(tracks.scale[i, s] * base)


@inner
def split_noise(variance: float, s: int, sensors: SensorArrays) -> tuple[float, float]:
    """Split the noise of sensor `s`: white variance (px²), standard deviation of the coloured part (px)."""
    share = sensors.correlated_share[s]
    return (1.0 - share) * variance, math.sqrt(share * variance)


class Expectation(NamedTuple):
    """Where the next detection of each sensor on each track is expected.

    Attributes:
        centre: (N, S, 2) expected centre (px).
        var: (N, S, 2) its variance before the detection's white noise (px²).
        lasting: (N, S, 2, 3) what of them the sensor's lasting error adds: to the centre (px), twice its
            covariance with the centre and its variance (px²); (0, 0, 0, 0) where no sensor's scores say how
            exact boxes are.
        white: (N, S, 2) variance of that noise at weight 1 (px²).
        coloured_std: (N, S, 2) standard deviation of the coloured part of the noise (px), 0 for none.
    """

    centre: FloatArray
    var: FloatArray
    lasting: FloatArray
    white: FloatArray
    coloured_std: FloatArray


@inner
def expect_detections(tracks: TrackArrays, n: int, occluded: FloatArray, model: Model) -> Expectation:
    """Say where each sensor would find each of the first `n` tracks, and with what noise.

    Args:
        tracks: state of all tracks.
        n: number of living ones.
        occluded: (n,) part of each box that others hide.
        model: sensors and settings.
    """
    sensors, growth = model.sensors, model.settings.noise.hidden_growth
    shape = (n, len(sensors.sigma_px), 2)
    centre, var, white, coloured_std = np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape)
    # Only a detection that is not as exact as usual asks for it.
    by_score = np.min(sensors.noise_factor) < 1.0 or np.max(sensors.noise_factor) > 1.0
    lasting = np.zeros((*shape, 3) if by_score else (0, 0, 0, 0))
    for i in range(n):
        more = hidden_excess(occluded[i], growth)
        for s in range(shape[1]):
            for axis in range(2):
                r, h = split_noise(detection_variance(tracks, i, s, axis, sensors), s, sensors)
                white[i, s, axis], coloured_std[i, s, axis] = r + more * (r + h * h), h
                m, P = tracks.mean[i, axis], tracks.cov[i, axis]
                centre[i, s, axis], var[i, s, axis] = expected(m, P, h, sensors.error[s])
                if by_score and sensors.error[s] >= 0:
                    e = MOTION + sensors.error[s]
                    parts = lasting[i, s, axis]
                    parts[0], parts[1], parts[2] = h * m[e], 2.0 * h * P[0, e], h * h * P[e, e]
    return Expectation(centre, var, lasting, white, coloured_std)
