"""One step of the tracker on arrays: predict, associate, update, end, begin (paper algorithm 1)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.association.births import choose_births
from jeat_graph.association.costs import likelihood_cost, log_evidence
from jeat_graph.association.gating import gated_pairs
from jeat_graph.association.joint import (
    JOINT,
    SLOTS,
    associate_joint,
    associate_sequential,
    associate_slots,
)
from jeat_graph.association.merging import find_duplicates
from jeat_graph.compaction import keep_rows
from jeat_graph.filters.aekf import predict, predict_size, update, update_block
from jeat_graph.filters.noise import adapt_scale, base_variance
from jeat_graph.filters.standing import (
    moving_evidence,
    stand_still,
    still_evidence,
    update_anchor,
    update_odds,
)
from jeat_graph.lifecycle import (
    existence_after_hit,
    existence_after_miss,
    hidden_after_miss,
    motion_visibility,
    occluded_fraction,
    track_boxes,
    visible_fraction,
)
from jeat_graph.measurements import Measurements, prepare
from jeat_graph.settings import SensorArrays, Settings
from jeat_graph.state import SceneArrays, TrackArrays
from jeat_graph.update_log import UpdateLog, log_birth, log_update, root_jerk


@njit(cache=True)
def step(
    tracks: TrackArrays,
    num_tracks: int,
    next_id: int,
    dt: float,
    t: float,
    boxes: FloatArray,
    scores: FloatArray,
    sensor: IntArray,
    present: BoolArray,
    scene: SceneArrays,
    sensors: SensorArrays,
    settings: Settings,
    priority: IntArray,
    log: UpdateLog,
) -> tuple[int, int]:
    """Advance all tracks to time `t` and take in one batch of scans, in place.

    Args:
        tracks: state; its capacity must be at least `num_tracks` + M.
        num_tracks: number of living tracks N.
        next_id: identity of the next track to be born.
        dt: time since the last step (s), >= 0.
        t: time of the batch (s).
        boxes: (M, 4) left, top, width, height of the detections of all scans of the batch (px).
        scores: (M,) in [0, 1].
        sensor: (M,) sensor index of each detection.
        present: (S,) which sensors looked at `t`, including those that found nothing.
        scene: running estimates of clutter, P_D and undetected vehicles; updated.
        sensors: parameters of the sensors.
        settings: scalars of the configuration.
        priority: (S,) order of the sequential association.
        log: takes down what the tracks take in; of capacity 0 where nobody asks.

    Returns:
        The number of living tracks and the next identity.
    """
    n = num_tracks
    log.count[0] = 0
    predict_all(tracks, n, dt, settings)
    batch = prepare(boxes, scores, sensor, sensors, settings)
    p_detect = current_p_detect(tracks, n, present, sensors, settings)
    noise = track_noise(tracks, n, sensors)
    match, evidence = associate(tracks, n, batch, noise, p_detect, scene, sensors, settings, priority)
    taken = np.zeros(len(scores), dtype=np.int64)
    update_matched(tracks, n, t, batch, noise, match, evidence, taken, sensors, settings, log)
    if settings.second_pass:
        take_second_views(tracks, n, t, batch, match, taken, sensors, settings, log)
    learn_scene(tracks, n, dt, batch, match, taken, p_detect, present, scene, sensors, settings)
    count_misses(tracks, n, match, p_detect, present, settings)
    confirm(tracks, n, t, settings)
    n = remove_ended(tracks, n, t, settings)
    n, next_id = give_birth(tracks, n, next_id, t, batch, taken, scene, sensors, settings, log)
    # Vehicles that this batch could have shown and did not are rarer from now on.
    for s in range(len(present)):
        if present[s]:
            scene.undetected[0] *= 1.0 - scene.p_detect[s]
    return n, next_id


@njit(cache=True)
def predict_all(tracks: TrackArrays, n: int, dt: float, settings: Settings) -> None:
    """Predict motion, size and existence of the first `n` tracks by `dt` seconds, in place."""
    tracks.used[:n] = 0
    if dt <= 0.0:
        return
    jerk = np.empty(n)
    for i in range(n):
        side = math.exp(0.5 * (tracks.size_mean[i, 0, 0] + tracks.size_mean[i, 1, 0]))
        jerk[i] = settings.jerk_px + settings.jerk_per_size * side
        if tracks.standing[i]:
            jerk[i] *= settings.standing_jerk
        drift = settings.standing_drift * side
        tracks.anchor_var[i] += drift * drift * dt
    predict(tracks.mean[:n], tracks.cov[:n], jerk, dt)
    predict_size(tracks.size_mean[:n], tracks.size_cov[:n], settings.size_rate_density, dt)
    if settings.by_existence:
        survival = math.exp(-dt / settings.lifetime_s)
        relax = 1.0 - math.exp(-dt / settings.hidden_memory_s)
        for i in range(n):
            tracks.existence[i] *= survival
            for s in range(tracks.hidden.shape[1]):
                tracks.hidden[i, s] += relax * (settings.hidden_prior - tracks.hidden[i, s])


@njit(cache=True)
def current_p_detect(
    tracks: TrackArrays, n: int, present: BoolArray, sensors: SensorArrays, settings: Settings
) -> FloatArray:
    """Probability (n, S) that each sensor detects each track now; 0 for sensors that did not look.

    The track's own running P_D times what is known of this moment: the part of the box inside the picture and
    not hidden by nearer vehicles, and for an event camera the image speed.
    """
    out = np.zeros((n, len(present)))
    boxes = track_boxes(tracks.mean[:n], tracks.size_mean[:n])
    occluded = occluded_fraction(boxes, tracks.existence[:n])
    for i in range(n):
        inside = visible_fraction(boxes[i], settings.image_width, settings.image_height) * (1.0 - occluded[i])
        for s in range(len(present)):
            if present[s]:
                seen = motion_visibility(tracks.mean[i], sensors.blind_speed[s])
                # A small rest remains: what should be invisible is still taken if it is detected.
                visible = inside * seen * (1.0 - tracks.hidden[i, s])
                out[i, s] = tracks.p_detect[i, s] * max(visible, 1e-5)
    return out


@njit(cache=True)
def track_noise(tracks: TrackArrays, n: int, sensors: SensorArrays) -> FloatArray:
    """Measurement variances (n, S, 2) of a detection of each sensor on each track: s · R_base(size)."""
    num_sensors = len(sensors.sigma_px)
    out = np.empty((n, num_sensors, 2))
    for i in range(n):
        for axis in range(2):
            side = math.exp(min(tracks.size_mean[i, axis, 0], 12.0))
            for s in range(num_sensors):
                base = base_variance(sensors.sigma_px[s], sensors.rho[s, axis], side)
                out[i, s, axis] = tracks.scale[i, s] * base
    return out


@njit(cache=True)
def associate(
    tracks: TrackArrays,
    n: int,
    batch: Measurements,
    noise: FloatArray,
    p_detect: FloatArray,
    scene: SceneArrays,
    sensors: SensorArrays,
    settings: Settings,
    priority: IntArray,
) -> tuple[IntArray, FloatArray]:
    """Associate a batch with the predicted tracks.

    Returns:
        match (n, S): detection that each track takes of each sensor, or -1; evidence (n, S): its ln Λ.
    """
    num_sensors = len(sensors.sigma_px)
    rows, cols, d2, log_density, log_size_density = gated_pairs(
        tracks.mean[:n, :, 0],
        position_variances(tracks, n),
        noise,
        tracks.size_mean[:n, :, 0],
        size_variances(tracks, n),
        sensors.size_var,
        batch.z,
        batch.log_size,
        batch.weight,
        batch.sensor,
        settings.gate,
        settings.size_gate,
    )
    log_clutter = np.log(scene.clutter) - settings.log_clutter_volume
    pair_evidence = log_evidence(
        rows,
        cols,
        log_density,
        log_size_density,
        p_detect,
        batch.log_score,
        log_clutter,
        batch.sensor,
    )
    if settings.likelihood:
        costs = likelihood_cost(rows, cols, pair_evidence, tracks.existence, p_detect, batch.sensor)
    else:
        costs = d2
    if settings.method == SLOTS:
        match = associate_slots(n, num_sensors, rows, cols, costs, batch.sensor, settings.unassigned_cost)
    elif settings.method == JOINT:
        match = associate_joint(n, num_sensors, rows, cols, costs, batch.sensor, settings.unassigned_cost)
    else:
        match = associate_sequential(
            n, num_sensors, rows, cols, costs, batch.sensor, settings.unassigned_cost, priority
        )
    evidence = np.zeros((n, num_sensors))
    for p in range(len(rows)):
        s = batch.sensor[cols[p]]
        if match[rows[p], s] == cols[p]:
            evidence[rows[p], s] = pair_evidence[p]
    return match, evidence


@njit(cache=True)
def position_variances(tracks: TrackArrays, n: int) -> FloatArray:
    """Variances (n, 2) of the predicted centres (px²)."""
    out = np.empty((n, 2))
    for i in range(n):
        for axis in range(2):
            out[i, axis] = tracks.cov[i, axis, 0, 0]
    return out


@njit(cache=True)
def size_variances(tracks: TrackArrays, n: int) -> FloatArray:
    """Variances (n, 2) of the predicted ln width and ln height."""
    out = np.empty((n, 2))
    for i in range(n):
        for side in range(2):
            out[i, side] = tracks.size_cov[i, side, 0, 0]
    return out


@njit(cache=True, forceinline=True)
def judge_standing(
    tracks: TrackArrays, i: int, t: float, z: FloatArray, R: FloatArray, settings: Settings
) -> None:
    """Weigh a measurement z (2,), R (2,) of track `i` under "stands" and "moves", before it is taken in."""
    still = still_evidence(tracks.anchor[i], tracks.anchor_var[i], z, R)
    moving = moving_evidence(tracks.mean[i], tracks.cov[i], z, R)
    odds = update_odds(tracks.still_odds[i], still, moving, settings.standing_memory)
    tracks.still_odds[i] = odds
    if odds < settings.standing_leave:
        # It moves: look for a place to stand from here on.
        tracks.standing[i] = False
        tracks.still_odds[i] = settings.standing_leave
        tracks.anchor[i] = z
        tracks.anchor_var[i] = R
        tracks.anchor_t[i] = t
        return
    old = t - tracks.anchor_t[i] >= settings.standing_age_s
    tracks.standing[i] = tracks.standing[i] or (old and odds > settings.standing_enter)
    update_anchor(tracks.anchor[i], tracks.anchor_var[i], z, R)


@njit(cache=True, forceinline=True)
def take(
    tracks: TrackArrays,
    i: int,
    t: float,
    j: int,
    batch: Measurements,
    R: FloatArray,
    sensors: SensorArrays,
    settings: Settings,
    log: UpdateLog,
) -> None:
    """Update track `i` with detection `j` whose measurement variances are R (2,): filter, size, noise scale."""
    s = batch.sensor[j]
    if len(log.rows) > 0:
        factor = settings.standing_jerk if tracks.standing[i] else 1.0
        jerk = root_jerk(tracks.size_mean[i], settings.jerk_px, settings.jerk_per_size, factor)
        log_update(log, tracks.track_id[i], s, batch.z[j], R, jerk, batch.log_size[j], sensors.size_var[s])
    if settings.standing:
        judge_standing(tracks, i, t, batch.z[j], R, settings)
    nis = update(tracks.mean[i], tracks.cov[i], batch.z[j], R)
    tracks.scale[i, s] = adapt_scale(
        tracks.scale[i, s], nis, settings.adaptation_rate, settings.scale_min, settings.scale_max
    )
    for side in range(2):
        update_block(
            tracks.size_mean[i, side],
            tracks.size_cov[i, side],
            batch.log_size[j, side],
            sensors.size_var[s, side],
        )
    if tracks.standing[i]:
        size = math.exp(0.5 * (tracks.size_mean[i, 0, 0] + tracks.size_mean[i, 1, 0]))
        stand_still(
            tracks.mean[i],
            tracks.cov[i],
            tracks.size_mean[i],
            tracks.size_cov[i],
            settings.standing_speed_std,
            size,
        )
    tracks.hits[i] += 1
    tracks.t_update[i] = t
    tracks.used[i] |= 1 << s


@njit(cache=True)
def update_matched(
    tracks: TrackArrays,
    n: int,
    t: float,
    batch: Measurements,
    noise: FloatArray,
    match: IntArray,
    evidence: FloatArray,
    taken: IntArray,
    sensors: SensorArrays,
    settings: Settings,
    log: UpdateLog,
) -> None:
    """Take the matched detections in, sensor after sensor (equal to one stacked update); marks `taken` (M,)."""
    for i in range(n):
        for s in range(match.shape[1]):
            j = match[i, s]
            if j < 0:
                continue
            taken[j] = 1
            take(tracks, i, t, j, batch, noise[i, s] * batch.weight[j], sensors, settings, log)
            if settings.by_existence:
                tracks.existence[i] = existence_after_hit(
                    tracks.existence[i], evidence[i, s], sensors.tempering[s]
                )
            tracks.hidden[i, s] = 0.0
            p = tracks.p_detect[i, s] + settings.p_detect_weight * (1.0 - tracks.p_detect[i, s])
            tracks.p_detect[i, s] = min(p, settings.p_detect_max)


@njit(cache=True)
def take_second_views(
    tracks: TrackArrays,
    n: int,
    t: float,
    batch: Measurements,
    match: IntArray,
    taken: IntArray,
    sensors: SensorArrays,
    settings: Settings,
    log: UpdateLog,
) -> None:
    """Second pass of algorithm 1: each matched track takes the nearest gated leftover of another sensor.

    The distance is that to the track as the first detection has updated it. Entries of `match` are set.
    """
    for i in range(n):
        first = -1
        for s in range(match.shape[1]):
            if match[i, s] >= 0:
                first = s
        if first < 0:
            continue
        for s in range(match.shape[1]):
            if s == first:
                continue
            best = settings.gate
            chosen = -1
            for j in range(len(taken)):
                if taken[j] or batch.sensor[j] != s:
                    continue
                d2 = 0.0
                for axis in range(2):
                    y = batch.z[j, axis] - tracks.mean[i, axis, 0]
                    base = base_variance(
                        sensors.sigma_px[s],
                        sensors.rho[s, axis],
                        math.exp(min(tracks.size_mean[i, axis, 0], 12.0)),
                    )
                    R = tracks.scale[i, s] * base * batch.weight[j]
                    d2 += y * y / (tracks.cov[i, axis, 0, 0] + R)
                if d2 <= best:
                    best = d2
                    chosen = j
            if chosen >= 0:
                R2 = np.empty(2)
                for axis in range(2):
                    base = base_variance(
                        sensors.sigma_px[s],
                        sensors.rho[s, axis],
                        math.exp(min(tracks.size_mean[i, axis, 0], 12.0)),
                    )
                    R2[axis] = tracks.scale[i, s] * base * batch.weight[chosen]
                take(tracks, i, t, chosen, batch, R2, sensors, settings, log)
                match[i, s] = chosen
                taken[chosen] = 1


@njit(cache=True)
def count_misses(
    tracks: TrackArrays,
    n: int,
    match: IntArray,
    p_detect: FloatArray,
    present: BoolArray,
    settings: Settings,
) -> None:
    """Lower existence and P_D of the tracks that a sensor looked for and did not find."""
    if not settings.by_existence:
        return
    for i in range(n):
        for s in range(len(present)):
            if not present[s] or match[i, s] >= 0:
                continue
            tracks.existence[i] = existence_after_miss(tracks.existence[i], p_detect[i, s])
            # Only as far as the miss was to be expected does it say anything about the sensor.
            own = tracks.p_detect[i, s]
            visible = p_detect[i, s] / own
            if tracks.hidden[i, s] < 1.0:
                awake = min(p_detect[i, s] / (1.0 - tracks.hidden[i, s]), 0.999)
                tracks.hidden[i, s] = min(hidden_after_miss(tracks.hidden[i, s], awake), 0.999)
            tracks.p_detect[i, s] = max(own - settings.p_detect_weight * visible * own, settings.p_detect_min)


@njit(cache=True)
def learn_scene(
    tracks: TrackArrays,
    n: int,
    dt: float,
    batch: Measurements,
    match: IntArray,
    taken: IntArray,
    p_detect: FloatArray,
    present: BoolArray,
    scene: SceneArrays,
    sensors: SensorArrays,
    settings: Settings,
) -> None:
    """Follow each present sensor's clutter and P_D, and the vehicles that wait to be detected, in place.

    Clutter is what probably was no vehicle; P_D the share of the looks at confirmed tracks, each weighed by how
    visible the track was, that found them.
    """
    # However long nobody looked, those who arrived have left again after their time in the picture.
    expected = scene.undetected[0] + settings.arrival_rate * dt
    most = settings.arrival_rate * settings.lifetime_s
    scene.undetected[0] = max(scene.undetected[0], min(expected, most))
    if settings.scene_memory_s <= 0.0:
        return
    for s in range(len(present)):
        if not present[s]:
            continue
        false = 0.0
        looks = 0.0
        hits = 0.0
        for i in range(n):
            found = match[i, s] >= 0
            if found:
                false += 1.0 - tracks.existence[i]
            if tracks.confirmed[i]:
                visible = p_detect[i, s] / tracks.p_detect[i, s]
                looks += visible
                if found:
                    hits += visible
        for j in range(len(taken)):
            if not taken[j] and batch.sensor[j] == s:
                false += 1.0 - batch.precision[j]
        weight = min(sensors.period[s] / settings.scene_memory_s, 1.0)
        # Were the clutter to reach zero, a single detection would be proof.
        scene.clutter[s] = max(
            scene.clutter[s] + weight * (false - scene.clutter[s]), 0.1 * sensors.clutter[s]
        )
        # A few tracks say less of a sensor than many; ten count in full.
        share = scene.p_detect[s] + weight * min(0.1 * looks, 1.0) * (
            hits / max(looks, 1e-9) - scene.p_detect[s]
        )
        scene.p_detect[s] = min(max(share, settings.p_detect_min), settings.p_detect_max)


@njit(cache=True)
def confirm(tracks: TrackArrays, n: int, t: float, settings: Settings) -> None:
    """Confirm the tracks that have earned it: by existence, or by age and hits (paper, track lifecycle)."""
    for i in range(n):
        if settings.by_existence:
            earned = tracks.existence[i] >= settings.confirm_existence
        else:
            old = t - tracks.t_birth[i] >= settings.confirm_age_s
            earned = old and tracks.hits[i] >= settings.confirm_hits
        # Without a branch on purpose: compiled with one, this loop was seen to clear flags that it must not touch.
        tracks.confirmed[i] = tracks.confirmed[i] or earned
        if not settings.by_existence:
            tracks.existence[i] = 1.0 if tracks.confirmed[i] else 0.5


@njit(cache=True)
def remove_ended(tracks: TrackArrays, n: int, t: float, settings: Settings) -> int:
    """Remove tracks that are over, gone from the picture, or duplicates; keeps the order, returns the number left."""
    boxes = track_boxes(tracks.mean[:n], tracks.size_mean[:n])
    remove = np.zeros(n, dtype=np.bool_)
    if settings.merge and n > 1:
        velocity = np.empty((n, 2))
        velocity_var = np.empty((n, 2))
        for i in range(n):
            for axis in range(2):
                velocity[i, axis] = tracks.mean[i, axis, 1]
                velocity_var[i, axis] = tracks.cov[i, axis, 1, 1]
        remove = find_duplicates(
            boxes,
            velocity,
            velocity_var,
            tracks.confirmed[:n],
            settings.merge_min_overlap,
            settings.merge_velocity_gate,
        )
    rows = np.empty(n, dtype=np.int64)
    kept = 0
    for i in range(n):
        gap = t - tracks.t_update[i]
        most = settings.max_gap_confirmed_s if tracks.confirmed[i] else settings.max_gap_tentative_s
        if tracks.confirmed[i] and tracks.standing[i]:
            most = max(most, settings.standing_gap_s)
        x, y = tracks.mean[i, 0, 0], tracks.mean[i, 1, 0]
        outside = x < 0.0 or y < 0.0 or x > settings.image_width or y > settings.image_height
        doubted = settings.by_existence and tracks.existence[i] < settings.delete_existence
        # A state that overflowed (a coasting track on wild input) must not survive as NaN.
        broken = not (math.isfinite(x) and math.isfinite(y))
        if remove[i] or gap > most or doubted or broken or (settings.leave_picture and outside):
            continue
        rows[kept] = i
        kept += 1
    keep_rows(tracks, rows[:kept])
    return kept


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
            s = batch.sensor[j]
            R = np.empty(2)
            for axis in range(2):
                base = base_variance(sensors.sigma_px[s], sensors.rho[s, axis], batch.boxes[j, 2 + axis])
                R[axis] = base * batch.weight[j]
            take(tracks, i, t, j, batch, R, sensors, settings, log)
            # Two sensors' false boxes seldom coincide: each view's chance to be false remains.
            tracks.existence[i] = 1.0 - (1.0 - tracks.existence[i]) * (1.0 - batch.precision[j])
    confirm(tracks, n + len(parents), t, settings)
    return n + len(parents), next_id + len(parents)


@njit(cache=True)
def birth_existence(batch: Measurements, scene: SceneArrays, settings: Settings) -> FloatArray:
    """Probability (M,) that a detection which no track took is of a vehicle not tracked before.

    u P_D LR(score) / (u P_D LR(score) + λ): of the vehicles that have no track yet, u are expected in the scene, and
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
    """Fill row `i` with a new track at detection `j`."""
    s = batch.sensor[j]
    side = math.sqrt(batch.boxes[j, 2] * batch.boxes[j, 3])
    tracks.mean[i] = 0.0
    tracks.cov[i] = 0.0
    tracks.size_mean[i] = 0.0
    tracks.size_cov[i] = 0.0
    for axis in range(2):
        base = base_variance(sensors.sigma_px[s], sensors.rho[s, axis], batch.boxes[j, 2 + axis])
        tracks.mean[i, axis, 0] = batch.z[j, axis]
        tracks.anchor[i, axis] = batch.z[j, axis]
        tracks.anchor_var[i, axis] = base * batch.weight[j]
        tracks.cov[i, axis, 0, 0] = base * batch.weight[j]
        tracks.cov[i, axis, 1, 1] = (settings.velocity_std_px + settings.velocity_std_per_size * side) ** 2
        tracks.cov[i, axis, 2, 2] = (
            settings.acceleration_std_px + settings.acceleration_std_per_size * side
        ) ** 2
        tracks.size_mean[i, axis, 0] = batch.log_size[j, axis]
        tracks.size_cov[i, axis, 0, 0] = sensors.size_var[s, axis]
        tracks.size_cov[i, axis, 1, 1] = settings.size_rate_std**2
    tracks.anchor_t[i] = t
    tracks.still_odds[i] = 0.0
    tracks.standing[i] = False
    tracks.scale[i] = 1.0
    tracks.existence[i] = 0.5
    tracks.confirmed[i] = False
    tracks.track_id[i] = track_id
    tracks.hits[i] = 1
    tracks.t_birth[i] = t
    tracks.t_update[i] = t
    tracks.used[i] = 1 << s
    if len(log.rows) > 0:
        R = tracks.anchor_var[i]
        jerk = root_jerk(tracks.size_mean[i], settings.jerk_px, settings.jerk_per_size, 1.0)
        log_update(log, track_id, s, batch.z[j], R, jerk, batch.log_size[j], sensors.size_var[s])
        log_birth(log, tracks.cov[i], tracks.size_cov[i])
