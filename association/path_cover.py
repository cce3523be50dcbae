"""Which pieces of tracks follow one another: the best path cover, and covers drawn by their probability.

Pieces are nodes; a link (tail, head) says that head continues tail, with a gain in ln likelihood over their
being apart. A cover is a set of links with at most one from and one to each node, so that nodes become
chains. Its probability goes as exp(sum of gains). The best one is an assignment of tails to heads (Ford and
Fulkerson, *Flows in Networks*, 1962, ch. II.9: minimum chain cover); others are drawn by a Metropolis chain.
The same cover joins tracks within one camera's picture and those of several.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.core import association as core
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray


class Links(NamedTuple):
    """Possible links of N nodes, each pair once.

    Attributes:
        tail: (E,) node that each begins at.
        head: (E,) node that continues it.
        gain: (E,) ln of how much likelier the two belong together than apart; finite.
    """

    tail: IntArray
    head: IntArray
    gain: FloatArray

    def where(self, keep: BoolArray) -> Links:
        """Return those that a mask (E,) says."""
        return Links(self.tail[keep], self.head[keep], self.gain[keep])


def best_cover(links: Links, nodes: int) -> IntArray:
    """Return the link (N,) that continues each node in the cover of greatest sum, -1 for none.

    Links without a gain are never made.

    Args:
        links: that are possible.
        nodes: number N of nodes.
    """
    return core.best_links(*_contiguous(links), nodes)


def sum_of(links: Links, cover: IntArray) -> float:
    """Return the sum of gains of a cover (N,)."""
    return float(links.gain[cover[cover >= 0]].sum())


def preferring(links: Links, best: IntArray, preferred: IntArray, within: float) -> IntArray:
    """Return the best cover (N,), with parts of another one where these are nearly as good.

    Where the two differ, their links form paths and circles; each is taken from the preferred cover unless
    that loses more than `within`.

    Args:
        links: that are possible.
        best: (N,) links of the best cover, -1 for none.
        preferred: (N,) links of the other one.
        within: greatest loss of one part in ln likelihood.
    """
    nodes = len(best)
    ours, theirs = best[best >= 0], preferred[preferred >= 0]
    differing = np.setxor1d(ours, theirs)
    if not len(differing):
        return best
    part = _components(links.tail[differing], nodes + links.head[differing], 2 * nodes)
    loss = np.zeros(2 * nodes)
    sign = np.where(np.isin(differing, ours), 1.0, -1.0)
    np.add.at(loss, part[links.tail[differing]], sign * links.gain[differing])
    out = best.copy()
    switched = loss[part[links.tail[differing]]] <= within
    removed, taken = differing[switched & (sign > 0.0)], differing[switched & (sign < 0.0)]
    out[links.tail[removed]] = -1
    out[links.tail[taken]] = taken
    return out


def _components(a: IntArray, b: IntArray, nodes: int) -> IntArray:
    """Return the number (N,) of the connected component of each node, of edges (E,) from a to b."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(nodes, nodes))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def sampled_covers(
    links: Links, start: IntArray, *, samples: int = 200, sweeps: int = 10, seed: int = 1
) -> IntArray:
    """Draw covers with probabilities that go as exp(sum of gains); return their links (samples, N).

    Args:
        links: that are possible.
        start: (N,) links of the cover before the first, -1 for none.
        samples: how many.
        sweeps: draws of each link between two of them.
        seed: of the random numbers; the same gives the same covers.
    """
    return core.sample_links(*_contiguous(links), np.ascontiguousarray(start), samples, sweeps, seed)


def shares(drawn: IntArray, links: int) -> FloatArray:
    """Return the share (E,) of drawn covers (samples, N) that have each of so many links."""
    made = drawn[drawn >= 0]
    return np.bincount(made, minlength=links) / max(len(drawn), 1)


def chains(links: Links, cover: IntArray) -> IntArray:
    """Return the first node (N,) of the chain that each node is in; links lead to no circles.

    Args:
        links: that are possible.
        cover: (N,) or (samples, N) link that continues each node, -1 for none.
    """
    cover = np.atleast_2d(cover)
    first = np.tile(np.arange(cover.shape[1]), (len(cover), 1))
    which, tail = np.nonzero(cover >= 0)
    first[which, links.head[cover[which, tail]]] = tail
    while True:
        further = np.take_along_axis(first, first, axis=1)
        if np.array_equal(further, first):
            return first if len(first) > 1 else first[0]
        first = further


def _contiguous(links: Links) -> tuple[IntArray, IntArray, FloatArray]:
    tail, head = (np.ascontiguousarray(nodes, dtype=np.int64) for nodes in links[:2])
    return tail, head, np.ascontiguousarray(links.gain, dtype=np.float64)
