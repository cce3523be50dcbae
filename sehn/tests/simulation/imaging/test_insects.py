"""Insects before the lens: seen by both cameras, unknown to the truth."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.events import EventArray
from jeat_graph_sehn.simulation.imaging.event_camera import EventCamera
from jeat_graph_sehn.simulation.imaging.insects import RADIUS, SOFT, Insects, U, V, draw_insects
from jeat_graph_sehn.simulation.imaging.lighting import LUMINANCE
from jeat_graph_sehn.simulation.imaging.renderer import Renderer
from jeat_graph_sehn.simulation.imaging.rgb_camera import expose
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.streams import stream

from .scenes import DAY, IDEAL, LAMPS, renderer_of, small

WAY_PX_S = 800.0


def with_one(renderer: Renderer, colour: float) -> Renderer:
    """Let one insect cross the road's picture from left to right, in its middle after 0.2 s."""
    view, depth = renderer.view, 0.5
    x = (96.0 - view.lens[2]) / view.lens[0] * depth
    y = (90.0 - view.lens[3]) / view.lens[1] * depth
    renderer._insects = Insects(
        middle=np.array([0.2]),
        place=np.array([[x, y, depth]]),
        velocity=np.array([[WAY_PX_S / view.lens[0] * depth, 0.0, 0.0]]),
        wave=np.zeros((1, 3)),
        turn=np.zeros((1, 2)),
        radius=np.array([0.01]),
        colour=np.full(3, colour),
    )
    return renderer


def test_an_exposure_smears_it_along_its_way() -> None:
    exposure = 0.02
    renderer = with_one(renderer_of([], DAY), 0.0)
    lost = 1.0 - (expose(renderer, 0.2, exposure, 0.0) @ LUMINANCE) / (renderer.background.whole @ LUMINANCE)
    row = lost[90]
    record = renderer._insects.at(np.array([0.2]), renderer.view)[0, 0]
    # What it takes of a row's light, summed along the row, does not depend on how fast it goes.
    reach = record[RADIUS] + record[SOFT]
    touched = np.flatnonzero(row > 1e-9)
    assert touched[-1] - touched[0] + 1 == pytest.approx(WAY_PX_S * exposure + 2.0 * reach, abs=3.0)
    assert row.sum() == pytest.approx(2.0 * record[RADIUS], rel=0.05)
    assert lost[:70].max() == 0.0


def test_its_events_are_a_burst_along_its_way_and_nowhere_else() -> None:
    renderer = with_one(renderer_of([], DAY), 0.0)
    config = small({"evt": IDEAL | {"dark_luminance": 1.0}}, width=192, height=112)
    eye = EventCamera(renderer, config, seed=0, segment_seed=1, scale=1.0)
    parts = [eye.advance(50_000 * k) for k in range(1, 9)]
    events = EventArray.concatenate(parts)
    path = renderer._insects.at(1e-6 * events.t_us.astype(np.float64), renderer.view)[:, 0]
    away = np.hypot(events.x + 0.5 - path[:, U], events.y + 0.5 - path[:, V])
    assert len(events) > 100
    # Light that comes back to just a threshold crosses it or not by rounding, which differs by processor.
    near = away < path[:, RADIUS] + path[:, SOFT] + 2.5
    assert np.count_nonzero(~near) < 1e-4 * len(events)
    assert (np.abs(events.y + 0.5 - path[:, V]) < path[:, RADIUS] + path[:, SOFT] + 2.5).all()
    assert len(parts[-1]) == 0
    # What it darkened has become as bright again: each pixel ends where it began.
    pixel = events.y.astype(np.int64) * 192 + events.x
    assert np.abs(np.bincount(pixel, 2.0 * events.polarity - 1.0)).max() <= 1.0


def test_it_is_dark_by_day_and_lit_by_lamps_at_night() -> None:
    shares = []
    for light in (DAY, LAMPS):
        made = renderer_of([], light, insects_hz=5.0)
        road = float(np.median(made.background.whole[60:] @ LUMINANCE))
        shares.append(float(made._insects.colour @ LUMINANCE) / road)
    assert shares[0] < 1.0 < shares[1]


def test_truth_knows_nothing_of_them_and_the_rate_is_kept() -> None:
    scenario = load_scenario("day")
    made = []
    for rate in (0.0, 20.0):
        source = RenderedSource(scenario, small({"render": {"insects_hz": rate}}), seed=2, frames=2)
        made.append(list(source.segment(0)))
    for without, among in zip(*made, strict=True):
        assert np.array_equal(without.truth.boxes, among.truth.boxes)
        assert np.array_equal(without.truth.tight, among.truth.tight)
    assert any((a.rgb != b.rgb).any() for a, b in zip(*made, strict=True))
    renderer = renderer_of([], DAY)
    count = len(draw_insects(stream(0, "insects"), 2.0, renderer.view, renderer.lights).middle)
    assert count == pytest.approx(1200, abs=4 * np.sqrt(1200))
