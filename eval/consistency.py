"""Whether covariances are honest: the size and whiteness of innovations, and what smoothing gains."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.normal import Z95
from jeat_graph.data.progress import with_progress
from jeat_graph.eval.lagged import States, states_at
from jeat_graph.eval.tables import Cell, Table
from jeat_graph.smoothers.filtered_track import FilteredTrack

#: Autocorrelations of the innovations are taken up to this many steps.
WHITENESS_STEPS = 5
#: Columns of the parts of a state [p, v, a].
PARTS = {"position": slice(0, 1), "velocity": slice(1, 2), "acceleration": slice(2, 3)}


def consistency(tracks: Sequence[FilteredTrack]) -> tuple[dict[str, Any], Table]:
    """Judge without truth: the innovations, and the smoother against the filter.

    Args:
        tracks: tracks, as the filter went through them.

    Returns:
        Values for JSON, and the same as a table.
    """
    innovations: list[FloatArray] = []
    ratio: list[FloatArray] = []
    for track in with_progress(tracks):
        filtered, _, full = states_at(track, track.t, [])
        innovations.append(track.normalised_innovations()[1])
        ratio.append(_disagreement(filtered, full))
    nis = (np.concatenate(innovations) ** 2).sum(axis=1) if innovations else np.zeros(0)
    low, high = chi2_bounds(len(nis), 2)
    white = whiteness(innovations)
    bound = Z95 / np.sqrt(max(2 * len(nis), 1))
    square = np.concatenate(ratio) if ratio else np.zeros((0, 3))
    values: dict[str, Any] = {
        "innovations": len(nis),
        "nis": float(nis.mean() / 2.0) if len(nis) else np.nan,
        "nis_low": low,
        "nis_high": high,
        "autocorrelation": white.tolist(),
        "autocorrelation_bound": float(bound),
        "smoother_filter": {
            part: float(np.nanmean(square[:, k])) if len(square) else np.nan for k, part in enumerate(PARTS)
        },
    }
    records: list[dict[str, Cell]] = [
        {"check": "NIS per degree of freedom", "value": values["nis"], "expected": f"{low:.3f} to {high:.3f}"}
    ]
    for step, value in enumerate(white.tolist(), start=1):
        what = f"innovation autocorrelation, {step} step{'s' * (step > 1)}"
        records.append({"check": what, "value": value, "expected": f"±{bound:.3f}"})
    for part, value in values["smoother_filter"].items():
        what = f"squared change by smoothing / its variance, {part}"
        records.append({"check": what, "value": value, "expected": "1"})
    return values, Table.from_records(records, title="Consistency, without ground truth", digits={"value": 3})


def whiteness(normalised: Sequence[FloatArray], steps: int = WHITENESS_STEPS) -> FloatArray:
    """Autocorrelation (steps,) of normalised innovations, pooled over tracks and axes.

    Args:
        normalised: (K, 2) of each track, in order of time.
        steps: how many steps apart at most.
    """
    power = sum(float((one**2).sum()) for one in normalised)
    count = sum(one.size for one in normalised)
    out = np.full(steps, np.nan)
    for step in range(1, steps + 1):
        pairs = sum(one[step:].size for one in normalised)
        product = sum(float((one[step:] * one[:-step]).sum()) for one in normalised)
        if pairs and power > 0.0:
            out[step - 1] = (product / pairs) / (power / count)
    return out


def _disagreement(filtered: States, full: States) -> FloatArray:
    """Squared difference over difference of variances (K, 3) for p, v, a, mean of both axes; 1 is expected.

    What the future adds is independent of what the past knew, so Cov(filter − full) = P_filter − P_full.
    NaN at the end of a track, where both are the same.
    """
    squared = (filtered.mean - full.mean) ** 2
    gained = np.diagonal(filtered.cov - full.cov, axis1=2, axis2=3)
    known = gained > 1e-3 * np.diagonal(filtered.cov, axis1=2, axis2=3)
    ratio = np.where(known, squared / np.where(known, gained, 1.0), np.nan)
    both = known.all(axis=1)
    return np.asarray(np.where(both, np.where(known, ratio, 0.0).mean(axis=1), np.nan))


def chi2_bounds(count: int, freedom: int) -> tuple[float, float]:
    """95 % interval of the mean of `count` independent χ² values, per degree of freedom."""
    if not count:
        return float("nan"), float("nan")
    from scipy.special import chdtri

    total = float(count * freedom)
    return float(chdtri(total, 0.975)) / total, float(chdtri(total, 0.025)) / total
