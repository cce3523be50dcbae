"""At the frames of formats that count them a table says what motion says, and nothing beyond its time."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.trajectories import Trajectories
from jeat_graph.runs.frame_export import at_frames

from .tables import SIZE, SPEED, uniform_motion

RATE_HZ = 20.0
#: Between the frames, so that each has to be predicted or interpolated.
INSTANTS = 0.013 + 0.03 * np.arange(30)


@pytest.mark.parametrize("kind", ["causal", "smoothed"])
def test_uniform_motion_stays_what_it_is(kind):
    at = at_frames(uniform_motion(INSTANTS), kind, INSTANTS, RATE_HZ)
    frames = at.t * RATE_HZ
    assert len(at) >= 16
    np.testing.assert_allclose(frames, np.round(frames), atol=1e-9)
    assert len(np.unique(at.t)) == len(at)
    np.testing.assert_allclose(at.mean[:, 0], SPEED * at.t, atol=1e-6)
    np.testing.assert_allclose(at.boxes[:, 0], SPEED * at.t - SIZE[0] / 2.0, atol=1e-6)
    np.testing.assert_allclose(at.boxes[:, 2:], np.tile(SIZE, (len(at), 1)), atol=1e-6)


def test_a_causal_frame_knows_nothing_of_what_came_later():
    table = uniform_motion(INSTANTS)
    turned = uniform_motion(INSTANTS)
    turned.mean[15:, 0] += 300.0
    turned.boxes[15:, 0] += 300.0
    one, other = (at_frames(each, "causal", INSTANTS, RATE_HZ) for each in (table, turned))
    before = one.t < INSTANTS[15]
    assert before.any()
    np.testing.assert_array_equal(one.boxes[before], other.boxes[before])
    assert (other.boxes[~before, 0] > one.boxes[~before, 0] + 250.0).all()


def test_there_is_no_frame_before_the_first_instant():
    assert at_frames(uniform_motion(INSTANTS), "causal", INSTANTS, RATE_HZ).t[0] == pytest.approx(0.05)


@pytest.mark.parametrize("rate", [24.0, 29.97, 31.0, 60.0])
def test_a_frame_at_the_very_first_instant_comes_out(rate):
    for k in range(1, 200):
        instants = np.arange(k, k + 4) / rate
        assert at_frames(uniform_motion(instants), "causal", instants, rate).t[0] == instants[0]


def test_no_rows_give_no_rows():
    empty = Trajectories.empty(("rgb",))
    assert len(at_frames(empty, "causal", INSTANTS, RATE_HZ)) == 0
    assert len(at_frames(uniform_motion(INSTANTS), "causal", np.zeros(0), RATE_HZ)) == 0
