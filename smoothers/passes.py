"""The arrays that the compiled passes over one track read and write, grouped by meaning.

A track has a state at each of N keys and M observations, in order of time. A state is, per axis, one block of
n components (`track_data.py`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray


class Span(NamedTuple):
    """The keys that a pass goes over, as indices into the arrays of a track.

    Attributes:
        first: the first key.
        end: the key after the last.
        observation: forward, the first observation of these keys; backward, the one after the last.
    """

    first: int
    end: int
    observation: int


class Steps(NamedTuple):
    """How the state moves from each key to the next.

    Attributes:
        t: (N,) times of the keys (s), ascending.
        jerk: (N,) root spectral density of the jerk over the step that ends at each (px/s^2.5), > 0.
        correlation_time: (n - 3,) of the error states (s).
    """

    t: FloatArray
    jerk: FloatArray
    correlation_time: FloatArray


class Observations(NamedTuple):
    """Measurements z = p + h e + w of a track, with p its position, e an error state and w white noise.

    Attributes:
        key: (M,) key of each, ascending.
        z: (M, 2) measured centres (px).
        information: (M, 2) of w, one over its variance (1/px²), > 0.
        coloured_std: (M, 2) standard deviation h of the coloured part (px).
        error: (M,) index of its error state, or -1 where the error is white.
    """

    key: IntArray
    z: FloatArray
    information: FloatArray
    coloured_std: FloatArray
    error: IntArray

    def select(self, part: slice) -> Observations:
        """Return some of them."""
        noise = self.information[part], self.coloured_std[part], self.error[part]
        return Observations(self.key[part], self.z[part], *noise)


class Filtered(NamedTuple):
    """What the filter leaves for the way back.

    Attributes:
        mean: (N, 2, n) filtered means.
        cov: (N, 2, n, n) filtered covariances.
        gain: (M, 2, n) gain of each observation.
        innovation: (M, 2) its innovation (px).
        variance: (M, 2) the variance of that (px²).
    """

    mean: FloatArray
    cov: FloatArray
    gain: FloatArray
    innovation: FloatArray
    variance: FloatArray

    @staticmethod
    def allocate(keys: int, observations: int, size: int) -> Filtered:
        """Make room for so many keys and observations of states with `size` components per axis."""
        return Filtered(
            np.empty((keys, 2, size)),
            np.empty((keys, 2, size, size)),
            np.empty((observations, 2, size)),
            np.empty((observations, 2)),
            np.empty((observations, 2)),
        )


class Covariances(NamedTuple):
    """What a smoother knows of K states, whatever was measured.

    Attributes:
        cov: (K, 2, n, n) smoothed covariances.
        gain: (K, 2, n, n) smoother gains from each state to the next, zero at the last of the track.
    """

    cov: FloatArray
    gain: FloatArray

    @staticmethod
    def allocate(keys: int, size: int) -> Covariances:
        """Make room for so many states with `size` components per axis."""
        return Covariances(np.empty((keys, 2, size, size)), np.empty((keys, 2, size, size)))
