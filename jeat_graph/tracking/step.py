"""One step of the tracker on arrays: predict, associate, update, end, begin (paper algorithm 1)."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.config.kernel_form import SensorArrays, Settings
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.tracking.batch import prepare
from jeat_graph.tracking.stages.associating import associate
from jeat_graph.tracking.stages.beginning import give_birth
from jeat_graph.tracking.stages.ending import confirm, remove_ended
from jeat_graph.tracking.stages.learning import count_misses, learn_scene
from jeat_graph.tracking.stages.predicting import current_p_detect, expect_detections, predict_all
from jeat_graph.tracking.stages.updating import take_second_views, update_matched
from jeat_graph.tracking.state import SceneArrays, TrackArrays
from jeat_graph.tracking.update_log import UpdateLog


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
    predict_all(tracks, n, dt, sensors, settings)
    batch = prepare(boxes, scores, sensor, sensors, settings)
    p_detect = current_p_detect(tracks, n, present, sensors, settings)
    expectation = expect_detections(tracks, n, sensors)
    match, evidence = associate(tracks, n, batch, expectation, p_detect, scene, sensors, settings, priority)
    taken = np.zeros(len(scores), dtype=np.int64)
    update_matched(tracks, n, t, batch, expectation, match, evidence, taken, sensors, settings, log)
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
