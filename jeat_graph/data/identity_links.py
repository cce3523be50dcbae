"""Where pieces of tracks were joined to one identity."""

from __future__ import annotations

from typing import NamedTuple

from jeat_graph.data.arrays import FloatArray, IntArray


class IdentityLinks(NamedTuple):
    """Links that the smoother made between pieces of tracks (K,), in order of time.

    Attributes:
        track_id: identity that both pieces have.
        tail, head: causal identities of the detection before the gap, and of that behind it.
        t_tail, t_head: their times (s).
        log_ratio: ln of how much likelier the two belong together than apart.
        probability: that they do.
    """

    track_id: IntArray
    tail: IntArray
    head: IntArray
    t_tail: FloatArray
    t_head: FloatArray
    log_ratio: FloatArray
    probability: FloatArray
