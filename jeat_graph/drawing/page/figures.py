"""Puts the plots of a comparison into the page, as images within the HTML."""

from __future__ import annotations

import base64
import tempfile
from dataclasses import dataclass
from pathlib import Path

from jeat_graph.eval.compare import Comparison
from jeat_graph.eval.tables import Table


@dataclass(frozen=True)
class Figure:
    """One picture.

    Attributes:
        source: a `data:` address with the picture itself.
        alt: what it shows, with its figures.
        caption: a sentence below it.
    """

    source: str
    alt: str
    caption: str


@dataclass(frozen=True)
class ComparedRun:
    """Filter against smoothers on the measurements of the run.

    Attributes:
        tables: errors and consistency.
        figures: pictures, none without truth.
    """

    tables: tuple[Table, ...]
    figures: tuple[Figure, ...]


def compared_run(comparison: Comparison) -> ComparedRun:
    """Draw what a comparison allows and take it into memory."""
    from jeat_graph.drawing.comparison import write_plots

    figures = []
    with tempfile.TemporaryDirectory() as folder:
        for path in write_plots(comparison, folder, (".svg",)):
            alt, caption = _TEXTS[path.stem]
            figures.append(Figure(_address(path), alt + _figures_of(comparison, path.stem), caption))
    return ComparedRun(tuple(comparison.tables), tuple(figures))


def _address(path: Path) -> str:
    return "data:image/svg+xml;base64," + base64.b64encode(path.read_bytes()).decode("ascii")


_TEXTS = {
    "trajectories": (
        "Error of x and velocity in x of tracks that go far, filter and smoothed, with 2σ bands",
        "Tracks that go far, against the truth. An honest band holds the truth 95 % of the time; the "
        "smoother's is narrower.",
    ),
    "error-over-time": (
        "RMSE of position and velocity over time, for the filter, a short lag, and the whole track",
        "Errors of all tracks, in bins of time.",
    ),
    "rmse-against-lag": (
        "RMSE of position, velocity and acceleration against the smoother's lag",
        "What delay buys: a lag of 0 is the filter, the dashed line the smoother over whole tracks.",
    ),
    "road-errors": (
        "RMSE across and along the road and of the speed, and the intervals that hold, against the distance",
        "On the road: filter and smoother at the same rows, against the truth in metres and km/h.",
    ),
}


def _figures_of(comparison: Comparison, name: str) -> str:
    if name != "rmse-against-lag":
        return "."
    errors = comparison.values["errors"]
    parts = [
        f"{part} {errors['filter'][f'{part}_rmse']:.3g} {unit} for the filter and "
        f"{errors['full'][f'{part}_rmse']:.3g} {unit} for the whole track"
        for part, unit in (("position", "px"), ("velocity", "px/s"), ("acceleration", "px/s²"))
    ]
    return ": " + "; ".join(parts) + "."
