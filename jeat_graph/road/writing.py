"""Writes everything that `road` writes of a recording into its folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy.typing as npt

from jeat_graph.io.tables.table_writer import write_columns
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.results import RoadResult, crossing_columns, write_result
from jeat_graph.road.road_page import write_road_page
from jeat_graph.road.traffic import SummaryConfig, count_columns, headway_columns

Columns = dict[str, npt.NDArray[Any]]


def write_road(
    result: RoadResult,
    camera: RoadCamera,
    traffic: SummaryConfig,
    name: str,
    folder: str | Path,
    dated: Callable[[Columns], Columns] = dict,
) -> None:
    """Write the tables of vehicles and of traffic, and the page.

    Args:
        result: what was found out about the vehicles.
        camera: the camera.
        traffic: how traffic is summed up; times of its tables are of the clock (`begin_s`).
        name: what the page is about.
        folder: where to.
        dated: adds dates to the columns of tables whose times are of the clock.
    """
    out = Path(folder)
    write_result(result, out)
    crossings = crossing_columns(result)
    crossings["t"] = crossings["t"] + traffic.begin_s
    write_columns(dated(crossings), out / "crossings.csv")
    write_columns(dated(count_columns(result, traffic)), out / "counts.csv")
    write_columns(dated(headway_columns(result, traffic)), out / "headways.csv")
    write_road_page(result, camera, traffic, name, out / "road.html")
