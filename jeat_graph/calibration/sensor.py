"""One sensor's noise, bias, score curve, detection probability and clutter, from matched detections."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import isotonic_regression, minimize, minimize_scalar

from jeat_graph.calibration.matches import SensorMatches
from jeat_graph.calibration.memory import fit_memory
from jeat_graph.calibration.rounding import with_estimates
from jeat_graph.calibration.score_noise import factors, fit_score_noise
from jeat_graph.config.schema import SensorConfig
from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.errors import DataError

_MIN_PAIRS = 20
_MAX_KNOTS = 12
_ROUNDS = 4
# A vehicle of which this part is free counts as in full view.
_IN_VIEW = 0.9


def calibrate_sensor(matches: SensorMatches, known: SensorConfig) -> SensorConfig:
    """Estimate what matched detections tell of one sensor.

    Args:
        matches: its detections beside the truth; of the correct ones those that the edge cuts are left out.
        known: its rate, and what detections cannot tell: all that is not estimated stays as it is here.

    Raises:
        DataError: fewer than 20 detections of vehicles, or of whole ones.
    """
    correct, whole = int(matches.correct.sum()), len(matches.residual)
    if whole < _MIN_PAIRS:
        found = f"{correct} detections match the truth"
        if correct >= _MIN_PAIRS:
            found = f"{whole} of the {found.replace('match', 'that match')} are not cut by the picture's edge"
        raise DataError(f"only {found}; at least {_MIN_PAIRS} are needed")
    bias = np.median(matches.residual, axis=0)
    centred = matches.residual - bias
    # Small boxes have low scores: what is due to which is told apart by turns, which settles fast.
    knots: tuple[tuple[float, float], ...] = ()
    for _ in range(_ROUNDS):
        by_score = factors(matches.hit_score, knots)[:, None]
        noise = _fit_box_noise(centred / by_score, matches.side)
        # Errors in units of the noise without scores.
        knots = fit_score_noise(matches.hit_score, _whitened(centred, matches.side, noise))
        if not knots:
            noise = _fit_box_noise(centred, matches.side)
            break
    by_score = factors(matches.hit_score, knots)[:, None]
    white = _whitened(centred / by_score, matches.side, noise)
    share, memory = fit_memory(white[:, :2], matches.key, matches.t)
    p_detect, blind = fit_detection(matches.seen, matches.speed, matches.visible)
    precision = np.clip((correct + 0.5) / (len(matches.correct) + 1.0), 0.001, 0.999)
    false = ~matches.correct
    return with_estimates(
        known,
        sigma_px=noise.sigma_px,
        rho_x=noise.rho[0],
        rho_y=noise.rho[1],
        # What goes with sqrt(w h) is in the parts that go with the sides.
        rho_size=0.0,
        correlated_share=share,
        memory_s=memory,
        sigma_log_width=noise.log_size[0],
        sigma_log_height=noise.log_size[1],
        score_noise=knots,
        bias=(float(bias[0]), float(bias[1]), float(bias[2]), float(bias[3])),
        # With truth it is known, and nothing is left to be learnt.
        bias_std=0.0,
        p_detect=float(np.clip(p_detect, 0.05, 0.99)),
        clutter_per_scan=float((false.sum() + 0.5) / matches.scans),
        precision=float(precision),
        score_precision=fit_precision(matches.score, matches.correct),
        blind_speed=blind,
    )


class _BoxNoise(NamedTuple):
    """Noise of boxes: σ (px), ρ of both axes, and the standard deviations of ln width and ln height."""

    sigma_px: float
    rho: tuple[float, float]
    log_size: tuple[float, float]


def _fit_box_noise(residual: FloatArray, side: FloatArray) -> _BoxNoise:
    """Fit the noise to errors without bias (C, 4), as `SensorMatches.residual`, of boxes of sides (C, 2)."""
    sigma_x, rho_x = fit_noise(residual[:, 0] * side[:, 0], side[:, 0])
    sigma_y, rho_y = fit_noise(residual[:, 1] * side[:, 1], side[:, 1])
    # One floor for both axes; each axis' own part goes with its side.
    sigma = float(max(np.sqrt(0.5 * (sigma_x**2 + sigma_y**2)), 0.1))
    # The shape is that of the bulk; the scale is that of all, for the filter has no other word for the tails.
    bulk = np.hypot(sigma, np.array([rho_x, rho_y]) * side)
    tails = np.sqrt(np.mean((residual[:, :2] * side / bulk) ** 2, axis=0))
    log_size = np.maximum(np.sqrt(np.mean(residual[:, 2:] ** 2, axis=0)), 0.005)
    return _BoxNoise(
        float(max(sigma * np.sqrt(np.mean(tails**2)), 0.1)),
        (float(min(rho_x * tails[0], 1.0)), float(min(rho_y * tails[1], 1.0))),
        (float(log_size[0]), float(log_size[1])),
    )


def _whitened(residual: FloatArray, side: FloatArray, noise: _BoxNoise) -> FloatArray:
    """Errors (C, 4) in units of their standard deviations."""
    spread = np.hypot(noise.sigma_px, np.array(noise.rho) * side)
    return np.hstack([residual[:, :2] * side / spread, residual[:, 2:] / np.array(noise.log_size)])


def robust_std(values: FloatArray) -> float:
    """Standard deviation after values beyond 3.5 times the scaled median absolute deviation are left out."""
    middle = np.median(values)
    spread = 1.4826 * np.median(np.abs(values - middle))
    kept = values[np.abs(values - middle) <= max(3.5 * spread, 1e-9)]
    return float(np.sqrt(np.mean((kept - middle) ** 2)))


def fit_noise(residual: FloatArray, side: FloatArray) -> tuple[float, float]:
    """Fit var = σ² + (ρ side)² by maximum likelihood under a Student-t of 5 degrees of freedom.

    Args:
        residual: (C,) errors of a coordinate (px).
        side: (C,) width or height (px).

    Returns:
        σ (px) and ρ (1), scaled so that they give the variance of the bulk of the errors.
    """
    nu = 5.0

    def loss(log_parameters: FloatArray) -> float:
        sigma, rho = np.exp(log_parameters)
        var = sigma**2 + (rho * side) ** 2
        return float(np.sum(0.5 * np.log(var) + 0.5 * (nu + 1.0) * np.log1p(residual**2 / (nu * var))))

    spread = max(robust_std(residual), 1e-3)
    first = np.log([0.7 * spread, 0.7 * spread / np.median(side)])
    found = minimize(
        loss, first, method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-4, "maxiter": 2000}
    )
    sigma, rho = np.exp(found.x)
    # The scale of a t is smaller than the deviation of its bulk; the whitened errors tell by how much.
    ratio = robust_std(residual / np.sqrt(sigma**2 + (rho * side) ** 2))
    return float(sigma * ratio), float(np.clip(rho * ratio, 0.0, 1.0))


def fit_precision(score: FloatArray, correct: BoolArray) -> tuple[tuple[float, float], ...]:
    """Calibrate score → precision: isotonic regression on quantile bins, shrunk to the overall precision.

    Args:
        score: (D,) in [0, 1].
        correct: (D,) whether the detection is of a vehicle.

    Returns:
        Up to 12 knots (score, precision) with rising scores and precisions that do not fall.
    """
    order = np.argsort(score, kind="stable")
    s, c = score[order], correct[order].astype(float)
    overall = (c.sum() + 0.5) / (len(c) + 1.0)
    # Both kinds weigh the same in the division into bins, so that it is fine where the rarer kind lies.
    mass = np.cumsum(np.where(c > 0, 0.5 / max(c.sum(), 1.0), 0.5 / max((1.0 - c).sum(), 1.0)))
    count = min(_MAX_KNOTS, max(len(s) // 25, 1))
    edges = np.unique(np.searchsorted(mass, np.arange(1, count) / count * mass[-1]))
    bins = [b for b in np.split(np.arange(len(s)), edges) if len(b)]
    centre = np.array([s[b].mean() for b in bins])
    weight = np.array([float(len(b)) for b in bins])
    # Two pseudo-observations at the overall precision keep a bin from claiming certainty.
    value = np.array([(c[b].sum() + 2.0 * overall) / (len(b) + 2.0) for b in bins])
    rising = isotonic_regression(value, weights=weight).x
    keep = np.concatenate(([True], np.diff(centre) > 1e-6))
    return tuple(
        (round(float(a), 6), round(float(np.clip(b, 0.002, 0.998)), 5))
        for a, b in zip(centre[keep], rising[keep], strict=True)
    )


def fit_detection(seen: BoolArray, speed: FloatArray, visible: FloatArray) -> tuple[float, float]:
    """Fit P_D of a vehicle in full view and, if the data speak for it, the speed of blindness.

    P_D(v) = P₀ (1 − exp(−(v / v_blind)²)). The blind speed is accepted over a constant P_D where it raises
    the log likelihood by more than 10, a Bayes factor that chance does not explain. Vehicles hidden by more
    than a tenth are left out: the tracker accounts for occlusion itself.

    Args:
        seen: (G,) whether each true box was detected.
        speed: (G,) its image speed (px/s), NaN where not known.
        visible: (G,) the part of it that no nearer vehicle hides.

    Returns:
        P₀ and v_blind (px/s), 0 for a sensor that sees what stands still.
    """
    free = visible >= _IN_VIEW
    if free.sum() >= _MIN_PAIRS:
        seen, speed = seen[free], speed[free]
    flat = float((seen.sum() + 1.0) / (len(seen) + 2.0))
    known = np.isfinite(speed)
    if known.sum() < 100:
        return flat, 0.0
    y, v = seen[known].astype(float), speed[known]

    def log_likelihood(p: FloatArray | float) -> float:
        q = np.clip(p, 1e-6, 1.0 - 1e-6)
        return float(np.sum(y * np.log(q) + (1.0 - y) * np.log1p(-q)))

    def best_p0(blind: float) -> float:
        factor = 1.0 - np.exp(-((v / blind) ** 2))
        moving = factor > 0.5
        # The ratio of means is the moment estimate of P₀ and close to the most likely one.
        share = float(y[moving].sum() / factor[moving].sum()) if moving.any() else 0.5
        return float(np.clip(share, 0.05, 0.99))

    def loss(log_blind: float) -> float:
        blind = float(np.exp(log_blind))
        return -log_likelihood(best_p0(blind) * (1.0 - np.exp(-((v / blind) ** 2))))

    found = minimize_scalar(loss, bounds=(np.log(0.5), np.log(100.0)), method="bounded")
    if -found.fun - log_likelihood(float(y.mean())) < 10.0:
        return flat, 0.0
    blind = float(np.exp(found.x))
    return best_p0(blind), blind
