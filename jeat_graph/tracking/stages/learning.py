"""What a batch teaches of single tracks that it missed, and of the scene as a whole."""

from __future__ import annotations

from numba import njit

from jeat_graph.config.kernel_form import SensorArrays, Settings
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.filters.existence import existence_after_miss, hidden_after_miss
from jeat_graph.tracking.batch import Measurements
from jeat_graph.tracking.state import SceneArrays, TrackArrays


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

    Clutter is what probably was no vehicle; P_D the share of the looks at confirmed tracks that found them,
    each weighed by how visible the track was.
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
