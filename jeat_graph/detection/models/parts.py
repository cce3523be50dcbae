"""Boxes of parts: of one that a better box covers it is unlikely that it is a vehicle of its own.

Events come from edges, so a network of events finds, on a vehicle that is near, its front, a wheel or its
lamps besides, each steadily and each a track of its own. Suppression by overlap leaves them: a part is small
beside the whole.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.association.overlap import pairwise_covered
from jeat_graph.data.interop import from_xyxy
from jeat_graph.detection.models.layouts.record import DecodedBoxes


def discounted(found: DecodedBoxes, least: float) -> DecodedBoxes:
    """Return boxes with scores s (1 - c²), c the largest share of the box that a better one covers.

    Of what stands before another vehicle and is covered by its box, some is left: half the score where seven
    tenths are covered. (Powers of 1.5 to 3 differ by less than 1 MOTA in six recordings.)

    Args:
        found: the best first.
        least: what then scores less is left out.
    """
    if len(found.scores) < 2:
        return found
    boxes = from_xyxy(found.corners)
    covered = np.tril(pairwise_covered(boxes, boxes), -1).max(axis=1)
    less = found._replace(scores=found.scores * (1.0 - covered**2))
    order = np.argsort(-less.scores, kind="stable")
    return less.taken(order[less.scores[order] >= least])
