"""A clock that drifts is followed by what boxes of two sensors show; what shows nothing changes nothing."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.clocks import SECONDS, draw, mota, track
from jeat_graph.data.scan import Scan
from jeat_graph.live.clock_drift import ClockDrift

RATES = {"rgb": 20.0, "evt": 50.0}


def scans(lag_s: float, noise_px: float = 1.5, speed: float = 300.0, seconds: float = 20.0) -> list[Scan]:
    """One vehicle after another; the event camera's clock is ahead by `lag_s`."""
    rng = np.random.default_rng(5)
    out = []
    for name, rate in RATES.items():
        for k in range(int(seconds * rate)):
            t = k / rate
            x = 100.0 + (speed * t) % 1500.0
            centre = np.array([[x, 300.0], [1900.0 - x, 700.0]]) + rng.normal(0.0, noise_px, (2, 2))
            boxes = np.concatenate([centre - [40.0, 30.0], np.tile([80.0, 60.0], (2, 1))], axis=1)
            out.append(Scan(t + lag_s * (name == "evt"), name, boxes, np.full(2, 0.9)))
    return sorted(out, key=lambda scan: scan.t)


def first_found(given: list[Scan]) -> tuple[float, float] | None:
    watch = ClockDrift()
    for scan in given:
        found = watch.saw([scan], "rgb")
        if found:
            return found["evt"].lag_s, found["evt"].std_s
    return None


@pytest.mark.parametrize("lag_s", [0.03, -0.03])
def test_the_lag_of_boxes_along_their_motion_is_that_of_the_clock(lag_s: float) -> None:
    found = first_found(scans(lag_s))
    assert found is not None
    assert found[0] == pytest.approx(lag_s, abs=4.0 * found[1])
    assert found[1] < 0.003


@pytest.mark.parametrize(
    "given",
    [
        pytest.param(scans(0.0), id="clocks that agree"),
        pytest.param(scans(0.005), id="less than moves a box by its noise"),
        pytest.param(scans(0.03, speed=10.0), id="vehicles that hardly move"),
        pytest.param(scans(0.03, noise_px=60.0), id="boxes that scatter by as much as they are apart"),
    ],
)
def test_what_does_not_tell_changes_nothing(given: list[Scan]) -> None:
    assert first_found(given) is None


def test_it_goes_on_from_its_state_to_the_bit() -> None:
    given = scans(0.03)
    one, other = ClockDrift(), ClockDrift()
    half = len(given) // 4
    for scan in given[:half]:
        one.saw([scan], "rgb")
    other.set_state(one.state())
    for scan in given[half:]:
        assert one.saw([scan], "rgb") == other.saw([scan], "rgb")
    assert json.dumps(one.state(), default=np.ndarray.tolist) == json.dumps(
        other.state(), default=np.ndarray.tolist
    )


def test_a_drift_of_2000_ppm_costs_no_more_than_two_points() -> None:
    stream, truth = draw(7, SECONDS)
    plain = mota(track(stream, "evt", lambda t: 0.0), truth)
    assert plain - mota(track(stream, "evt", lambda t: 2e-3 * t), truth) <= 2.0
