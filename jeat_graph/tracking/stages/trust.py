"""What one instant teaches of how far each sensor is to be believed beside the others."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jeat_graph.config.kernel_form import Model, SensorArrays
from jeat_graph.data.arrays import FloatArray, RecordArray
from jeat_graph.filters.agreement import (
    high_as_often,
    score_persistence,
    score_variety,
    share_of_kind,
    trust_alone,
    trust_in,
    trust_of_best,
    trust_on_balance,
)
from jeat_graph.filters.existence import motion_visibility
from jeat_graph.filters.worth import worth_of
from jeat_graph.tracking.batch import Batch
from jeat_graph.tracking.stages.associating import Association
from jeat_graph.tracking.stages.inner import inner
from jeat_graph.tracking.stages.learning import scan_weight
from jeat_graph.tracking.stages.looking import known_fields, learns_fields, looks_at, place_of, write_looks
from jeat_graph.tracking.stages.predicting import has_looked
from jeat_graph.tracking.stages.worth import has_moved
from jeat_graph.tracking.state import SceneState, TrackArrays

# A track of so many detections has lasted; before that, others have hardly had the time to see it.
_LASTING_HITS = 4
# What is known of a sensor beforehand weighs as much as so many seconds of a track.
_PRIOR_CLAIMS = 5.0


@inner
def looks_too(other: int, s: int, t: float, scene: SceneState, model: Model) -> bool:
    """Whether a sensor is another one than `s` and has looked of late, at time `t` (s)."""
    return other != s and has_looked(other, t, scene, model)


@inner
def learn_trust(
    tracks: TrackArrays,
    n: int,
    batch: Batch,
    association: Association,
    p_detect: FloatArray,
    scene: SceneState,
    model: Model,
) -> None:
    """Follow how far each present sensor is borne out by the others, in place.

    A detection on a track that has lasted is borne out where another sensor counts as having seen that track.
    A sensor that is mostly alone where others look and see vehicles takes false things for vehicles again and
    again, unless the scores say that what it alone sees is of the same kind (`filters.agreement`). A look at
    a moment when the others are blind (their P_D is low), or at what is too slow for them or outside the part
    of the picture that they look at, counts little; while a sensor is the only one that looks, nothing is
    learnt of it; where no other ever has, what came of its tracks tells (`trust_alone`). Where none is borne
    out, the best is believed so far that vehicles live (`trust_of_best`).
    """
    lifecycle, sensors = model.settings.lifecycle, model.sensors
    for s in range(len(batch.present)):
        if batch.present[s]:
            scene.first_look[s] = min(scene.first_look[s], batch.t)
            scene.last_look[s] = batch.t
    if np.max(sensors.disagreement) <= 0.0:
        return
    fields, width = known_fields(scene, model), model.settings.image.width
    for s in range(len(batch.present)):
        # What bears others out is counted of sensors too that are always believed.
        if not batch.present[s]:
            continue
        sight, best = np.zeros(len(batch.present)), 0.0
        for other in range(len(sight)):
            if looks_too(other, s, batch.t, scene, model):
                sight[other] = scene.p_detect[other] * (1.0 - scene.blind[other])
                best = max(best, scene.borne_out[other])
        if np.max(sight) == 0.0:
            if lifecycle.judges_worth and _is_alone(s, scene):
                trust = trust_alone(scene.vain[s], lifecycle.usual_vain, sensors.prior_trust[s])
                _weigh_looks(tracks, n, association, p_detect, s, scene, model)
                scene.borne_out[s] = trust
                scene.trust[s] = trust_on_balance(trust, scene.gained[s], scene.lost[s])
            continue
        _forget(s, math.exp(-sensors.period_s[s] / lifecycle.disagreement_memory_s), scene)
        for i in range(n):
            j = association.match[i, s]
            if j >= 0 and tracks.hits[i] >= _LASTING_HITS:
                # Detections of one track are no independent witnesses: a second of them is one.
                weight = (
                    sharpest_sight(tracks, i, sight, sensors, scene.field, fields, width)
                    * sensors.period_s[s]
                )
                if weight <= 0.0:
                    continue
                before = (tracks.hits[i] * tracks.score_odds[i] - batch.score_odds[j]) / (tracks.hits[i] - 1)
                place = place_of(tracks.mean[i, 0, 0], width, scene.claims.shape[1])
                moved = has_moved(tracks, i)
                _claim(s, place, tracks.seen_by[i], before, batch.score_odds[j], weight, moved, scene)
        known = _in_sight(s, batch.t, fields, scene, model)
        lonely = known.all - known.agreed
        kind = share_of_kind(
            high_as_often(known.lonely_high, lonely, known.agreed_high, known.agreed),
            score_persistence(known.score_kept, known.score_spread),
            score_variety(known.score_square, known.all),
            worth_of(scene.worth_mean[s], scene.agreed_odds[s]),
        )
        scene.borne_out[s] = trust_in(
            known.agreed + lonely * kind * (1.0 - _others_agreement(s, scene)),
            known.all,
            lifecycle.agreement_prior,
            _PRIOR_CLAIMS,
            sensors.disagreement[s],
        )
        _weigh_looks(tracks, n, association, p_detect, s, scene, model)
        unknown, borne_out = sensors.prior_trust[s], scene.borne_out[s]
        best = max(best, borne_out)
        scene.trust[s] = trust_of_best(borne_out, best, unknown, scene.gained[s], scene.lost[s])


@inner
def _weigh_looks(
    tracks: TrackArrays,
    n: int,
    association: Association,
    p_detect: FloatArray,
    s: int,
    scene: SceneState,
    model: Model,
) -> None:
    """Follow what hits and misses of sensor `s` say for and against its confirmed tracks, in place."""
    gained, lost = 0.0, 0.0
    for i in range(n):
        if not tracks.confirmed[i]:
            continue
        if association.match[i, s] >= 0:
            gained += tracks.existence[i] * max(association.evidence[i, s], 0.0)
        else:
            lost -= tracks.existence[i] * math.log(1.0 - p_detect[i, s])
    weight = scan_weight(s, model)
    scene.gained[s] += weight * (model.sensors.tempering[s] * gained - scene.gained[s])
    scene.lost[s] += weight * (lost - scene.lost[s])


@inner
def _is_alone(s: int, scene: SceneState) -> bool:
    """Whether no other sensor than `s` has ever looked."""
    for other in range(len(scene.first_look)):
        if other != s and scene.first_look[other] < np.inf:
            return False
    return True


@inner
def sharpest_sight(
    tracks: TrackArrays,
    i: int,
    sight: FloatArray,
    sensors: SensorArrays,
    field: FloatArray,
    known: FloatArray,
    width: float,
) -> float:
    """Return the greatest probability with which one of `sight` (S,) would see something like track `i`."""
    most = 0.0
    for other in range(len(sight)):
        if sight[other] > most:
            seen = motion_visibility(tracks.mean[i, :, 1], sensors.blind_speed[other])
            here = looks_at(tracks.mean[i, 0, 0], field[other], known[other], width)
            most = max(most, sight[other] * seen * here)
    return most


class Claims(NamedTuple):
    """Sums of `CLAIMS` over the places where another sensor looks."""

    all: float
    agreed: float
    agreed_high: float
    lonely_high: float
    score_kept: float
    score_spread: float
    score_square: float


@inner
def _in_sight(s: int, t: float, fields: FloatArray, scene: SceneState, model: Model) -> Claims:
    """Sum the claims of sensor `s` at time `t` (s) over the places where another sensor looks.

    Where the others look is known better with time, and claims of before count by what is known now.
    """
    if not learns_fields(scene):
        return _sum_of(scene.claims[s], np.ones(1))
    chance = np.zeros(scene.claims.shape[1])
    for other in range(len(scene.trust)):
        if looks_too(other, s, t, scene, model):
            write_looks(scene.field[other], fields[other], model.settings.image.width, chance)
    return _sum_of(scene.claims[s], chance)


@inner
def _sum_of(claims: RecordArray, weights: FloatArray) -> Claims:
    """Sum claims (G,), weighted (G,)."""
    every, agreed, agreed_high, lonely_high, kept, spread, square = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for g in range(len(claims)):
        here, w = claims[g], weights[g]
        every += w * here["all"]
        agreed += w * here["agreed"]
        agreed_high += w * here["agreed_high"]
        lonely_high += w * here["lonely_high"]
        kept += w * here["score_kept"]
        spread += w * here["score_spread"]
        square += w * here["score_square"]
    return Claims(every, agreed, agreed_high, lonely_high, kept, spread, square)


@inner
def _forget(s: int, kept: float, scene: SceneState) -> None:
    """Let what is known of sensor `s` age, in place."""
    scene.agreed_seen[s] *= kept
    scene.agreed_without[s] *= kept
    for g in range(scene.claims.shape[1]):
        known = scene.claims[s, g]
        known["all"] *= kept
        known["agreed"] *= kept
        known["agreed_high"] *= kept
        known["lonely_high"] *= kept
        known["score_kept"] *= kept
        known["score_spread"] *= kept
        known["score_square"] *= kept


@inner
def _claim(
    s: int,
    place: int,
    seen_by: int,
    before: float,
    odds: float,
    weight: float,
    moved: bool,
    scene: SceneState,
) -> None:
    """Count one detection of sensor `s` on a track that has lasted, in place.

    What stays at its place is never taken for a vehicle for its scores' sake: a bush keeps its score too.

    Args:
        s: the sensor.
        place: where the track is (`place_of`).
        seen_by: bit o is set where sensor o counts as having seen the track.
        before: mean log odds of the track's scores before.
        odds: log odds of this score.
        weight: of the claim (s).
        moved: whether the track has left the place where it began.
        scene: what is learnt.
    """
    others = seen_by & ~(1 << s)
    known = scene.claims[s, place]
    known["all"] += weight
    if others:
        known["agreed"] += weight
        scene.agreed_seen[s] += weight
        scene.agreed_odds[s] += weight / scene.agreed_seen[s] * (odds - scene.agreed_odds[s])
    usual = scene.agreed_odds[s]
    high = weight if moved and odds > usual else 0.0
    if others:
        known["agreed_high"] += high
        for o in range(len(scene.trust)):
            if others & ~(1 << o):
                scene.agreed_without[s, o] += weight
    else:
        known["lonely_high"] += high
    deviation, now = before - usual, odds - usual
    known["score_spread"] += weight * deviation * deviation
    known["score_square"] += weight * now * now
    known["score_kept"] += weight * deviation * now


@inner
def _others_agreement(s: int, scene: SceneState) -> float:
    """Return the greatest share of another sensor's claims that sensors besides the two bear out.

    Without a third sensor it is none.
    """
    most = 0.0
    for o in range(len(scene.trust)):
        if o != s:
            claimed = 0.0
            for part in scene.claims[o]["all"]:  # one by one, as without the compiler
                claimed += part
            most = max(most, scene.agreed_without[o, s] / (claimed + _PRIOR_CLAIMS))
    return most
