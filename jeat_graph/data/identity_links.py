"""Where pieces of tracks were joined to one identity."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.association.linking import TERMS
from jeat_graph.data.arrays import FloatArray, IntArray


class IdentityLinks(NamedTuple):
    """Links that the smoother made between pieces of tracks (K,), in order of time.

    Attributes:
        track_id: identity that both pieces have.
        tail, head: causal identities of the detection before the gap, and of that behind it.
        t_tail, t_head: their times (s).
        log_ratio: ln of how much likelier the two belong together than apart.
        probability: that they do.
        terms: (K, 6) what `log_ratio` is the sum of, in the order of `association.linking.TERMS`.
    """

    track_id: IntArray
    tail: IntArray
    head: IntArray
    t_tail: FloatArray
    t_head: FloatArray
    log_ratio: FloatArray
    probability: FloatArray
    terms: FloatArray

    def shown_terms(self) -> dict[str, FloatArray]:
        """Return the terms (K,) by name; that of appearance only where it tells something."""
        *usual, appearance = zip(TERMS, self.terms.T, strict=True)
        return dict([*usual, appearance] if appearance[1].any() else usual)

    def between_tracks(self) -> IdentityLinks:
        """Return the links that join two causal tracks, without those that leave one as it was."""
        return self.take(np.flatnonzero(self.tail != self.head))

    def take(self, rows: IntArray) -> IdentityLinks:
        """Return some links by their places (M,)."""
        return IdentityLinks(
            self.track_id[rows],
            self.tail[rows],
            self.head[rows],
            self.t_tail[rows],
            self.t_head[rows],
            self.log_ratio[rows],
            self.probability[rows],
            self.terms[rows],
        )
