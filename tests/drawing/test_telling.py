"""Report and comparison open on a vehicle that moves, not on a parked car that is seen longest."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from jeat_graph.data.trajectories import Trajectories
from jeat_graph.drawing.comparison import informative_tracks
from jeat_graph.drawing.page.summary import most_informative
from jeat_graph.runs.recorded import RunData


def table(**tracks: tuple[int, float]) -> Trajectories:
    """Tracks by number: rows and px/s to the right."""
    parts = []
    for name, (rows, speed) in tracks.items():
        t = np.arange(rows) * 0.05
        mean = np.zeros((rows, 6))
        mean[:, 0] = 100.0 + speed * t
        parts.append(
            Trajectories(
                t=t,
                track_id=np.full(rows, int(name[1:]), dtype=np.int64),
                boxes=np.tile([90.0, 90.0, 20.0, 20.0], (rows, 1)),
                existence=np.ones(rows),
                mean=mean,
                var=np.ones((rows, 6)),
                used=np.ones(rows, dtype=np.int64),
                sensors=("rgb",),
            )
        )
    return Trajectories.concatenate(parts)


def test_the_page_opens_on_the_track_that_goes_furthest():
    found = table(t1=(400, 0.0), t2=(100, 60.0), t3=(60, 40.0))
    data = RunData(name="run", record={}, causal=found, smoothed=None, diagnostics=None)
    assert most_informative(data, [1, 2, 3]) == 2
    assert most_informative(data, [1, 3]) == 3


def test_the_comparison_draws_well_observed_tracks_that_go_far():
    found = table(t1=(400, 0.0), t2=(100, 60.0), t3=(120, 40.0), t4=(5, 900.0), t5=(110, 50.0))
    truth = np.stack([found.mean[:, [0, 2, 4]], found.mean[:, [1, 3, 5]]], axis=1)
    samples = SimpleNamespace(track_id=found.track_id, truth=truth)
    assert informative_tracks(samples).tolist() == [5, 3, 1]
