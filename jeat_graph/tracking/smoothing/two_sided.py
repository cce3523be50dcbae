"""What the past and the future of a track say of it at each time: one filter forward, one backward."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray, RecordArray
from jeat_graph.filters.coloured_noise import MOTION
from jeat_graph.smoothers.exchanging import TwoSided
from jeat_graph.smoothers.rts import filter_track
from jeat_graph.smoothers.size import filter_size
from jeat_graph.tracking.smoothing.priors import ErrorStates, size_prior_of, track_data

# Where a vehicle was last seen nothing tells how fast it was: the filter that runs backward begins with so
# many times the variances of a track that begins. How many does not matter, for they are the same in all that
# is compared.
_UNKNOWN = 1e4


def two_sided(rows: RecordArray, birth: np.void, errors: ErrorStates) -> TwoSided:
    """Filter one track in both directions.

    Args:
        rows: (M,) its measurements in order of time, the first as its prior.
        birth: the record of a birth, for the variances of what a first detection does not tell.
        errors: the error states of the sensors.
    """
    t, jerk, size_density, *past = _filtered(rows, errors)
    back = rows[::-1].copy()
    back["t"] = -back["t"]
    # What drives the changes before a measurement is noted with it.
    for name in ("jerk", "size_density"):
        back[name][1:] = rows[name][:0:-1]
    for name in ("velocity_var", "acceleration_var", "rate_var"):
        back[name][0] = _UNKNOWN * birth[name]
    _, _, _, *turned = _filtered(back, errors)
    future = [values[::-1].copy() for values in turned]
    for mean, cov in (future[:2], future[2:]):
        # Backward in time, velocities and rates have the other sign.
        mean[:, :, 1] *= -1.0
        cov[:, :, 1, :] *= -1.0
        cov[:, :, :, 1] *= -1.0
    mean, cov, size, size_cov = future
    return TwoSided(t, jerk, size_density, past[0], past[1], mean, cov, past[2], past[3], size, size_cov)


def _filtered(rows: RecordArray, errors: ErrorStates) -> tuple[FloatArray, ...]:
    """Times, jerk and size densities of the keys; mean and covariance of both by all until each."""
    track = track_data(rows, errors)
    mean, cov = filter_track(track)
    prior = size_prior_of(rows[0])
    measured = rows["t"].copy(), rows["log_size"].copy(), rows["size_var"].copy(), rows["size_density"].copy()
    size_density, size, size_cov = filter_size(prior.mean, prior.cov, *measured)
    motion = np.ascontiguousarray(mean[..., :MOTION]), np.ascontiguousarray(cov[..., :MOTION, :MOTION])
    return track.t, track.jerk, size_density, *motion, size, size_cov
