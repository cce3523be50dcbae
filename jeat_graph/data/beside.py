"""What rows of detections may say beside boxes, scores and classes."""

from __future__ import annotations

from typing import TypedDict

import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray


class Beside(TypedDict, total=False):
    """Columns of R rows, each of which may be missing, or None.

    Attributes:
        embeddings: (R, E) what each row looks like, NaN where that is not known.
        camera_motion: (R, 11) in one row of each scan that knows it (see `camera_motion`), NaN in the others.
        box_std: (R, 4) standard deviations of left, top, right, bottom (px), NaN where unknown.
    """

    embeddings: npt.ArrayLike | None
    camera_motion: FloatArray | None
    box_std: npt.ArrayLike | None
