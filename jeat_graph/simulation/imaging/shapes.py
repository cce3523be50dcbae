"""What vehicles are made of: three convex bodies each, narrowing upwards, within the vehicle's box."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray

PARTS = 3
# Faces of a body, outward.
FRONT, REAR, LEFT, RIGHT, TOP, BOTTOM = range(6)

# Corners are numbered 4 · front + 2 · right + top.
FACE_CORNERS = np.array(
    [(4, 5, 7, 6), (0, 2, 3, 1), (0, 1, 5, 4), (2, 6, 7, 3), (1, 3, 7, 5), (0, 4, 6, 2)], dtype=np.int64
)
# Two corners and the two faces that meet there.
EDGES = np.array(
    [
        (4, 6, FRONT, BOTTOM),
        (5, 7, FRONT, TOP),
        (4, 5, FRONT, LEFT),
        (6, 7, FRONT, RIGHT),
        (0, 2, REAR, BOTTOM),
        (1, 3, REAR, TOP),
        (0, 1, REAR, LEFT),
        (2, 3, REAR, RIGHT),
        (0, 4, LEFT, BOTTOM),
        (1, 5, LEFT, TOP),
        (2, 6, RIGHT, BOTTOM),
        (3, 7, RIGHT, TOP),
    ],
    dtype=np.int64,
)

# Rows: rear and front at the bottom, rear and front at the top (fractions of the length from the middle),
# half width at the bottom and at the top (of the width), bottom and top (of the height).
# Upper bodies begin within the lower ones, so that no seam shows where they meet.
_UNDER, _BODY, _CABIN = range(PARTS)
_BODIES = {
    "car": [
        (-0.44, 0.46, -0.44, 0.46, 0.44, 0.44, 0.02, 0.30),
        (-0.50, 0.50, -0.49, 0.48, 0.50, 0.48, 0.14, 0.63),
        (-0.44, 0.26, -0.27, 0.06, 0.46, 0.37, 0.45, 1.00),
    ],
    "suv": [
        (-0.44, 0.46, -0.44, 0.46, 0.44, 0.44, 0.02, 0.30),
        (-0.50, 0.50, -0.49, 0.48, 0.50, 0.49, 0.15, 0.62),
        (-0.49, 0.30, -0.44, 0.12, 0.47, 0.41, 0.45, 1.00),
    ],
    "van": [
        (-0.46, 0.46, -0.46, 0.46, 0.44, 0.44, 0.02, 0.20),
        (-0.50, 0.50, -0.50, 0.48, 0.50, 0.49, 0.09, 0.46),
        (-0.50, 0.43, -0.49, 0.24, 0.49, 0.46, 0.30, 1.00),
    ],
    "truck": [
        (-0.49, 0.48, -0.49, 0.48, 0.42, 0.42, 0.03, 0.32),
        (-0.50, 0.30, -0.50, 0.30, 0.50, 0.50, 0.28, 1.00),
        (0.335, 0.50, 0.34, 0.49, 0.49, 0.47, 0.10, 0.84),
    ],
}


def body_table(names: tuple[str, ...]) -> FloatArray:
    """Bodies of the kinds `names` as fractions of length, width and height, (K, PARTS, 8)."""
    return np.array([_BODIES[name] for name in names])
