"""What either camera has to go by in a night without any lamp: a vehicle's signal over its box's noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.scenario import load_scenario

from .scenes import small

MOVES_PX_S = 5.0


def signals(lux: float, longest_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of moving vehicles: contrast-to-noise of a pixel, of the box in a picture, of its events in 50 ms.

    That of a box of A pixels is that of a pixel times √A; that of events is those by motion over the square
    root of those by noise.
    """
    night = load_scenario("night-unlit")
    night = replace(night, light=replace(night.light, ambient_lux=lux))
    imaging = small({"rgb": {"max_exposure_s": longest_s}}, width=320, height=192)
    pixel, box, events = [], [], []
    step = list(RenderedSource(night, imaging, seed=7, frames=2).segment(0))[1]
    truth, seen = step.truth, step.events
    assert seen.by_motion is not None
    for k in np.flatnonzero(~truth.ignore & (np.hypot(*truth.motion[:, 2:4].T) > MOVES_PX_S)):
        left, top, wide, high = truth.boxes[k]
        within = (seen.x >= left) & (seen.x < left + wide) & (seen.y >= top) & (seen.y < top + high)
        pixel.append(truth.contrast[k])
        box.append(truth.contrast[k] * np.sqrt(wide * high))
        events.append((within & seen.by_motion).sum() / np.sqrt(max((within & ~seen.by_motion).sum(), 1)))
    assert len(pixel) > 10
    return np.array(pixel), np.array(box), np.array(events)


def test_under_the_moon_no_vehicle_stands_out_in_any_pixel() -> None:
    pixel, _, _ = signals(0.3, 0.02)
    assert (pixel < 2.0).all()


@pytest.mark.parametrize("lux", [1.0, 3.0])
def test_events_show_more_than_short_exposures_and_no_more_than_long_ones(lux: float) -> None:
    _, short, events = signals(lux, 0.005)
    _, long, same = signals(lux, 0.02)
    assert np.array_equal(events, same)
    assert np.median(events) > 1.3 * np.median(short)
    assert np.median(long) > 0.8 * np.median(events)
