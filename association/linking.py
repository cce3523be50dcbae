"""Pieces of tracks joined: gains of all possible links, and the best cover, by expectation and maximisation.

A link's gain is ln of the ratio of two stories: head continues tail after a gap of length u, or tail leaves
and head is born,

    ln p(joined)/p(apart) + votes + ln f(u) − ln λ/α − ln p_exit + similarity

λ is the rate of births (a time step) and p_exit the probability that a piece's object leaves, each apart for
the picture's interior and its rim, α the share of the picture; f is the density of gaps, most of them none,
the others with a heavy tail (Lomax, α = 1) of a learnt median. They are learnt from the cover that they give,
in some rounds ("hard" EM: Celeux and Govaert, *Computational Statistics & Data Analysis* 14(3), 1992).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.association.path_cover import Links, best_cover
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray

_ROUNDS = 4
# Births in all, shares that leave, median gap (s), before anything is learnt: in the interior, at the rim.
_FIRST_BIRTHS, _FIRST_EXITS, _FIRST_GAP_S = (1.0, 2.0), (0.05, 0.3), 0.5
# Share of the picture that is interior, and rim: objects within half their size of the edge.
_AREA = np.array([0.75, 0.25])
# Share of links without a gap.
_NO_GAP = 0.7
# Gaps that the prior of their median counts for, and that median (s).
_PRIOR_GAPS, _PRIOR_GAP_S = 3, 0.3
# Pieces that begin or end within so many time steps of the recording's ends tell nothing of births and exits.
_AT_ENDS = 2.5
#: Nats of a link that all passes have made.
VOTES = 3.0
#: What a link's gain is made up of: how well the motions fit, the passes that made it, the length of the gap,
#: that the second piece is not born, that the object of the first does not leave, and that both look similar.
TERMS = ("motion", "passes", "gap length", "no birth", "no exit", "appearance")


class Pieces(NamedTuple):
    """P pieces of tracks.

    Attributes:
        begins, ends: (P,) time of the first and of the last detection (s).
        born_at_rim, left_at_rim: (P,) whether these lie at the rim of the picture.
    """

    begins: FloatArray
    ends: FloatArray
    born_at_rim: BoolArray
    left_at_rim: BoolArray


class Past(NamedTuple):
    """What was decided before these pieces, of a recording that goes on.

    Attributes:
        births: (2,) identities that began in the interior, and at the rim.
        leaving, continued: (2,) pieces that were never, and that were, continued, by where they ended.
        gaps: (G,) of the last links that were made (s).
    """

    births: FloatArray
    leaving: FloatArray
    continued: FloatArray
    gaps: FloatArray

    @classmethod
    def none(cls) -> Past:
        """Return that of a recording's beginning."""
        return cls(np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(0))


class Joined(NamedTuple):
    """What was found.

    Attributes:
        links: all possible links with their gains.
        cover: (P,) the link that continues each piece in the best cover, -1 for none.
        terms: (E, 6) what the gains are the sums of, in the order of `TERMS`.
    """

    links: Links
    cover: IntArray
    terms: FloatArray


def join(
    pieces: Pieces,
    possible: Links,
    votes: FloatArray,
    span: tuple[float, float],
    step_s: float,
    past: Past | None = None,
    similarity: FloatArray | None = None,
) -> Joined:
    """Find the best cover of pieces.

    Args:
        pieces: to be joined.
        possible: links, with ln p(joined)/p(apart) as gains.
        votes: (E,) share of the passes that made each.
        span: first and last time of the recording (s).
        step_s: time from one scan to the next (s).
        past: what was decided before, of other pieces.
        similarity: (E,) ln of the ratio that appearance gives each; None where nothing is known of it.
    """
    before = Past.none() if past is None else past
    u = pieces.begins[possible.head] - pieces.ends[possible.tail]
    steps = (span[1] - span[0]) / step_s + 1.0
    births, exits, median = np.array(_FIRST_BIRTHS) / steps, np.array(_FIRST_EXITS), _FIRST_GAP_S
    born, left = pieces.born_at_rim.astype(int), pieces.left_at_rim.astype(int)
    first = pieces.begins <= span[0] + _AT_ENDS * step_s
    last = pieces.ends >= span[1] - _AT_ENDS * step_s
    cover = np.full(len(pieces.begins), -1, dtype=np.int64)
    links, terms = possible, np.zeros((len(u), len(TERMS)))
    terms[:, 0], terms[:, 1] = possible.gain, VOTES * votes
    if similarity is not None:
        terms[:, 5] = similarity
    for _ in range(_ROUNDS):
        terms[:, 2] = np.log(gap_density(u, median, step_s))
        terms[:, 3] = -np.log(births / _AREA)[born[possible.head]]
        terms[:, 4] = -np.log(exits)[left[possible.tail]]
        links = possible._replace(gain=terms.sum(axis=1))
        cover = best_cover(links, len(cover))
        made = cover[cover >= 0]
        continued, continues = cover >= 0, np.zeros(len(cover), dtype=bool)
        continues[links.head[made]] = True
        new, leaves = ~continues & ~first, ~continued & ~last
        births = (np.bincount(born[new], minlength=2) + before.births + 1.0) / steps
        leaving = np.bincount(left[leaves], minlength=2) + before.leaving + 1.0
        exits = leaving / (leaving + np.bincount(left[continued], minlength=2) + before.continued + 1.0)
        gaps = np.concatenate([u[made], before.gaps])
        median = float(np.median(np.append(gaps[gaps > 1.5 * step_s], [_PRIOR_GAP_S] * _PRIOR_GAPS)))
    return Joined(links, cover, terms)


def gap_density(u: FloatArray, median: float, step_s: float) -> FloatArray:
    """Return the probability (E,) that a link has a gap as long as u (E,), within a time step.

    Args:
        u: time from the last detection to the next (s).
        median: of the gaps that are longer than a step (s).
        step_s: time from one scan to the next (s).
    """
    beyond = np.maximum(u - step_s, 0.0)
    longer = (1.0 - _NO_GAP) * step_s / median / (1.0 + beyond / median) ** 2
    return np.where(u <= 1.5 * step_s, _NO_GAP, longer)
