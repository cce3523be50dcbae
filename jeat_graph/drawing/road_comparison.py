"""The plot of filter and smoother on the road: errors against distance, beside what is said of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from jeat_graph.drawing.palette import FILTER, FULL

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PARTS = (
    ("across_rmse_m", "Across the road: RMSE (m)"),
    ("along_rmse_m", "Along the road: RMSE (m)"),
    ("speed_rmse_kmh", "Speed: RMSE (km/h)"),
    ("speed_held", "95 % intervals of the speed that hold (%)"),
)
_NOMINAL = 95.0


def road_errors(plt: Any, values: Mapping[str, Any]) -> Figure:
    """Draw errors of place and speed against the distance.

    Args:
        plt: pyplot.
        values: of `eval.road_compare.compare_road`.
    """
    groups = values["by_distance"]
    middle = np.array([(one["from_m"] + one["to_m"]) / 2.0 for one in groups])
    figure, axes = plt.subplots(1, len(_PARTS), figsize=(14.0, 3.6), layout="constrained")
    for axis, (key, title) in zip(axes, _PARTS, strict=True):
        for name, colour in (("filter", FILTER), ("smoothed", FULL)):
            found = np.array([one[name].get(key, np.nan) for one in groups])
            axis.plot(middle, found, color=colour, lw=2.0, marker="o", ms=4, label=name)
        if key == "speed_held":
            axis.axhline(_NOMINAL, color="0.5", lw=1.0, ls="--")
        else:
            axis.set_ylim(bottom=0.0)
        axis.set_title(title)
        axis.set_xlabel("distance along the road (m)")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure  # type: ignore[no-any-return]
