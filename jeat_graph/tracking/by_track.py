"""Arrays with a row for each living track, in the order of identities, from one step to the next."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray


def places(identity: IntArray, among: IntArray) -> tuple[IntArray, BoolArray]:
    """Return where each identity (M,) stands among ascending ones (N,), and whether it is there at all."""
    row = np.minimum(np.searchsorted(among, identity), max(len(among) - 1, 0))
    if not len(among):
        return row, np.zeros(len(identity), dtype=np.bool_)
    return row, np.asarray(among[row] == identity)


def carried_over(values: FloatArray, before: IntArray, now: IntArray) -> FloatArray:
    """Return the rows of the tracks of now (N, ...): those they had before, 0 for new ones.

    Args:
        values: (K, ...) rows of the tracks before.
        before: (K,) identities of these, ascending.
        now: (N,) identities, ascending.
    """
    out = np.zeros((len(now), *values.shape[1:]))
    _, mine, theirs = np.intersect1d(now, before, assume_unique=True, return_indices=True)
    out[mine] = values[theirs]
    return out
