"""One step of the tracker on arrays: predict, associate, update, end, begin (paper algorithm 1)."""

from __future__ import annotations

from numba import njit

from jeat_graph.config.kernel_form import Model
from jeat_graph.tracking.batch import Arrivals, prepare
from jeat_graph.tracking.stages.associating import associate, excuse_misfits
from jeat_graph.tracking.stages.beginning import give_birth
from jeat_graph.tracking.stages.comparing import learn_boxes
from jeat_graph.tracking.stages.ending import confirm, remove_ended
from jeat_graph.tracking.stages.gaps import learn_found, note_missed
from jeat_graph.tracking.stages.learning import count_looks, learn_scene
from jeat_graph.tracking.stages.looking import count_witnesses, extend_fields
from jeat_graph.tracking.stages.predicting import current_p_detect, expect_detections, occlusion, predict_all
from jeat_graph.tracking.stages.sight import judge_sight
from jeat_graph.tracking.stages.trust import learn_trust
from jeat_graph.tracking.stages.updating import take_second_views, update_matched
from jeat_graph.tracking.stages.worth import doubt_scores, judge_worth, learn_lasting
from jeat_graph.tracking.state import SceneState, TrackArrays
from jeat_graph.tracking.update_log import UpdateLog


@njit(cache=True)
def step(
    tracks: TrackArrays,
    num_tracks: int,
    next_id: int,
    dt: float,
    arrivals: Arrivals,
    scene: SceneState,
    model: Model,
    log: UpdateLog,
) -> tuple[int, int]:
    """Advance all tracks to the time of some detections and take these in, in place.

    Args:
        tracks: state; its capacity must be at least `num_tracks` + M.
        num_tracks: number of living tracks N.
        next_id: identity of the next track to be born.
        dt: time since the last step (s), >= 0.
        arrivals: the M detections of all scans of one instant.
        scene: running estimates of clutter, P_D and undetected vehicles; updated.
        model: sensors and settings.
        log: takes down what the tracks take in; of capacity 0 where nobody asks.

    Returns:
        The number of living tracks and the next identity.
    """
    n, settings = num_tracks, model.settings
    log.count[0] = 0
    predict_all(tracks, n, dt, scene, model)
    batch = prepare(arrivals, scene.offsets, model)
    doubt_scores(batch, scene, model)
    extend_fields(batch, scene)
    occluded = occlusion(tracks, n)
    p_found, p_detect = current_p_detect(tracks, n, batch, occluded, scene, model)
    expectation = expect_detections(tracks, n, occluded, model)
    association = associate(tracks, n, batch, expectation, p_found, scene, model)
    excuse_misfits(tracks, n, batch, association, p_detect, model)
    judge_sight(tracks, n, batch, association, p_detect, scene, model)
    learn_found(tracks, n, batch, association, scene, model)
    update_matched(tracks, batch, expectation, association, scene, model, log)
    if settings.association.second_views:
        take_second_views(tracks, n, batch, association, p_found, scene, model, log)
    learn_boxes(tracks, n, batch, association, scene, model)
    learn_lasting(tracks, n, batch, association, scene, model)
    count_witnesses(tracks, n, association.match, scene)
    learn_trust(tracks, n, batch, association, p_detect, scene, model)
    learn_scene(tracks, n, dt, batch, association, p_detect, scene, model)
    count_looks(tracks, n, batch, association, p_detect, scene, settings)
    judge_worth(tracks, n, scene, model)
    confirm(tracks, n, batch.t, settings)
    note_missed(tracks, n, batch, scene, model)
    n = remove_ended(tracks, n, batch.t, scene, model)
    n, next_id = give_birth(tracks, n, next_id, batch, association, scene, model, log)
    # Vehicles that this batch could have shown and did not are rarer from now on.
    for s in range(len(batch.present)):
        if batch.present[s]:
            sees = 1.0 - max(scene.blind[s], scene.unproven[s])
            scene.undetected[0] *= 1.0 - scene.p_detect[s] * sees
    return n, next_id
