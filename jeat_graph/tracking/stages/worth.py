"""What the tracks are worth that one sensor alone has seen, by what became of others with such scores."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.config.kernel_form import Model, Settings
from jeat_graph.data.arrays import BoolArray
from jeat_graph.filters.running_mean import take_into_mean
from jeat_graph.filters.sides import mean_side
from jeat_graph.filters.worth import doubt_worth, learn_worth, worth_of
from jeat_graph.tracking.batch import LEAST_PRECISION, Batch
from jeat_graph.tracking.stages.associating import Association
from jeat_graph.tracking.stages.inner import inlined, inner
from jeat_graph.tracking.state import SceneState, TrackArrays

# Fewer detections have not lasted, however far they lie apart.
_LEAST_HITS = 5
_ROUNDING_S = 1e-9
# A track so far from its first detection, as a share of its size, has left the place: five times the error
# of a usual detector.
_MOVED = 0.25
# A sensor that finds so many of the vehicles finds what stands, too.
_MOST = 0.8
_LEAST_ODDS = math.log(LEAST_PRECISION / (1.0 - LEAST_PRECISION))


@inlined
def has_gone(tracks: TrackArrays, i: int, share: float) -> bool:
    """Whether track `i` is further from where it began than a share of its size."""
    least = share * mean_side(tracks.size_mean[i])
    x, y = tracks.mean[i, 0, 0] - tracks.born_at[i, 0], tracks.mean[i, 1, 0] - tracks.born_at[i, 1]
    return bool(x * x + y * y > least * least)


@inlined
def has_moved(tracks: TrackArrays, i: int) -> bool:
    """Whether track `i` has left the place where it began."""
    return has_gone(tracks, i, _MOVED)


@inlined
def seen_standing(tracks: TrackArrays, i: int, model: Model) -> bool:
    """Whether a sensor that finds what stands has seen track `i`."""
    for s in range(len(model.sensors.blind_speed)):
        if tracks.seen_by[i] >> s & 1 and model.sensors.blind_speed[s] <= 0.0:
            return True
    return False


@inner
def sees_what_stands(s: int, scene: SceneState, model: Model) -> bool:
    """Whether sensor `s` looks, and finds nearly all vehicles, those too that stand."""
    if model.sensors.blind_speed[s] > 0.0 or scene.first_look[s] == np.inf:
        return False
    return bool(scene.p_detect[s] * scene.trust[s] * (1.0 - scene.blind[s]) >= _MOST)


@inner
def denied_by(tracks: TrackArrays, n: int, scene: SceneState, model: Model) -> BoolArray:
    """Say which of the first `n` tracks a sensor has looked for in vain (N, S).

    Only of a sensor that finds nearly all, and only against what sensors that are blind to what stands have
    seen alone: these outline a vehicle badly that another sees well, and the other's box must not be refused
    for it.
    """
    num_sensors, least = len(scene.first_look), model.settings.lifecycle.witness_odds
    denied = np.zeros((n, num_sensors), dtype=np.bool_)
    if least <= 0.0 or np.max(model.sensors.blind_speed) <= 0.0:
        return denied
    for s in range(num_sensors):
        if sees_what_stands(s, scene, model):
            for i in range(n):
                denied[i, s] = tracks.witness[i, s] <= -least and not seen_standing(tracks, i, model)
    return denied


@inner
def asks_for_motion(scene: SceneState, model: Model) -> bool:
    """Whether a sensor looks that finds what stands, so that others need not be believed of it."""
    asks = False
    if model.settings.lifecycle.least_move > 0.0:
        for s in range(len(scene.first_look)):
            asks = asks or sees_what_stands(s, scene, model)
    return asks


@inlined
def shows_motion(tracks: TrackArrays, i: int, model: Model) -> bool:
    """Whether track `i` may be a vehicle by how it moves, for those who saw it.

    A sensor that is blind to what stands still cannot have found a vehicle at one place again and again:
    what it alone finds there is a lamp that flickers, or leaves. So what only such sensors have seen has to
    leave the place where it began, by `lifecycle.least_move` of its size.
    """
    return seen_standing(tracks, i, model) or has_gone(tracks, i, model.settings.lifecycle.least_move)


@inner
def only_sensor(seen_by: int, num_sensors: int) -> int:
    """Return the one sensor that has seen a track, or -1 where there are several."""
    for s in range(num_sensors):
        if seen_by == 1 << s:
            return s
    return -1


@inlined
def weigh_witness(tracks: TrackArrays, i: int, s: int, evidence: float, settings: Settings) -> None:
    """Follow how far sensor `s` bears out that track `i` is a vehicle, in place.

    What one sensor takes for a vehicle again and again is soon taken in by a false box of another, by chance,
    and then it would be a thing that two have seen, for as long as it lasts. To be hidden from the other
    excuses a few misses, and no hundred. The detection that began the track is not counted.

    Args:
        tracks: state.
        i: the track.
        s: the sensor.
        evidence: ln of how much more likely this detection or miss is if the track is a vehicle in sight.
        settings: with `lifecycle.witness_odds`, by how much misses must speak against it.
    """
    least = settings.lifecycle.witness_odds
    if least > 0.0:
        tracks.witness[i, s] = max(tracks.witness[i, s] + evidence, -least)
        others = tracks.seen_by[i] & ~(1 << s)
        if evidence < 0.0 and tracks.witness[i, s] <= -least and others != 0:
            tracks.seen_by[i] = others


@inlined
def learn_lasting(
    tracks: TrackArrays, n: int, batch: Batch, association: Association, scene: SceneState, model: Model
) -> None:
    """Learn from the tracks that last what the scores of the present sensors are worth, in place.

    `learn_ended` says the rest. What stays at its place says nothing: false things that come back do so at
    one place. A track's detections of before it had lasted count when it has. Each detection weighs as much
    as the time between two scans, in seconds: those of one track are no independent witnesses.
    """
    lifecycle = model.settings.lifecycle
    if not lifecycle.judges_worth:
        return
    for s in range(len(batch.present)):
        if batch.present[s]:
            step = model.sensors.period_s[s] / lifecycle.worth_memory_s
            doubt_worth(scene.worth_cov[s], lifecycle.worth_std * lifecycle.worth_std, step)
    for i in range(n):
        old = batch.t - tracks.t_birth[i] >= lifecycle.lasting_s - _ROUNDING_S
        for s in range(len(batch.present)):
            j = association.match[i, s]
            if j < 0:
                continue
            mean, cov, weight = scene.worth_mean[s], scene.worth_cov[s], model.sensors.period_s[s]
            if not has_moved(tracks, i):
                continue
            if tracks.lasting[i]:
                learn_worth(mean, cov, batch.score_odds[j], True, weight)
                memory_s = lifecycle.worth_memory_s
                take_into_mean(scene.vain, scene.vain_seen, s, 0.0, weight, memory_s)
                take_into_mean(
                    scene.lasting_odds, scene.lasting_seen, s, batch.score_odds[j], weight, memory_s
                )
            elif old and tracks.hits[i] >= _LEAST_HITS:
                tracks.lasting[i] = True
                if tracks.seen_by[i] == 1 << s:
                    learn_worth(mean, cov, tracks.score_odds[i], True, weight * tracks.hits[i])


@inner
def learn_ended(tracks: TrackArrays, i: int, scene: SceneState, model: Model) -> None:
    """Learn from track `i`, which ends and was seen by one sensor alone, unless it has lasted; in place.

    What ends before anything can have lasted says nothing.
    """
    lifecycle = model.settings.lifecycle
    s = only_sensor(tracks.seen_by[i], len(scene.first_look))
    if not lifecycle.judges_worth or s < 0 or tracks.lasting[i]:
        return
    if tracks.t_update[i] >= scene.first_look[s] + lifecycle.lasting_s:
        weight = model.sensors.period_s[s] * tracks.hits[i]
        learn_worth(scene.worth_mean[s], scene.worth_cov[s], tracks.score_odds[i], False, weight)
        # What stood there for longer may be a vehicle that stands: it counts neither way.
        if tracks.t_update[i] - tracks.t_birth[i] < lifecycle.lasting_s:
            again = weight - model.sensors.period_s[s]
            take_into_mean(scene.vain, scene.vain_seen, s, 1.0, again, lifecycle.worth_memory_s)


@inlined
def doubt_scores(batch: Batch, scene: SceneState, model: Model) -> None:
    """Believe no score of a batch more than what lasts has borne out so far, in place."""
    if not model.settings.lifecycle.judges_worth:
        return
    overall = np.empty(len(batch.present))
    for s in range(len(overall)):
        overall[s] = math.log(model.sensors.precision[s] / (1.0 - model.sensors.precision[s]))
    for j in range(len(batch.precision)):
        s = batch.sensor[j]
        mean = scene.worth_mean[s]
        # Log odds of the worth, and so of a precision, compared as `log_score_ratio` has them.
        odds = max(mean[0] + mean[1] * batch.score_odds[j], _LEAST_ODDS)
        if odds - overall[s] < batch.log_score[j]:
            batch.precision[j] = 1.0 / (1.0 + math.exp(-odds))
            batch.log_score[j] = odds - overall[s]


@njit(cache=True)
def judge_worth(tracks: TrackArrays, n: int, scene: SceneState, model: Model) -> None:
    """Say of each of the first `n` tracks, in place, what it is worth: always enough if two see it.

    What is worth nearly as much as the usual box of what lasts is as good as this sensor's scores can tell.
    """
    lifecycle, asks = model.settings.lifecycle, asks_for_motion(scene, model)
    if not lifecycle.judges_worth:
        for i in range(n):
            tracks.worthy[i] = not asks or shows_motion(tracks, i, model)
        return
    least = np.empty(len(scene.first_look))
    for s in range(len(least)):
        usual = worth_of(scene.worth_mean[s], scene.lasting_odds[s])
        least[s] = min(lifecycle.min_worth, lifecycle.worth_of_usual * usual)
    for i in range(n):
        s = only_sensor(tracks.seen_by[i], len(scene.first_look))
        # No branch that writes a flag, as in `confirm`.
        worth = worth_of(scene.worth_mean[s], tracks.score_odds[i])
        tracks.worth[i] = 1.0 if s < 0 else worth
        tracks.worthy[i] = (s < 0 or worth >= least[s]) and (not asks or shows_motion(tracks, i, model))
