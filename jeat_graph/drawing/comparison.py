"""Plots of a comparison of filter and smoothers: tracks with 2σ bands, error over time, error against lag."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.progress import with_progress
from jeat_graph.drawing.palette import AXES, FILTER, FULL, GRID, LAGGED, TRUTH
from jeat_graph.eval.compare import Comparison
from jeat_graph.eval.samples import Samples, lag_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_TRACKS = 3
BIN_S = 0.5
LONGEST_LINE_S = 0.25
_STYLE: Any = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "axes.edgecolor": AXES,
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "figure.dpi": 110,
    "svg.hashsalt": "jeat-graph",  # ids inside the SVG are then the same each time
}


def write_plots(
    comparison: Comparison, folder: str | Path, suffixes: tuple[str, ...] = (".png", ".svg")
) -> list[Path]:
    """Draw all pictures that a comparison with truth allows.

    Args:
        comparison: with samples, or with errors on the road; without them nothing is drawn.
        folder: where to write.
        suffixes: the formats to write each in.

    Returns:
        The files written.
    """
    on_road = comparison.values.get("road", {})
    samples, written = comparison.samples, list[Path]()
    seen = samples is not None and len(samples) > 0
    if not seen and not on_road.get("by_distance"):
        return []
    import matplotlib as mpl
    from matplotlib import pyplot as plt

    from jeat_graph.drawing.road_comparison import road_errors
    from jeat_graph.io.files.atomic import atomic_path

    backend = mpl.get_backend()
    plt.switch_backend("agg")
    try:
        with mpl.rc_context(_STYLE):
            figures: dict[str, Callable[[], Figure]] = {}
            if samples is not None and seen:
                figures = {
                    "trajectories": lambda: _trajectories(plt, samples),
                    "error-over-time": lambda: _error_over_time(plt, samples, comparison.lags_s),
                    "rmse-against-lag": lambda: _rmse_against_lag(plt, comparison),
                }
            if on_road.get("by_distance"):
                figures["road-errors"] = lambda: road_errors(plt, on_road)
            for name, draw in with_progress(figures.items()):
                figure = draw()
                for suffix in with_progress(suffixes):
                    path = Path(folder) / (name + suffix)
                    with atomic_path(path) as temporary:
                        figure.savefig(temporary, metadata={"Date": None} if suffix == ".svg" else None)
                    # Laid out once: to do so for each format takes as long as to draw it.
                    figure.set_layout_engine("none")
                    written.append(path)
                plt.close(figure)
    finally:
        plt.switch_backend(backend)
    return written


def _trajectories(plt: Any, samples: Samples) -> Figure:
    """Position error and velocity of well-observed tracks that go far, with 2σ bands."""
    chosen = informative_tracks(samples)
    parts = ((0, "error of x", "px"), (1, "velocity in x", "px/s"))[: 1 + samples.has_motion]
    figure, axes = plt.subplots(
        len(chosen), len(parts), figsize=(11.0, 2.7 * len(chosen) + 0.8), squeeze=False, layout="constrained"
    )
    for row, identity in enumerate(chosen.tolist()):
        mine = np.flatnonzero(samples.track_id == identity)
        mine = mine[np.argsort(samples.t[mine])]
        for column, (order, title, unit) in enumerate(parts):
            axis = axes[row, column]
            # Where the track was not matched for a while, a line would claim what nobody measured.
            t = np.where(np.diff(samples.t[mine], append=np.inf) > LONGEST_LINE_S, np.nan, samples.t[mine])
            true = samples.truth[mine, 0, order]
            for name, colour, alpha in (("filter", FILTER, 0.20), ("full", FULL, 0.35)):
                value = samples.states[name].mean[mine, 0, order] - (true if order == 0 else 0.0)
                sigma = np.sqrt(samples.states[name].cov[mine, 0, order, order])
                axis.fill_between(
                    t, value - 2.0 * sigma, value + 2.0 * sigma, color=colour, alpha=alpha, lw=0
                )
                label = {"filter": "filter ± 2σ", "full": "smoothed ± 2σ"}[name]
                axis.plot(t, value, color=colour, lw=1.4, label=label)
            axis.plot(t, 0.0 * t if order == 0 else true, color=TRUTH, lw=1.0, ls="--", label="truth")
            _limit(axis, samples, mine, order)
            axis.set_title(f"track {identity}: {title}")
            axis.set_ylabel(unit)
    for axis in axes[-1]:
        axis.set_xlabel("time (s)")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure  # type: ignore[no-any-return]


def informative_tracks(samples: Samples) -> IntArray:
    """Choose the tracks that are drawn: of the better-observed half those that go furthest in the picture.

    The longest tracks of all are parked cars, which show nothing of motion.
    """
    ids, index, count = np.unique(samples.track_id, return_inverse=True, return_counts=True)
    place = samples.truth[:, :, 0]
    way = np.array([np.hypot(*np.ptp(place[index == k], axis=0)) for k in range(len(ids))])
    way[count < np.median(count)] = -1.0
    return np.asarray(ids[np.argsort(-way, kind="stable")[:MOST_TRACKS]], dtype=np.int64)


def _limit(axis: Any, samples: Samples, mine: Any, order: int) -> None:
    """Keep the wide band of a track's first moments from flattening all the rest."""
    true = samples.truth[mine, 0, order]
    values = [samples.states[name].mean[mine, 0, order] for name in ("filter", "full")]
    if order == 0:
        values = [value - true for value in values]
    else:
        values.append(true)
    spread = np.sqrt(samples.states["filter"].cov[mine, 0, order, order])
    low, high = np.quantile(np.concatenate(values), [0.01, 0.99])
    margin = 3.0 * float(np.median(spread))
    axis.set_ylim(low - margin, high + margin)


def _error_over_time(plt: Any, samples: Samples, lags_s: Sequence[float]) -> Figure:
    """RMSE of all tracks in bins of time, for the filter, one lag between, and the whole track."""
    middle = min((lag for lag in lags_s if lag > 0.0), key=lambda lag: abs(lag - 0.2), default=0.0)
    shown = [("filter", "filter", FILTER), ("full", "whole track", FULL)]
    if middle > 0.0:
        shown.insert(1, (lag_name(middle), f"lag {middle:g} s", LAGGED))
    start = samples.t.min()
    bin_ = ((samples.t - start) / BIN_S).astype(int)
    centre = start + (np.arange(bin_.max() + 1) + 0.5) * BIN_S
    parts = ((0, "Position", "px"), (1, "Velocity", "px/s"))[: 1 + samples.has_motion]
    figure, grid = plt.subplots(
        len(parts), 1, figsize=(9.0, 2.8 * len(parts)), sharex=True, squeeze=False, layout="constrained"
    )
    axes = grid[:, 0]
    for axis, (order, title, unit) in zip(axes, parts, strict=True):
        for name, label, colour in shown:
            error = samples.states[name].mean[:, :, order] - samples.truth[:, :, order]
            axis.plot(centre, _binned_rmse(error, bin_), color=colour, lw=1.8, label=label)
        axis.set_ylim(bottom=0.0)
        axis.set_title(f"{title}: RMSE of all tracks ({unit}), in bins of {BIN_S:g} s")
    axes[-1].set_xlabel("time (s)")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure  # type: ignore[no-any-return]


def _binned_rmse(error: FloatArray, bin_: Any) -> FloatArray:
    count = np.bincount(bin_)
    total = np.bincount(bin_, weights=(error**2).sum(axis=1))
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(total / np.where(count > 0, count, np.nan)))


def _rmse_against_lag(plt: Any, comparison: Comparison) -> Figure:
    """How much accuracy how much delay buys."""
    curve, errors = comparison.values["lag_curve"], comparison.values["errors"]
    lags = np.array([one["lag_s"] for one in curve])
    units = {"position": "px", "velocity": "px/s", "acceleration": "px/s²"}
    parts = [part for part in units if np.isfinite(errors["filter"][f"{part}_rmse"])]
    figure, axes = plt.subplots(
        1, len(parts), figsize=(4.0 * max(len(parts), 2), 3.8), squeeze=False, layout="constrained"
    )
    for axis, part in zip(axes[0], parts, strict=True):
        unit = units[part]
        value = np.array([one[f"{part}_rmse"] for one in curve])
        full, base = errors["full"][f"{part}_rmse"], errors["filter"][f"{part}_rmse"]
        axis.plot(lags, value, color=FULL, lw=2.0, marker="o", ms=4)
        axis.axhline(full, color=TRUTH, lw=1.0, ls="--")
        above = full > base  # on the side of the line that the filter's point is not on
        text = f"whole track {full:.3g} {unit} ({100.0 * full / base:.0f} % of the filter's)"
        axis.annotate(
            text,
            (1.0, full),
            xycoords=("axes fraction", "data"),
            xytext=(0, 5 if above else -5),
            textcoords="offset points",
            ha="right",
            va="bottom" if above else "top",
            fontsize=9,
        )
        axis.annotate(
            f"filter {base:.3g} {unit}",
            (lags[0], value[0]),
            xytext=(8, -8 if above else 0),
            textcoords="offset points",
            va="center",
            fontsize=9,
            color=FILTER,
        )
        axis.plot(lags[:1], value[:1], color=FILTER, marker="o", ms=6, ls="")
        axis.set_ylim(0.0, 1.12 * max(value.max(), base))
        axis.set_title(f"{part.capitalize()} RMSE ({unit})")
        axis.set_xlabel("lag (s)")
    return figure  # type: ignore[no-any-return]
