"""The state of a track on the road by the past alone: where it is now, how fast, and how large.

Along the road the acceleration forgets slowly (Singer's model); across it the speed is a random walk that is
pulled to zero. Each box is an extended Kalman update of its four channels (`box_channels`). Errors with
memory are taken for white ones that tell as much in the long run, which costs one state less a sensor and
channel.
"""

from __future__ import annotations

import numpy as np

#: Components of the state: x, its speed; y, its speed and acceleration; length, width, height.
X, VX, Y, VY, AY, LENGTH, WIDTH, HEIGHT = range(8)
STATES = 8
#: Place of the speed in a row of a table of the road, before its heading and acceleration.
SPEED = 2

#: A track at one time: x, y (m), speed (m/s), heading from y towards x (rad), acceleration along the way
#: (m/s²), length, width, height (m), and their variances by noise alone.
ROAD_ROW = np.dtype(
    [
        ("t", np.float64),
        ("track_id", np.int64),
        ("mean", np.float64, (STATES,)),
        ("var", np.float64, (STATES,)),
    ]
)
