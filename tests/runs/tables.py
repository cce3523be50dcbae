"""A track whose motion is known in closed form, as a table."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.trajectories import Trajectories

SPEED = 100.0
SIZE = (40.0, 20.0)


def uniform_motion(t, track_id=1) -> Trajectories:
    """One track whose box centre is at (100 t, 50) px, exactly known, at times (N,)."""
    n = len(t)
    centre = np.column_stack([SPEED * t, np.full(n, 50.0)])
    rest = np.zeros((n, 4))
    rest[:, 0] = SPEED
    return Trajectories(
        t=t,
        track_id=np.full(n, track_id),
        boxes=np.column_stack([centre - np.array(SIZE) / 2.0, np.tile(SIZE, (n, 1))]),
        existence=np.full(n, 0.9),
        mean=np.column_stack([centre, rest]),
        var=np.full((n, 6), 1e-6),
        used=np.ones(n, dtype=np.int64),
        sensors=("rgb",),
    )
