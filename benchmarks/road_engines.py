"""What other smoothers make of a run on the road: the factor graph, and the picture's smoothed table."""

from __future__ import annotations

import tempfile
from pathlib import Path

from jeat_graph.road.camera import RoadCamera

#: Names of the tables.
GRAPH, PICTURE = "smoothed, graph", "of smoothed.csv"


def judge_engines(run: Path, truth: Path, camera: RoadCamera) -> dict[str, dict[str, float | int]]:
    """Scores on the road by name of the smoother.

    Args:
        run: a run directory with `measurements.parquet` and `smoothed.csv`.
        truth: of the road.
        camera: the camera.
    """
    from jeat_graph.eval.road import judge_road_run
    from jeat_graph.io.tables.trajectories_io import read_trajectories
    from jeat_graph.road.box_rows import BoxConfig
    from jeat_graph.road.boxes_road import boxes_of_table, follow_boxes
    from jeat_graph.road.cuboid_fit import CuboidConfig
    from jeat_graph.road.run_tables import write_smoothed
    from jeat_graph.road.taken_boxes import boxes_of_log
    from jeat_graph.runs.directory import ROAD_SMOOTHED
    from jeat_graph.runs.measured import measurement_rows

    smoothed = read_trajectories(run / "smoothed.csv")
    taken = boxes_of_log(measurement_rows(run)[0], smoothed, camera, BoxConfig())
    picture = boxes_of_table(smoothed, camera, BoxConfig())
    found = {}
    for name, boxes, smoother in ((GRAPH, taken, "graph"), (PICTURE, picture, "spline")):
        with tempfile.TemporaryDirectory() as folder:
            write_smoothed(
                follow_boxes(boxes, camera, CuboidConfig(), smoother=smoother).vehicles, Path(folder)
            )
            found[name] = judge_road_run(Path(folder) / ROAD_SMOOTHED, truth)["road_smoothed"]
    return found
