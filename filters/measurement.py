"""One measurement of a track as a record: the filter writes it down, smoothers and diagnostics read it."""

from __future__ import annotations

import numpy as np

#: A detection that a track took in, just as the filter weighed it. Compiled code takes arrays of it.
#:
#: - `t` time (s); `track_id` the track; `sensor` index of the sensor; `birth` whether it started the track.
#: - `z` (2,) centre (px); `r` (2,) variances of its white noise (px²), noise scale and score included.
#: - `error` the sensor's error state, or -1; `coloured_std` (2,) standard deviations of that error (px).
#: - `jerk` root spectral density of the track's jerk at the time (px/s^2.5), > 0.
#: - `size_density` root spectral density of the rate of its ln size at the time (1/s^1.5).
#: - `cut` (2,) which sides the edges of the picture cut (`cut_boxes.py`), `side` (2,) the side that shows
#:   (px): there `z` and `r` are what that side and the track's size say of the centre.
#: - `noise` (2,) what of `r` is the noise of boxes, and not what an unknown size adds where one is cut (px²).
#: - `log_size` (2,) ln width and ln height (ln px); `size_var` (2,) their variances.
#: - `velocity_var` (2,), `acceleration_var` (2,), `rate_var`: where it started the track, the variances of
#:   what one detection does not tell (px²/s², px²/s⁴, 1/s²; `prior.py`); 0 elsewhere.
#: - `nis` normalised innovation squared of the centre, NaN at a birth; `scale` the noise scale s within `r`.
MEASUREMENT = np.dtype(
    [
        ("t", np.float64),
        ("track_id", np.int64),
        ("sensor", np.int64),
        ("birth", np.int64),
        ("z", np.float64, (2,)),
        ("r", np.float64, (2,)),
        ("error", np.int64),
        ("coloured_std", np.float64, (2,)),
        ("jerk", np.float64),
        ("size_density", np.float64),
        ("log_size", np.float64, (2,)),
        ("size_var", np.float64, (2,)),
        ("velocity_var", np.float64, (2,)),
        ("acceleration_var", np.float64, (2,)),
        ("rate_var", np.float64),
        ("nis", np.float64),
        ("scale", np.float64),
        ("cut", np.int64, (2,)),
        ("side", np.float64, (2,)),
        ("noise", np.float64, (2,)),
    ]
)
