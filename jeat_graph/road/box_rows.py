"""Boxes of one vehicle as the road's least squares takes them: from the tracker's log, or from a table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.road.box_channels import HIGH, LOW, NEITHER, WHOLE
from jeat_graph.road.box_errors import BoxRows
from jeat_graph.road.camera import RoadCamera

#: Share of the variance of detectors' boxes that lasts, and for how long (s), as the tracker takes them.
LASTING_SHARE = ModelConstants().error_share / (1.0 + ModelConstants().error_share)
MEMORY_S = ModelConstants().error_time_s

_CUT_SIGMAS = 2.0  # a side this many standard deviations from the picture's edge may be cut off by it


@dataclass(frozen=True)
class BoxConfig:
    """How boxes err, beyond what the tracker says of its sensors."""

    side_px: float = number(
        0.7, "px", "error of a smoothed box's side that does not depend on size", open_low=True
    )
    side_share: float = number(0.015, "1", "error of a smoothed box's side as a share of the box's size")
    white_share: float = number(
        0.1, "1", "share of a smoothed box's variance which is new in every box", 0.0, 1.0
    )
    memory_s: float = number(1.0, "s", "how long the rest of it persists", open_low=True)
    bin_s: float = number(0.06, "s", "a sensor's boxes this close together are taken as their mean")
    most_boxes: int = number(600, "boxes", "of longer tracks the bins are wider", 8)
    edge_px: float = number(2.0, "px", "a side this near the picture's edge is cut off by it")

    def __post_init__(self) -> None:
        check(self)


def rows_of_log(log: RecordArray, sensors: int, size: tuple[int, int], config: BoxConfig) -> BoxRows:
    """Boxes that a track took in, each with the noise with which the filter weighed it.

    Args:
        log: (M,) records of `filters.measurement.MEASUREMENT`, in order of time.
        sensors: how many there are.
        size: width and height of the picture (px).
        config: thinning and edges.
    """
    size_var = log["size_var"]
    white = np.concatenate([log["r"], size_var * (1.0 - LASTING_SHARE)], axis=1)
    coloured = np.concatenate([log["coloured_std"], np.sqrt(size_var * LASTING_SHARE)], axis=1)
    z = np.concatenate([log["z"], log["log_size"]], axis=1)
    rows = BoxRows(
        log["t"].astype(np.float64),
        z,
        white,
        coloured,
        np.zeros((len(z), 2), dtype=np.int64),
        log["sensor"].astype(np.int64),
        np.full(sensors, MEMORY_S),
    )
    return binned(cut_at_edges(rows, size, config), config)


def rows_of_table(
    t: FloatArray, boxes: FloatArray, stated: FloatArray, size: tuple[int, int], config: BoxConfig
) -> BoxRows:
    """Smoothed boxes: their errors hardly change from row to row.

    Args:
        t: (N,) times, ascending (s).
        boxes: (N, 4) left, top, width, height (px).
        stated: (N, 4) variances of their middles, of width and height as the tracker states them (px²); NaN
            where it states none.
        size: width and height of the picture (px).
        config: how such boxes err.
    """
    extent = np.maximum(boxes[:, 2:], 1e-3)
    z = np.concatenate([boxes[:, :2] + extent / 2.0, np.log(extent)], axis=1)
    side = config.side_px**2 + (config.side_share * extent) ** 2
    given = np.nan_to_num(stated)
    total = np.concatenate([side / 2.0 + given[:, :2], (2.0 * side + given[:, 2:]) / extent**2], axis=1)
    rows = BoxRows(
        np.asarray(t, dtype=np.float64),
        z,
        config.white_share * total,
        np.sqrt((1.0 - config.white_share) * total),
        np.zeros((len(t), 2), dtype=np.int64),
        np.zeros(len(t), dtype=np.int64),
        np.array([config.memory_s]),
    )
    return binned(cut_at_edges(rows, size, config), config)


def cut_at_edges(rows: BoxRows, size: tuple[int, int], config: BoxConfig) -> BoxRows:
    """Tell which sides the picture cuts off; the side that is left takes the place of the centre."""
    extent = np.exp(rows.z[:, 2:])
    low, high = rows.z[:, :2] - extent / 2.0, rows.z[:, :2] + extent / 2.0
    variance = rows.white + rows.coloured**2
    margin = config.edge_px + _CUT_SIGMAS * np.sqrt(variance[:, :2] + extent**2 / 4.0 * variance[:, 2:])
    # What hardly wanders off (a smoothed table) needs no margin of many pixels.
    margin = np.minimum(margin, 0.25 * extent + config.edge_px)
    sees_low, sees_high = low > margin, high < np.array(size) - margin
    mode: IntArray = np.where(
        sees_low & sees_high, WHOLE, np.where(sees_low, LOW, np.where(sees_high, HIGH, NEITHER))
    )
    z, white, coloured = rows.z.copy(), rows.white.copy(), rows.coloured.copy()
    one = (mode == LOW) | (mode == HIGH)
    quarter = np.where(one, extent**2 / 4.0, 0.0)
    z[:, :2] = np.where(mode == LOW, low, np.where(mode == HIGH, high, rows.z[:, :2]))
    white[:, :2] += quarter * rows.white[:, 2:]
    coloured[:, :2] = np.sqrt(coloured[:, :2] ** 2 + quarter * rows.coloured[:, 2:] ** 2)
    return rows._replace(z=z, white=white, coloured=coloured, mode=mode)


def binned(rows: BoxRows, config: BoxConfig) -> BoxRows:
    """Average a sensor's neighbouring boxes of the same mode: white errors fall, the others stay."""
    if not len(rows.t):
        return rows
    t = rows.t - rows.t[0]
    width = max(config.bin_s, float(t[-1]) * len(rows.memory_s) / config.most_boxes)
    cell = np.floor(t / width + 1e-9).astype(np.int64) if width > 0 else np.arange(len(t))
    key = ((cell * len(rows.memory_s) + rows.group) * 4 + rows.mode[:, 0]) * 4 + rows.mode[:, 1]
    _, first, of, count = np.unique(key, return_index=True, return_inverse=True, return_counts=True)

    def mean(values: FloatArray) -> FloatArray:
        columns = values.reshape(len(values), -1).T
        sums = [np.bincount(of, column, minlength=len(count)) for column in columns]
        return np.stack(sums, axis=1) / count[:, None]

    middle = mean(rows.t)[:, 0]
    order = np.lexsort((rows.group[first], middle))
    white = mean(rows.white) / count[:, None]
    return BoxRows(
        middle[order],
        np.ascontiguousarray(mean(rows.z)[order]),
        np.ascontiguousarray(white[order]),
        np.ascontiguousarray(mean(rows.coloured)[order]),
        np.ascontiguousarray(rows.mode[first][order]),
        np.ascontiguousarray(rows.group[first][order]),
        rows.memory_s,
    )


def contact_places(rows: BoxRows, camera: RoadCamera) -> FloatArray:
    """Where the middles of the lower edges are on the road (N, 2); NaN where a side is cut off."""
    x, y = rows.mode.T
    bottom = rows.z[:, 1] + np.where(y == WHOLE, np.exp(rows.z[:, 3]) / 2.0, 0.0)
    place = camera.to_road(np.stack([rows.z[:, 0], bottom], axis=1))
    seen = (x == WHOLE) & ((y == WHOLE) | (y == HIGH))
    return np.where(seen[:, None], place, np.nan)
