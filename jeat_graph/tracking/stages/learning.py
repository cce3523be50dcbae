"""What one instant teaches of each track a sensor looked for, and of clutter and detection as a whole."""

from __future__ import annotations

import math

from jeat_graph.config.kernel_form import Model, Settings
from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.existence import existence_after_miss, hidden_after_miss
from jeat_graph.tracking.batch import Batch
from jeat_graph.tracking.stages.associating import Association
from jeat_graph.tracking.stages.inner import inlined, inner
from jeat_graph.tracking.stages.worth import weigh_witness
from jeat_graph.tracking.state import SceneState, TrackArrays

# Share of a sensor's configured clutter below which no estimate goes: without any, one detection were proof.
_LEAST_CLUTTER = 0.1
# What a sensor's scores say of its false boxes holds until so many times its configured clutter have been
# seen to come to nothing: then the scores are wrong, and what has been seen counts.
_GROSS = 10.0
# A few tracks say less of a sensor than many; ten count in full.
_LOOK_WEIGHT = 0.1
# What is assumed of a sensor's P_D weighs as much as so many scans full of tracks.
_PRIOR_SCANS = 10.0
# However many misses, a vehicle is never certain to be hidden: then no later one could say that it is gone.
_MOST_HIDDEN = 0.999
# Of a sensor whose scans are further apart than this (s), each counts for less than the time it stands for.
_CLOSE_S = 0.2


@inner
def scan_weight(s: int, model: Model) -> float:
    """Weight of one scan of sensor `s` in what is learnt of the scene; 0 where nothing is.

    It is the time between two scans over the memory, and less where scans are seldom: the further vehicles
    move between two of them, the more of them have no track yet, and count as clutter. A memory of a few such
    scans raises the clutter at once, then no track begins, and all that is found is clutter for good. So the
    memory grows with the time T between two scans, as T^5/2, the way the spread of a random jerk does.
    """
    memory_s, period_s = model.settings.lifecycle.scene_memory_s, model.sensors.period_s[s]
    if memory_s <= 0.0:
        return 0.0
    weight = min(period_s / memory_s, 1.0)
    close = _CLOSE_S / period_s
    less: float = weight * close * close * math.sqrt(close)
    return less if close < 1.0 else weight


@inlined
def count_looks(
    tracks: TrackArrays,
    n: int,
    batch: Batch,
    association: Association,
    p_detect: FloatArray,
    scene: SceneState,
    settings: Settings,
) -> None:
    """Follow each track's P_D, and whether it is hidden, by who has found it; a miss lowers its existence.

    Called after `learn_scene`, which weighs the looks by the P_D of before them.
    """
    lifecycle = settings.lifecycle
    match, present = association.match, batch.present
    for i in range(n):
        for s in range(len(present)):
            if not present[s]:
                continue
            own = tracks.p_detect[i, s]
            if match[i, s] >= 0:
                tracks.hidden[i, s] = 0.0
                weigh_witness(tracks, i, s, max(association.evidence[i, s], 0.0), settings)
                more = own + lifecycle.p_detect_weight * (1.0 - own)
                tracks.p_detect[i, s] = min(more, lifecycle.p_detect_max)
                continue
            if not lifecycle.by_existence:
                continue
            tracks.existence[i] = existence_after_miss(tracks.existence[i], p_detect[i, s], scene.blind[s])
            # Only as far as the miss was to be expected does it say anything about the sensor.
            sees = 1.0 - scene.blind[s]
            visible = p_detect[i, s] / own * sees
            if tracks.hidden[i, s] < 1.0:
                awake = min(p_detect[i, s] / (1.0 - tracks.hidden[i, s]), _MOST_HIDDEN)
                # By what the sensor usually finds: its own P_D of this track falls with the misses.
                found = scene.p_detect[s] * min(awake / own, 1.0) * sees
                weigh_witness(tracks, i, s, math.log(1.0 - found), settings)
                hidden = min(hidden_after_miss(tracks.hidden[i, s], awake), _MOST_HIDDEN)
                tracks.hidden[i, s] += sees * (hidden - tracks.hidden[i, s])
            less = own - lifecycle.p_detect_weight * visible * own
            tracks.p_detect[i, s] = max(less, lifecycle.p_detect_min)


@inner
def learn_scene(
    tracks: TrackArrays,
    n: int,
    dt: float,
    batch: Batch,
    association: Association,
    p_detect: FloatArray,
    scene: SceneState,
    model: Model,
) -> None:
    """Follow each present sensor's clutter and P_D, and the vehicles that wait to be detected, in place.

    Clutter is what probably was no vehicle; P_D the share of the looks at confirmed tracks that found them,
    each weighed by how visible the track was. A sensor that delivers rubbish with good scores is known by
    its tracks, which come to nothing.
    """
    sensors, settings = model.sensors, model.settings
    lifecycle, present = settings.lifecycle, batch.present
    match, taken = association.match, association.taken
    # However long nobody looked, those who arrived have left again after their time in the picture.
    expected = scene.undetected[0] + settings.birth.arrival_rate_hz * dt
    most = settings.birth.arrival_rate_hz * lifecycle.lifetime_s
    scene.undetected[0] = max(scene.undetected[0], min(expected, most))
    if lifecycle.scene_memory_s <= 0.0:
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
        weight = scan_weight(s, model)
        least = _LEAST_CLUTTER * sensors.clutter_per_scan[s]
        scene.clutter[s] = max(scene.clutter[s] + weight * (false - scene.clutter[s]), least)
        scene.fruitless[s] *= 1.0 - weight
        if scene.fruitless[s] > _GROSS * sensors.clutter_per_scan[s]:
            scene.clutter[s] = max(scene.clutter[s], scene.fruitless[s])
        # At first a mean of all looks, of which what is assumed beforehand makes some; then one with memory.
        # What a blind one does not find says nothing of how well it sees.
        full = min(_LOOK_WEIGHT * looks, 1.0) * (1.0 - scene.blind[s])
        scene.looked[s] += full
        share = scene.p_detect[s] + full * max(weight, 1.0 / (_PRIOR_SCANS + scene.looked[s])) * (
            hits / max(looks, 1e-9) - scene.p_detect[s]
        )
        scene.p_detect[s] = min(max(share, lifecycle.p_detect_min), lifecycle.p_detect_max)
