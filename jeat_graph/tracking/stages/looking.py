"""Where each sensor looks: what one instant teaches of it, and what that says of a place."""

from __future__ import annotations

import numpy as np

from jeat_graph.config.kernel_form import Model
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.field_of_view import extend_field, in_field
from jeat_graph.tracking.batch import Batch
from jeat_graph.tracking.stages.inner import inlined, inner
from jeat_graph.tracking.state import SceneState, TrackArrays

# A track of fewer detections may be a false thing that came twice.
_LEAST_HITS = 4


@inner
def learns_fields(scene: SceneState) -> bool:
    """Whether the sensors may look at different parts of the picture: then claims are kept by strip."""
    return bool(scene.claims.shape[1] > 1)


@inlined
def extend_fields(batch: Batch, scene: SceneState) -> None:
    """Let each sensor's field reach as far as its boxes do, in place.

    Called before these boxes are associated: where a sensor finds something for the first time, it looks.
    """
    if learns_fields(scene):
        for j in range(len(batch.sensor)):
            extend_field(batch.boxes[j], scene.field[batch.sensor[j]])


@inlined
def count_witnesses(tracks: TrackArrays, n: int, match: IntArray, scene: SceneState) -> None:
    """Count by how many vehicles each sensor has shown where it looks, in place.

    The more of a track is known, the less does one more box of it say: the k-th counts 1 / k.

    Args:
        tracks: the state, after the update,
        n: number of those that were asked.
        match: (n, S) detection that each took of each sensor, or -1.
        scene: what is learnt.
    """
    if not learns_fields(scene):
        return
    for i in range(n):
        if tracks.hits[i] >= _LEAST_HITS:
            for s in range(match.shape[1]):
                if match[i, s] >= 0:
                    scene.field_witnesses[s] += 1.0 / tracks.hits[i]


@inner
def known_fields(scene: SceneState, model: Model) -> FloatArray:
    """By how many independent boxes (S,) each sensor's field is known; 0: few vehicles do not tell."""
    lifecycle = model.settings.lifecycle
    if not learns_fields(scene):
        return np.zeros(len(scene.field_witnesses))
    return np.maximum(lifecycle.field_boxes * (scene.field_witnesses - lifecycle.field_doubt), 0.0)


@inner
def looks_at(x: float, field: FloatArray, known: float, width: float) -> float:
    """Probability that a sensor looks at a place.

    Of a vehicle that the picture's edge cuts the centre may lie outside: what counts is where it shows.
    Neither the scene nor the model is passed: their many arrays would cost more than the answer, and this is
    asked of every track and sensor.

    Args:
        x: of the place (px).
        field: (2,) how far the sensor's boxes reach (px).
        known: by how many boxes that is known.
        width: of the picture (px).
    """
    if known <= 0.0:
        return 1.0
    return float(in_field(min(max(x, 0.0), width), field[0], field[1], known))


@inner
def place_of(x: float, width: float, strips: int) -> int:
    """Return in which of so many strips x (px) is, of a picture so wide (px)."""
    return min(max(int(x / width * strips), 0), strips - 1)


@inner
def write_looks(field: FloatArray, known: float, width: float, chance: FloatArray) -> None:
    """Raise, in place, the chances (G,) that somebody looks at each strip to those that one sensor does."""
    for g in range(len(chance)):
        chance[g] = max(chance[g], looks_at((g + 0.5) * width / len(chance), field, known, width))
