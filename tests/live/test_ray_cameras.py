"""The recipe for live cameras: an actor whose process is killed goes on from its checkpoint."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from jeat_graph import Tracker
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.live.late import LiveTracker

PAGE = Path(__file__).parents[2] / "docs" / "guides" / "batch.md"


@pytest.mark.slow
def test_a_killed_camera_goes_on_where_it_was(simulated, tmp_path):
    ray = pytest.importorskip("ray", reason="Ray is not installed")
    (recipe,) = re.findall(r"```ray\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    names: dict = {}
    exec(compile(recipe, "recipe", "exec"), names)
    detections = read_detections(simulated(1) / "detections.csv")
    scans = [detections.scan(k) for k in range(detections.num_scans)]
    alone = LiveTracker(Tracker("default"))
    expected = [alone.step(scan).table for scan in scans]
    ray.init(num_cpus=2, include_dashboard=False, logging_level="error", log_to_driver=False)
    try:
        camera = names["Camera"].remote("north", tmp_path, "default", every_s=0.3)
        half = len(scans) // 2
        saved_at = 0.0
        for scan in scans[:half]:
            *_, saved_at = ray.get(camera.step.remote(scan.t, scan.sensor, scan.boxes, scan.scores))
        assert saved_at > 0.3
        ray.kill(camera, no_restart=False)
        for scan, table in zip(scans, expected, strict=True):
            if scan.t <= saved_at - 0.3:
                continue
            answer = camera.step.remote(scan.t, scan.sensor, scan.boxes, scan.scores)
            track_id, boxes, _ = ray.get(answer)
            if scan.t > scans[half].t:
                np.testing.assert_array_equal(track_id, table.track_id)
                np.testing.assert_array_equal(boxes, table.boxes)
    finally:
        ray.shutdown()
