"""New tracks from the detections of one instant that no track took."""

from __future__ import annotations

import math

import numpy as np

from jeat_graph.association.births import choose_births
from jeat_graph.config.kernel_form import Model
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.cut_boxes import BOTH_CUT, WHOLE
from jeat_graph.filters.fit import exactness, take
from jeat_graph.filters.prior import write_prior, write_size_prior
from jeat_graph.tracking.batch import Batch
from jeat_graph.tracking.stages.associating import Association, shown_boxes
from jeat_graph.tracking.stages.comparing import remember_box
from jeat_graph.tracking.stages.ending import confirm, has_left
from jeat_graph.tracking.stages.inner import inner
from jeat_graph.tracking.stages.learning import scan_weight
from jeat_graph.tracking.stages.manoeuvring import start_jerk
from jeat_graph.tracking.stages.measuring import first_view, second_view
from jeat_graph.tracking.stages.predicting import jerk_of, new_velocity_var
from jeat_graph.tracking.stages.resizing import size_density_of, start_sizes
from jeat_graph.tracking.stages.updating import take_in
from jeat_graph.tracking.stages.worth import denied_by, judge_worth
from jeat_graph.tracking.state import SceneState, TrackArrays
from jeat_graph.tracking.update_log import UpdateLog, log_birth, log_updates


@inner
def give_birth(
    tracks: TrackArrays,
    n: int,
    next_id: int,
    batch: Batch,
    association: Association,
    scene: SceneState,
    model: Model,
    log: UpdateLog,
) -> tuple[int, int]:
    """Start tracks from leftovers; returns the number of tracks and the next identity."""
    settings = model.settings
    existence = birth_existence(batch, association.taken, scene, model)
    parents, partner, double = choose_births(
        batch.boxes,
        existence,
        batch.sensor,
        association.taken,
        shown_boxes(tracks, n, settings),
        denied_by(tracks, n, scene, model),
        settings.birth.min_existence,
        settings.birth.max_overlap,
    )
    for j in range(len(double)):
        # What comes to nothing on a track of nobody else's is no vehicle either.
        i, s = double[j], batch.sensor[j]
        if i >= 0 and not tracks.confirmed[i] and tracks.seen_by[i] == 1 << s:
            scene.fruitless[s] += scan_weight(s, model)
    for b in range(len(parents)):
        start_track(tracks, n + b, next_id + b, batch, parents[b], model, log)
        start_jerk(tracks, n + b, scene)
        start_sizes(tracks, n + b, scene)
        tracks.existence[n + b] = existence[parents[b]]
        tracks.p_detect[n + b] = scene.p_detect
        tracks.hidden[n + b] = settings.lifecycle.hidden_prior * scene.trust[batch.sensor[parents[b]]]
        tracks.hidden[n + b, batch.sensor[parents[b]]] = 0.0
    for j in range(len(partner)):
        if partner[j] >= 0:
            i = n + partner[j]
            view = second_view(tracks, i, batch, j, model.sensors)
            take_in(tracks, view, batch.sensor[j], batch, scene, model, log)
            remember_box(tracks, i, batch, j)
            tracks.hidden[i, batch.sensor[j]] = 0.0
            # Two sensors' false boxes seldom coincide: each view's chance to be false remains.
            tracks.existence[i] = 1.0 - (1.0 - tracks.existence[i]) * (1.0 - batch.precision[j])
    judge_worth(tracks, n + len(parents), scene, model)
    confirm(tracks, n + len(parents), batch.t, settings)
    return n + len(parents), next_id + len(parents)


@inner
def birth_existence(batch: Batch, taken: IntArray, scene: SceneState, model: Model) -> FloatArray:
    """Probability (M,) that a detection which no track took is of a vehicle not tracked before.

    u P_D LR(score) / (u P_D LR(score) + λ): u vehicles in the scene are expected to have no track yet, and
    most leftovers are clutter however high their score (Williams 2015, the Poisson part of the mixture).
    A box of nearly the whole picture says nothing of where a vehicle is: dazzled detectors of change give it.

    Args:
        batch: the M detections.
        taken: (M,) not 0 where a track takes the detection, of which nothing is said (-1).
        scene: running estimates.
        model: sensors and settings.
    """
    image, leaves = model.settings.image, model.settings.lifecycle.leave_picture
    most = model.settings.birth.max_picture_share * image.width * image.height
    z, boxes, cut, sensor, log_score = batch.z, batch.boxes, batch.cut, batch.sensor, batch.log_score
    p_detect, clutter, undetected = scene.p_detect, scene.clutter, scene.undetected[0]
    out = np.full(len(taken), -1.0)
    for j in range(len(out)):
        if taken[j]:
            continue
        if leaves and has_left(z[j, 0], z[j, 1], boxes[j], image):
            continue  # it would end in the same step
        if covers_picture(boxes[j], cut[j], most):
            continue
        true = undetected * p_detect[sensor[j]] * math.exp(log_score[j])
        out[j] = true / (true + clutter[sensor[j]])
    return out


@inner
def covers_picture(box: FloatArray, cut: IntArray, most: float) -> bool:
    """Whether a box (4,) with cuts (2,) reaches three edges of the picture and covers over `most` px²."""
    first, second = cut
    reaches = first != WHOLE and second != WHOLE and (first == BOTH_CUT or second == BOTH_CUT)
    return bool(reaches and box[2] * box[3] > most)


@inner
def start_track(
    tracks: TrackArrays,
    i: int,
    track_id: int,
    batch: Batch,
    j: int,
    model: Model,
    log: UpdateLog,
) -> None:
    """Fill row `i` with a new track at detection `j`; `give_birth` adds what the scene says of it."""
    sensors, motion, t = model.sensors, model.settings.motion, batch.t
    s = batch.sensor[j]
    side = math.sqrt(batch.boxes[j, 2] * batch.boxes[j, 3])
    acceleration_std = motion.acceleration_std_px + motion.acceleration_std_per_size * side
    # A product, not a power, as in `new_velocity_var`.
    velocity_var = np.full(2, new_velocity_var(side, model.settings))
    acceleration_var = np.full(2, acceleration_std * acceleration_std)
    rate_var = model.settings.size.rate_std * model.settings.size.rate_std
    view = first_view(batch, i, j, sensors)
    z, white, coloured_std, error = view.z[0], view.white[0], view.coloured_std[0], sensors.error[s]
    mean, cov = tracks.mean[i], tracks.cov[i]
    write_prior(z, white, coloured_std, error, velocity_var, acceleration_var, mean, cov)
    size_mean, size_cov = tracks.size_mean[i], tracks.size_cov[i]
    write_size_prior(view.log_size[0], view.log_size_var[0], rate_var, size_mean, size_cov)
    for axis in range(2):
        tracks.cut[i, axis] = batch.cut[j, axis]
        tracks.rest_point[i, axis] = z[axis]
        tracks.rest_var[i, axis] = white[axis] + coloured_std[axis] * coloured_std[axis]
    tracks.rest_since[i] = t
    tracks.standing_log_odds[i] = 0.0
    tracks.standing[i] = False
    tracks.scale[i] = 1.0
    tracks.confirmed[i] = False
    tracks.track_id[i] = track_id
    tracks.hits[i] = 1
    tracks.score_odds[i] = batch.score_odds[j]
    tracks.lasting[i] = False
    tracks.worth[i] = 1.0
    tracks.worthy[i] = True
    tracks.fit[i] = 0.0
    noise_of = view.noise[0], view.coloured_std[0], batch.spread[j]
    take(tracks.fit[i], batch.fit[j], exactness(view.log_size[0], *noise_of))
    tracks.t_birth[i] = t
    tracks.born_at[i] = z
    tracks.t_missed[i] = -np.inf
    tracks.last_box[i] = -np.inf
    tracks.seen_apart[i] = -np.inf
    remember_box(tracks, i, batch, j)
    tracks.t_update[i] = t
    tracks.used[i] = 1 << s
    tracks.seen_by[i] = 1 << s
    tracks.witness[i] = 0.0
    tracks.jerk_factor[i] = 1.0
    tracks.size_factor[i] = 1.0
    if len(log.rows) > 0:
        jerk = jerk_of(tracks, view.track, model.settings)
        size_density = size_density_of(tracks, view.track, model.settings)
        log_updates(log, tracks.track_id, jerk, size_density, batch, view, sensors)
        log_birth(log, velocity_var, acceleration_var, rate_var)
