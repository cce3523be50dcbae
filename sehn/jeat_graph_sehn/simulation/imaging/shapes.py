"""What vehicles are made of: up to four convex bodies each, narrowing upwards, within the vehicle's box."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray

PARTS = 4
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

# What a body is painted as.
DARK, BODY, CABIN, VAN_TOP, BOX, CAB, COACH, RIDER, BED = range(9)
# Rows: rear and front at the bottom, rear and front at the top (fractions of the length from the middle),
# half width at the bottom and at the top (of the width), bottom and top (of the height), paint.
# Upper bodies begin within the lower ones, so that no seam shows where they meet.
_SHAPES = {
    "car": [
        [  # saloon
            (-0.44, 0.46, -0.44, 0.46, 0.44, 0.44, 0.02, 0.30, DARK),
            (-0.50, 0.50, -0.49, 0.48, 0.50, 0.48, 0.14, 0.63, BODY),
            (-0.44, 0.26, -0.27, 0.06, 0.46, 0.37, 0.45, 1.00, CABIN),
        ],
        [  # hatchback
            (-0.43, 0.45, -0.43, 0.45, 0.44, 0.44, 0.02, 0.30, DARK),
            (-0.50, 0.50, -0.49, 0.47, 0.50, 0.48, 0.14, 0.62, BODY),
            (-0.49, 0.31, -0.40, 0.08, 0.46, 0.38, 0.44, 1.00, CABIN),
        ],
        [  # estate
            (-0.45, 0.46, -0.45, 0.46, 0.44, 0.44, 0.02, 0.29, DARK),
            (-0.50, 0.50, -0.50, 0.48, 0.50, 0.48, 0.14, 0.62, BODY),
            (-0.49, 0.25, -0.45, 0.05, 0.46, 0.38, 0.44, 1.00, CABIN),
        ],
        [  # coupé
            (-0.43, 0.45, -0.43, 0.45, 0.45, 0.45, 0.02, 0.31, DARK),
            (-0.50, 0.50, -0.48, 0.47, 0.50, 0.47, 0.13, 0.66, BODY),
            (-0.45, 0.20, -0.20, -0.02, 0.44, 0.34, 0.48, 1.00, CABIN),
        ],
    ],
    "suv": [
        [
            (-0.44, 0.46, -0.44, 0.46, 0.44, 0.44, 0.02, 0.30, DARK),
            (-0.50, 0.50, -0.49, 0.48, 0.50, 0.49, 0.15, 0.62, BODY),
            (-0.49, 0.30, -0.44, 0.12, 0.47, 0.41, 0.45, 1.00, CABIN),
        ],
        [  # off-road: upright, with the spare wheel's place behind
            (-0.42, 0.44, -0.42, 0.44, 0.44, 0.44, 0.02, 0.32, DARK),
            (-0.47, 0.50, -0.47, 0.49, 0.50, 0.49, 0.18, 0.60, BODY),
            (-0.47, 0.22, -0.46, 0.17, 0.48, 0.45, 0.45, 1.00, CABIN),
            (-0.50, -0.46, -0.50, -0.46, 0.18, 0.18, 0.30, 0.66, DARK),
        ],
        [  # sloping
            (-0.44, 0.46, -0.44, 0.46, 0.44, 0.44, 0.02, 0.30, DARK),
            (-0.50, 0.50, -0.48, 0.47, 0.50, 0.48, 0.16, 0.64, BODY),
            (-0.48, 0.28, -0.26, 0.10, 0.46, 0.38, 0.46, 1.00, CABIN),
        ],
    ],
    "van": [
        [
            (-0.46, 0.46, -0.46, 0.46, 0.44, 0.44, 0.02, 0.20, DARK),
            (-0.50, 0.50, -0.50, 0.48, 0.50, 0.49, 0.09, 0.46, BODY),
            (-0.50, 0.43, -0.49, 0.24, 0.49, 0.46, 0.30, 1.00, VAN_TOP),
        ],
        [  # box on a chassis
            (-0.48, 0.46, -0.48, 0.46, 0.44, 0.44, 0.03, 0.24, DARK),
            (-0.50, 0.20, -0.50, 0.20, 0.50, 0.50, 0.22, 1.00, BOX),
            (0.16, 0.50, 0.18, 0.44, 0.46, 0.42, 0.10, 0.78, CAB),
        ],
        [  # people carrier
            (-0.46, 0.46, -0.46, 0.46, 0.44, 0.44, 0.02, 0.22, DARK),
            (-0.50, 0.50, -0.50, 0.48, 0.50, 0.49, 0.10, 0.55, BODY),
            (-0.49, 0.36, -0.47, 0.18, 0.48, 0.43, 0.42, 1.00, CABIN),
        ],
    ],
    "truck": [
        [  # box behind a cab
            (-0.49, 0.48, -0.49, 0.48, 0.42, 0.42, 0.03, 0.32, DARK),
            (-0.50, 0.30, -0.50, 0.30, 0.50, 0.50, 0.28, 1.00, BOX),
            (0.335, 0.50, 0.34, 0.49, 0.49, 0.47, 0.10, 0.84, CAB),
        ],
        [  # tipper
            (-0.49, 0.48, -0.49, 0.48, 0.42, 0.42, 0.03, 0.34, DARK),
            (-0.49, 0.22, -0.50, 0.24, 0.46, 0.50, 0.32, 0.72, BED),
            (0.27, 0.50, 0.28, 0.49, 0.49, 0.47, 0.12, 1.00, CAB),
        ],
        [  # lorry with a drawbar trailer
            (-0.49, 0.48, -0.49, 0.48, 0.40, 0.40, 0.04, 0.27, DARK),
            (-0.50, -0.06, -0.50, -0.06, 0.50, 0.50, 0.26, 1.00, BOX),
            (-0.01, 0.35, -0.01, 0.35, 0.50, 0.50, 0.26, 1.00, BOX),
            (0.38, 0.50, 0.38, 0.49, 0.49, 0.47, 0.10, 0.86, CAB),
        ],
        [  # articulated: tractor and semi-trailer
            (-0.49, 0.48, -0.49, 0.48, 0.40, 0.40, 0.04, 0.26, DARK),
            (-0.50, 0.33, -0.50, 0.33, 0.50, 0.50, 0.29, 1.00, BOX),
            (0.36, 0.50, 0.36, 0.495, 0.49, 0.47, 0.09, 0.93, CAB),
        ],
    ],
    "bus": [
        [
            (-0.46, 0.46, -0.46, 0.46, 0.46, 0.46, 0.03, 0.14, DARK),
            (-0.50, 0.50, -0.49, 0.485, 0.50, 0.47, 0.10, 1.00, COACH),
        ],
        [  # with a box of machinery on the roof
            (-0.46, 0.46, -0.46, 0.46, 0.46, 0.46, 0.03, 0.14, DARK),
            (-0.50, 0.50, -0.50, 0.49, 0.50, 0.49, 0.09, 0.92, COACH),
            (-0.30, 0.10, -0.28, 0.08, 0.36, 0.34, 0.85, 1.00, CABIN),
        ],
    ],
    "motorcycle": [
        [
            (-0.50, 0.50, -0.38, 0.36, 0.12, 0.16, 0.02, 0.52, DARK),
            (-0.22, 0.20, -0.16, 0.10, 0.42, 0.30, 0.45, 0.86, RIDER),
            (-0.04, 0.10, -0.03, 0.09, 0.17, 0.14, 0.82, 1.00, RIDER),
        ],
        [  # with cases and a fairing
            (-0.50, 0.50, -0.36, 0.38, 0.14, 0.18, 0.02, 0.50, DARK),
            (-0.48, -0.20, -0.46, -0.22, 0.50, 0.44, 0.30, 0.62, BODY),
            (-0.20, 0.16, -0.16, 0.08, 0.38, 0.30, 0.45, 0.88, RIDER),
            (0.10, 0.42, 0.12, 0.26, 0.34, 0.20, 0.34, 0.80, BODY),
        ],
    ],
    "pickup": [
        [
            (-0.45, 0.46, -0.45, 0.46, 0.44, 0.44, 0.02, 0.32, DARK),
            (-0.50, 0.50, -0.50, 0.48, 0.50, 0.49, 0.18, 0.60, BODY),
            (-0.12, 0.28, -0.08, 0.14, 0.46, 0.40, 0.45, 1.00, CABIN),
            (-0.48, -0.13, -0.48, -0.13, 0.43, 0.43, 0.55, 0.605, DARK),
        ],
        [  # with a hard top
            (-0.45, 0.46, -0.45, 0.46, 0.44, 0.44, 0.02, 0.32, DARK),
            (-0.50, 0.50, -0.50, 0.48, 0.50, 0.49, 0.18, 0.60, BODY),
            (-0.12, 0.28, -0.10, 0.14, 0.46, 0.40, 0.45, 1.00, CABIN),
            (-0.49, -0.13, -0.47, -0.13, 0.47, 0.42, 0.55, 0.92, VAN_TOP),
        ],
    ],
}


def shape_count(name: str) -> int:
    """How many shapes vehicles of a kind have."""
    return len(_SHAPES[name])


def shape_of(name: str, variant: int) -> FloatArray:
    """Bodies of one shape of a kind as fractions of length, width and height, and paint (PARTS, 9)."""
    rows = _SHAPES[name][variant]
    out = np.zeros((PARTS, 9))
    out[: len(rows)] = rows
    return out
