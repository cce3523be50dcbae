"""Rows of a table in columns, as engines and smoothers give them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray

#: Numbers that are reported of a track along an axis: place, velocity, acceleration, ln size and its rate.
REPORTED = 5
#: Time, identity, mean (N, 10), variance (N, 10), posterior, sensors that found it at that time, number of
#: the class, and its share of the votes.
ModelRows: TypeAlias = tuple[
    FloatArray, IntArray, FloatArray, FloatArray, FloatArray, IntArray, IntArray, FloatArray
]


class RowOutput(NamedTuple):
    """How what tables tell follows from the states of an engine.

    Attributes:
        mean: from means (..., 2, D), the output (..., 2, 5).
        covariance: from means and covariances (..., 2, D, D), that of it (..., 2, 5, 5).
    """

    mean: Callable[[FloatArray], FloatArray]
    covariance: Callable[[FloatArray, FloatArray], FloatArray]


class Called(NamedTuple):
    """What a track is called in smoothed rows: the identity given out, number and share of its class."""

    given: int
    label: int = -1
    share: float = 0.0


def rows_of(
    t: FloatArray,
    called: Sequence[Called],
    states: tuple[FloatArray, FloatArray],
    real: FloatArray,
    used: IntArray,
    output: RowOutput,
) -> ModelRows:
    """Return rows (N,).

    Args:
        t: (N,) times (s).
        called: of each.
        states: means (N, 2, D) and covariances (N, 2, D, D).
        real: (N,) posteriors.
        used: (N,) bits of the sensors that found it at that time.
        output: how the states are reported.
    """
    variance = np.diagonal(output.covariance(*states), axis1=2, axis2=3)
    flat = output.mean(states[0]).reshape(-1, 2 * REPORTED), variance.reshape(-1, 2 * REPORTED)
    given, label = (np.array([one[k] for one in called], dtype=np.int64) for k in (0, 1))
    share = np.array([one.share for one in called], dtype=np.float64)
    return t, given, *flat, real, used, label, share


def joined(parts: Sequence[ModelRows]) -> ModelRows:
    """Return rows one behind the other."""
    nothing, whole, state = np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 2 * REPORTED))
    none: ModelRows = (nothing, whole, state, state, nothing, whole, whole, nothing)
    t, ids, mean, variance, real, used, label, share = zip(none, *parts, strict=True)
    return (
        np.concatenate(t),
        np.concatenate(ids),
        np.concatenate(mean),
        np.concatenate(variance),
        np.concatenate(real),
        np.concatenate(used),
        np.concatenate(label),
        np.concatenate(share),
    )


def in_order(rows: ModelRows) -> ModelRows:
    """Return rows in order of time, then of identity."""
    order = np.lexsort((rows[1], rows[0]))
    t, ids, mean, variance, real, used, label, share = rows
    return (
        t[order],
        ids[order],
        mean[order],
        variance[order],
        real[order],
        used[order],
        label[order],
        share[order],
    )
