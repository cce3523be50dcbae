"""Labels go to the picture and clock of the sensor that learns."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.sensors import ClockConfig
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.rig.common_picture import Way, common_time, own_time
from jeat_graph_sehn.teaching.labels import TrackLabels
from jeat_graph_sehn.teaching.own_picture import beyond_views, in_own_picture, masking_bars

#: From a picture of 640 x 480 px to a common one of 1280 x 960, moved by 100 px to the right.
SCALED = PictureMap(np.array([[2.0, 0.0, 100.0, 0.0], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]))
OWN = (640, 480)


def labels(*boxes):
    """Boxes at 1 s."""
    n = len(boxes)
    truth = GroundTruth(
        t=np.ones(n),
        object_id=np.arange(n),
        boxes=np.array(boxes, dtype=float),
        motion=None,
        ignore=np.zeros(n, dtype=bool),
        frames=np.array([1.0]),
    )
    return TrackLabels(truth, np.ones(n))


def test_times_go_back_as_they_came():
    clock = ClockConfig(offset_s=0.15, drift_ppm=500.0, at_s=10.0)
    own = np.array([0.0, 10.0, 3600.0])
    assert own_time(common_time(own, clock), clock) == pytest.approx(own, abs=1e-9)


def test_boxes_go_back_through_the_map_and_the_clock():
    way = Way(SCALED, OWN, ClockConfig(offset_s=0.5))
    found = in_own_picture(labels((300.0, 200.0, 80.0, 40.0)), way, OWN)
    assert found.truth.boxes == pytest.approx(np.array([[100.0, 100.0, 40.0, 20.0]]))
    assert found.truth.t.tolist() == [1.5]
    assert found.truth.frame_times().tolist() == [1.5]


def test_boxes_end_at_the_picture_s_edge_and_what_is_mostly_outside_is_masked():
    found = in_own_picture(
        labels((-10.0, 10.0, 40.0, 20.0), (-30.0, 10.0, 40.0, 20.0), (-50.0, 10.0, 40.0, 20.0)), None, OWN
    )
    assert found.truth.boxes.tolist() == [[0.0, 10.0, 30.0, 20.0], [0.0, 10.0, 10.0, 20.0]]
    assert found.truth.ignore.tolist() == [False, True]


def test_what_no_other_sensor_sees_is_masked_at_all_times():
    # The other camera has the common picture, which begins at -50 px of this one and reaches to 590 px.
    bars = beyond_views([None], Way(SCALED, OWN, None), (1280.0, 960.0), OWN)
    assert bars == pytest.approx(np.array([[590.0, 0.0, 50.0, 480.0]]), abs=1e-6)
    assert len(beyond_views([None], None, OWN, OWN)) == 0
    found = masking_bars(labels((100.0, 100.0, 40.0, 20.0)), bars)
    assert found.truth.ignore.tolist() == [False, True]
    assert found.truth.boxes[1] == pytest.approx([590.0, 0.0, 50.0, 480.0], abs=1e-6)


def test_the_view_of_a_smaller_picture_leaves_bars_all_around():
    view = Way(PictureMap(np.diag([1.0, 1.0, 1.0, 0.0])[:3]), (320.0, 240.0), None)
    bars = beyond_views([view], None, (640.0, 480.0), OWN)
    area = np.zeros((480, 640), dtype=bool)
    for left, top, width, height in bars.astype(int).tolist():
        area[top : top + height, left : left + width] = True
    wanted = np.ones_like(area)
    wanted[:240, :320] = False
    assert (area == wanted).all()
