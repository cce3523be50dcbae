"""What is counted of the detections that one sensor claims to be vehicles, and where."""

from __future__ import annotations

import numpy as np

#: Strips of the picture, side by side, by which claims are kept apart.
PLACES = 16
#: What is counted of a sensor's recent detections on lasting tracks while another sensor looked too, in
#: seconds of a track: all; those on tracks that another sensor has seen, and those of them whose score is
#: above the mean log odds of theirs and that are on tracks that have moved; the same of the detections on
#: tracks that the sensor alone has seen. The sums of the squares of the tracks' deviations from that mean
#: (log odds² s), of the squares of all deviations, and of their products with those of the next detection.
CLAIMS = np.dtype(
    [
        (name, np.float64)
        for name in (
            "all",
            "agreed",
            "agreed_high",
            "lonely_high",
            "score_spread",
            "score_square",
            "score_kept",
        )
    ]
)
