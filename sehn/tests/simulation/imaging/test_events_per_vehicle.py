"""Events that a vehicle makes while it crosses the picture, beside those that a real DAVIS346 counted.

The measure is events within the vehicle's box over the pixels that it travelled and its box's height in them.
In a recording of a street by day white cars have 12 to 15 of them, and a black one 5 to 6.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.media.video import open_frames
from jeat_graph_sehn.simulation.imaging.config import load_imaging
from jeat_graph_sehn.simulation.imaging.contrast import tight_boxes
from jeat_graph_sehn.simulation.imaging.event_camera import EventCamera
from jeat_graph_sehn.simulation.imaging.paint import PALETTE
from jeat_graph_sehn.simulation.imaging.renderer import Renderer
from jeat_graph_sehn.simulation.world.camera import Camera, CameraConfig
from jeat_graph_sehn.simulation.world.light import Light
from jeat_graph_sehn.simulation.world.road import Road, RoadConfig
from jeat_graph_sehn.simulation.world.surroundings import FIXED
from jeat_graph_sehn.simulation.world.vehicles import Fleet

from .scenes import DAY, FewVehicles

STREET = Path(__file__).parents[5] / "shared" / "data" / "davis346" / "street.aedat4"
needs_street = pytest.mark.skipif(not STREET.is_file(), reason=f"{STREET} is missing")
WHITE, BLACK = PALETTE[0], PALETTE[3]
MARGIN_PX = 2.0


class Street(NamedTuple):
    """The real recording: events, times of the frames (s), frames (N, H, W)."""

    events: EventArray
    times: FloatArray
    frames: FloatArray


@cache
def street() -> Street:
    with open_events(STREET) as reader:
        events = EventArray.concatenate(list(reader.pieces()))
    with open_frames(STREET) as video:
        times = video.times_s
        frames = np.stack([video.frame(n) for n in range(len(times))])
    return Street(events, times, frames[..., 0].astype(np.float64))


def counted(events: EventArray, before: FloatArray, after: FloatArray) -> int:
    """Events within two boxes (left, top, right, bottom) together, with a margin."""
    low, high = np.minimum(before, after)[:2] - MARGIN_PX, np.maximum(before, after)[2:] + MARGIN_PX
    x, y = events.x, events.y
    return int(((x >= low[0]) & (x < high[0]) & (y >= low[1]) & (y < high[1])).sum())


def per_px(count: int, boxes: FloatArray) -> float:
    """Events over the way (px) that boxes (N, 4) went and their height."""
    centre = (boxes[:, :2] + boxes[:, 2:]) / 2.0
    way = float(np.hypot(*(centre[-1] - centre[0])))
    return count / way / float((boxes[:, 3] - boxes[:, 1]).mean())


def simulated(colour: tuple[float, float, float]) -> float:
    """A car crosses the picture of a DAVIS346 like those in the recording: 42 px long, 75 px a second."""
    width, height, period_s = 346, 260, 0.05
    camera = Camera.mounted(
        CameraConfig(
            width=width, height=height, fx=432.0, fy=432.0, cx=173.0, cy=130.0, mount_height_m=12.0,
            offset_m=-38.0, pitch_deg=15.0, yaw_deg=60.0,
        )
    )  # fmt: skip
    rows = np.array([[0.0, 4.0, 14.0, 9.4, 4.4, 1.8, 1.46]])
    nobody = Fleet(np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
    fleet = Fleet(rows[:, 0].astype(np.int64), rows[:, 4:])
    open_country = FIXED._replace(median=0, rail_left=False, rail_right=False, trees_m=0.0)
    road = Road.build(RoadConfig())
    scene: Any = FewVehicles(rows, Light(DAY), camera, road, fleet, nobody, open_country)
    config = load_imaging({"render": {"width": width, "height": height}, "evt": {"sensor": "davis346"}})
    renderer = Renderer(scene, config.render, seed=0)
    renderer._appearance.colour[:] = colour
    eye = EventCamera(renderer, config, seed=0, segment_seed=1, scale=1.0)
    boxes, count = [], 0
    for k in range(1, 15):
        events = eye.advance(round(1e6 * period_s * k))
        look = renderer.seen_at(period_s * k)[0]
        box = tight_boxes(renderer.moments(np.array([period_s * k]), look), (width, height))[0]
        boxes.append(np.concatenate([box[:2], box[:2] + box[2:]]))
        if k > 1:
            count += counted(events, boxes[-2], boxes[-1])
    return per_px(count, np.array(boxes))


@pytest.mark.parametrize(("colour", "measured"), [(WHITE, 12.0), (BLACK, 6.0)], ids=["white", "black"])
def test_a_car_makes_as_many_events_as_a_real_camera_counted(
    colour: tuple[float, float, float], measured: float
) -> None:
    assert 0.5 * measured < simulated(colour) < 2.0 * measured


@needs_street
@pytest.mark.parametrize(
    ("first", "last", "seconds", "measured"),
    [
        ((42, 223, 84, 243), (191, 177, 229, 193), (0.0, 1.68), 12.0),
        ((188, 156, 231, 175), (261, 138, 289, 151), (0.0, 2.16), 12.0),
        ((281, 160, 303, 177), (242, 173, 274, 195), (1.44, 1.92), 6.0),
    ],
    ids=["white", "white, farther", "black"],
)
def test_the_real_recording_has_them(
    first: tuple[int, ...], last: tuple[int, ...], seconds: tuple[float, float], measured: float
) -> None:
    events, times, _ = street()
    held = times[(times >= seconds[0] - 1e-3) & (times <= seconds[1] + 1e-3)]
    share = ((held - held[0]) / (held[-1] - held[0]))[:, None]
    boxes = (1.0 - share) * np.array(first) + share * np.array(last)
    count = 0
    for k in range(1, len(held)):
        at = (events.t_us >= 1e6 * held[k - 1]) & (events.t_us < 1e6 * held[k])
        count += counted(events.take(at), boxes[k - 1], boxes[k])
    assert 0.8 * measured < per_px(count, boxes) < 1.3 * measured


@needs_street
def test_thresholds_are_those_of_the_real_recording() -> None:
    """A pixel's net events against the change of the logarithm of its grey value, frame by frame."""
    events, times, frames = street()
    # A frame's time is the middle of its exposure as its file has it: 7 ms later the two agree best.
    edges = 1e6 * times + 7_000.0
    road = np.zeros(frames.shape[1:], dtype=bool)
    road[100:] = True
    change, net = [], []
    for k in range(len(times) - 1):
        at = (events.t_us >= edges[k]) & (events.t_us < edges[k + 1])
        pixel = events.y[at].astype(np.int64) * frames.shape[2] + events.x[at]
        sign = np.where(events.polarity[at], 1.0, -1.0)
        moved = np.bincount(pixel, sign, road.size)
        before, after = frames[k], frames[k + 1]
        usable = road & (np.minimum(before, after) > 18.0) & (np.maximum(before, after) < 245.0)
        usable &= np.bincount(pixel, minlength=road.size).reshape(road.shape) > 0
        change.append(np.log(after[usable] / before[usable]))
        net.append(moved.reshape(road.shape)[usable])
    step, counts = np.concatenate(change), np.concatenate(net)
    assert np.corrcoef(step, counts)[0, 1] > 0.9
    # Both have errors (grey noise; a count is a whole number): the line that treats them alike.
    found = []
    for sign in (1.0, -1.0):
        agree = (sign * step > 0.0) & (sign * counts > 0.0)
        found.append(float(np.sqrt((step[agree] ** 2).sum() / (counts[agree] ** 2).sum())))
    config = load_imaging({"evt": {"sensor": "davis346"}}).evt
    assert [config.threshold_on, config.threshold_off] == pytest.approx(found, rel=0.05)
