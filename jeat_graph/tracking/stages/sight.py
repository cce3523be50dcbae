"""Whether each sensor that looked sees at all, or is blind as a whole: the common cause of its misses."""

from __future__ import annotations

from jeat_graph.config.kernel_form import Model
from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.blindness import (
    blind_after_scan,
    blind_before_scan,
    ratio_of_hit,
    ratio_of_leftover,
    ratio_of_miss,
)
from jeat_graph.tracking.batch import Batch
from jeat_graph.tracking.stages.associating import Association
from jeat_graph.tracking.stages.beginning import birth_existence
from jeat_graph.tracking.stages.inner import inlined, inner
from jeat_graph.tracking.stages.trust import looks_too
from jeat_graph.tracking.state import SceneState, TrackArrays


@inner
def others_look(s: int, t: float, scene: SceneState, model: Model) -> bool:
    """Whether another sensor than `s` has looked of late, at time `t` (s)."""
    looking = False
    for other in range(len(scene.last_look)):
        looking = looking or looks_too(other, s, t, scene, model)
    return looking


@inlined
def judge_sight(
    tracks: TrackArrays,
    n: int,
    batch: Batch,
    association: Association,
    p_detect: FloatArray,
    scene: SceneState,
    model: Model,
) -> None:
    """Follow the probability that each present sensor is blind as a whole, in place.

    What it should have found by P_D and visibility against what it found. With no track to find, and nothing
    found, the scan says nothing: an empty road and a blind sensor look alike. Misses count on tracks that
    another sensor has seen; a sensor that looks alone is taken to see, for nobody could tell. Called before
    the existence of the tracks is updated.
    """
    lifecycle = model.settings.lifecycle
    if not lifecycle.judges_sight:
        return
    match, existence, seen_by = association.match, tracks.existence, tracks.seen_by
    newcomer = birth_existence(batch, association.taken, scene, model)
    for s in range(len(batch.present)):
        if not batch.present[s]:
            continue
        others = others_look(s, batch.t, scene, model)
        missed, found = 0.0, 0.0
        for i in range(n):
            if match[i, s] >= 0:
                found += ratio_of_hit(existence[i], p_detect[i, s], association.evidence[i, s])
            # What it alone counts as having seen may as well have been nothing.
            elif seen_by[i] & ~(1 << s):
                missed += ratio_of_miss(existence[i], p_detect[i, s])
        for j in range(len(newcomer)):
            if batch.sensor[j] == s and newcomer[j] > 0.0:
                found += ratio_of_leftover(newcomer[j])
        if not others:
            scene.blind[s] = 0.0
        else:
            last = scene.blind[s] if scene.blind[s] > 0.0 else lifecycle.usual_blindness
            before = blind_before_scan(last, lifecycle.sight_scans, lifecycle.blind_scans)
            scene.blind[s] = blind_after_scan(before, missed + found)
        scene.unproven[s] = blind_after_scan(scene.unproven[s], min(found, 0.0))
