"""A copy of all that a tracker's next step depends on, so that it can go back there."""

from __future__ import annotations

from typing import NamedTuple

from jeat_graph.data.arrays import IntArray
from jeat_graph.tracking.appearance import Looks
from jeat_graph.tracking.classes import ClassTally
from jeat_graph.tracking.state import SceneState, TrackArrays


class Snapshot(NamedTuple):
    """The causal state of a tracker at one moment: its own arrays, N rows.

    Attributes:
        t: time of the last step (s), or None before the first.
        next_id: identity of the next track to be born.
        tracks: the N living tracks.
        scene: what is learnt of the scene.
        classes: votes on the tracks' classes, or None before the first.
        looks: what the tracks look like, or None before the first embedding.
    """

    t: float | None
    next_id: int
    tracks: TrackArrays
    scene: SceneState
    classes: ClassTally | None = None
    looks: Looks | None = None

    @staticmethod
    def of(
        t: float | None, next_id: int, tracks: TrackArrays, num_tracks: int, scene: SceneState
    ) -> Snapshot:
        """Copy the first `num_tracks` rows, and the scene."""
        return Snapshot(
            t,
            next_id,
            TrackArrays._make(array[:num_tracks].copy() for array in tracks),
            SceneState._make(array.copy() for array in scene),
        )

    @property
    def num_tracks(self) -> int:
        """Number of living tracks N."""
        return len(self.tracks.track_id)

    def living(self) -> tuple[IntArray, int]:
        """Return the identities (N,) of the living tracks, and that of the next one to be born."""
        return self.tracks.track_id, self.next_id

    def copy_to(self, tracks: TrackArrays, scene: SceneState) -> None:
        """Write the copy into arrays of at least N rows, and into a scene."""
        for source, target in zip(self.tracks, tracks, strict=True):
            target[: len(source)] = source
        for learnt, known in zip(self.scene, scene, strict=True):
            known[:] = learnt
