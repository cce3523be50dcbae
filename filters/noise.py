"""Measurement noise: R = s · R_base(size) / g(score), and the adaptation of s (paper eq. 5)."""

from __future__ import annotations

from numba import njit


@njit(cache=True)
def base_variance(sigma_px: float, rho: float, side: float, rho_size: float, size: float) -> float:
    """Variance (px²) of a box centre along one axis: σ² + (ρ side)² + (ρ_s size)².

    A detector misses the edges of a box by a fraction of the box; a constant in pixels is wrong by an
    order of magnitude between a near vehicle and a far one. Of a narrow object, a walker, it misses all sides
    by a fraction of the whole.

    Args:
        sigma_px: the part that does not depend on size (px).
        rho: the part that does, as a fraction of the side.
        side: width for the x axis, height for the y axis (px).
        rho_size: the part that goes with the size of the whole box, as a fraction of it.
        size: sqrt(w h) (px).
    """
    r = rho * side
    whole = rho_size * size
    return sigma_px * sigma_px + r * r + whole * whole


@njit(cache=True)
def score_weight(score: float, floor: float) -> float:
    """Factor 1 / max(score, floor) by which a doubtful detection's R grows (paper, g(p), floor 0.1)."""
    return 1.0 / max(score, floor)


@njit(cache=True)
def scored_noise(white: float, coloured_std: float, spread: float) -> tuple[float, float]:
    """Split the noise of a detection that is `spread` times as inexact as its sensor's usually are.

    What it has of error beyond the usual is white: a detector in doubt guesses anew in every picture. Taken
    for more of the error that lasts, one doubtful box far off would move a track the other way.

    Args:
        white: variance of the usual white part (px²).
        coloured_std: standard deviation of the usual part that is correlated in time (px).
        spread: factor on the standard deviation of the whole.

    Returns:
        The same two of the detection; its whole variance is spread² (white + coloured_std²).
    """
    lasting = min(spread, 1.0)
    more = spread * spread - lasting * lasting
    return spread * spread * white + more * coloured_std * coloured_std, lasting * coloured_std


@njit(cache=True)
def adapt_scale(scale: float, nis: float, rate: float, low: float, high: float) -> float:
    """One step of the noise scale of a track and sensor (paper eq. 5, n_z = 2).

    s ← clip(s (1 + η (ε / 2 − 1)), s_min, s_max).

    Args:
        scale: s before the step.
        nis: normalised innovation squared ε of the update.
        rate: η.
        low: s_min.
        high: s_max.
    """
    return max(low, min(scale * (1.0 + rate * (nis / 2.0 - 1.0)), high))


@njit(cache=True)
def hidden_excess(hidden: float, growth: float) -> float:
    """By how much the variance of what stands partly behind others grows, as a share of it.

    The standard deviation grows by 1 + growth · hidden part: a detector guesses the sides that it does not
    see. How it guesses changes with the part that is hidden, so what is added is white.

    Args:
        hidden: part of the box that others hide.
        growth: >= 0.
    """
    more = 1.0 + growth * hidden
    return more * more - 1.0
