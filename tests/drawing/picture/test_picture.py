"""The picture of a run: which tracks stand, and that there is one even without tracks."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.trajectories import Trajectories
from jeat_graph.drawing.picture.figure import save_pictures
from jeat_graph.drawing.picture.plane import Backdrop, standing_tracks


def table_of(t, track_id, centre):
    n = len(t)
    mean = np.zeros((n, 6))
    mean[:, :2] = centre
    boxes = np.column_stack([mean[:, 0] - 20, mean[:, 1] - 15, np.full(n, 40.0), np.full(n, 30.0)])
    ones = np.ones(n)
    return Trajectories(
        t=np.asarray(t, dtype=float),
        track_id=np.asarray(track_id, dtype=np.int64),
        boxes=boxes,
        existence=ones,
        mean=mean,
        var=np.ones((n, 6)),
        used=np.ones(n, dtype=np.int64),
        sensors=("rgb",),
    )


def test_a_standing_track_is_distinguished_from_one_that_creeps():
    t = np.arange(50) * 0.1
    still = np.column_stack([np.full(50, 300.0), np.full(50, 200.0)])
    creeping = np.column_stack([300.0 + 10.0 * t, np.full(50, 400.0)])
    both = Trajectories.concatenate(
        [table_of(t, np.full(50, 1), still), table_of(t, np.full(50, 2), creeping)]
    )
    assert standing_tracks(both) == {1}


def test_a_track_too_short_to_tell_does_not_count_as_standing():
    t = np.arange(10) * 0.1
    assert standing_tracks(table_of(t, np.full(10, 1), np.full((10, 2), 50.0))) == set()


def test_a_run_without_tracks_has_a_picture_too(tmp_path):
    paths = save_pictures(Trajectories.empty(("rgb",)), Backdrop(640, 480, title="none"), tmp_path / "empty")
    assert [path.name for path in paths] == ["empty.png", "empty.svg"]
