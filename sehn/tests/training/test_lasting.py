"""A memory that goes by time: how long it lasts, what opens it, and what it counts."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")

from jeat_graph.detection.models.onnx_head import read_onnx_head  # noqa: E402
from jeat_graph_sehn.training.blocks import ConvGru  # noqa: E402
from jeat_graph_sehn.training.export import write_onnx  # noqa: E402
from jeat_graph_sehn.training.lasting import (  # noqa: E402
    SPANS_S,
    TRACE_CHANNELS,
    Lasting,
    SinceThen,
    Traces,
    remembered_by_time,
)
from jeat_graph_sehn.training.making import new_network, read_network  # noqa: E402
from jeat_graph_sehn.training.network import DetectionNet  # noqa: E402
from jeat_graph_sehn.training.settings import NetSettings  # noqa: E402
from jeat_graph_sehn.training.widening import widen  # noqa: E402

SIDE = (48, 32)
NET = NetSettings(kind="events", width=4, memory="time")
LENGTH, BATCH = 3, 2
BIN_S = 0.005
OPEN = torch.ones(1, 1, 1, 1)


def counts_of(rate_hz, steps):
    """Windows (L, 20, H, W) of evenly so many events a second and pixel."""
    return torch.full((steps, 20, SIDE[1], SIDE[0]), rate_hz * BIN_S)


def test_windows_together_are_windows_one_after_the_other():
    torch.manual_seed(1)
    net = DetectionNet(NET).eval()
    torch.nn.init.normal_(net.backbone.traces.carry.weight)
    shown = 3.0 * torch.rand(LENGTH, BATCH, net.settings.channels, SIDE[1], SIDE[0])
    elapsed = 0.01 + 0.04 * torch.rand(LENGTH, BATCH)
    with torch.no_grad():
        together, last = net(shown.flatten(0, 1), net.empty_state(BATCH, SIDE), LENGTH, elapsed.flatten())
        state, rows = net.empty_state(BATCH, SIDE), []
        for window, passed in zip(shown, elapsed, strict=True):
            seen, state = net(window, state, 1, passed)
            rows.append(seen)
    torch.testing.assert_close(together, torch.cat(rows), atol=1e-5, rtol=1e-4)
    for one, other in zip(last, state, strict=True):
        torch.testing.assert_close(one, other, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("steps", [[0.05] * 8, [0.01, 0.02, 0.005, 0.05, 0.015] * 4, [0.2, 0.1]])
def test_averages_of_an_even_rate_are_that_rate_whatever_the_steps(steps):
    """From the first window on, though all averages begin empty."""
    traces, elapsed = Traces(NET, 8), torch.tensor(steps)
    state = torch.zeros(1, TRACE_CHANNELS, SIDE[1] // 4, SIDE[0] // 4)
    _, state = traces.follow(counts_of(3.0, len(steps)), state, len(steps), elapsed)
    averages = state[:, :6] / state[:, 6:]
    torch.testing.assert_close(averages, torch.full_like(averages, 16 * 3.0), rtol=1e-4, atol=0.0)


def test_an_average_falls_with_its_time_constant_once_events_stop():
    traces = Traces(NET, 8)
    state = torch.zeros(1, TRACE_CHANNELS, SIDE[1] // 4, SIDE[0] // 4)
    state[:, :6], state[:, 6:] = 100.0, 1.0
    for passed in (0.02, 0.05, 0.03):
        _, state = traces.follow(counts_of(0.0, 1), state, 1, torch.tensor([passed]))
    left = state[0, :6, 0, 0] / state[0, 6:, 0, 0]
    expected = 100.0 * np.exp(-0.1 / np.repeat(SPANS_S, 2))
    torch.testing.assert_close(left, torch.tensor(expected, dtype=torch.float32))


@pytest.mark.parametrize("times", [0.5, 4.0])
def test_what_is_added_goes_by_the_noise(times):
    """A sensor with so many times the noise and so many times the events shows the same."""
    torch.manual_seed(2)
    traces = Traces(NET, 8)
    torch.nn.init.normal_(traces.carry.weight)

    def added(factor):
        counts = counts_of(200.0 * factor, 1)
        counts[:, :, :8, :8] *= 5.0
        state = torch.zeros(1, TRACE_CHANNELS, SIDE[1] // 4, SIDE[0] // 4)
        passed, _ = traces.follow(counts, state, 1, torch.tensor([0.05]))
        with torch.no_grad():
            return traces(passed)

    torch.testing.assert_close(added(times), added(1.0), atol=0.02, rtol=0.0)
    assert added(1.0)[0, :, 0, 0].abs().max() > 0.1


def test_each_row_has_its_own_noise_and_columns_beside_the_picture_are_no_part_of_it():
    """A sky of 3 Hz over a road of 20, in the left half of the input; a vehicle's one cell is hardly seen."""
    counts = torch.zeros(1, 20, SIDE[1], SIDE[0])
    counts[:, :, :16, :24] = 3.0 * BIN_S
    counts[:, :, 16:, :24] = 20.0 * BIN_S
    counts[:, :, 20:24, 4:8] *= 30.0
    state = torch.zeros(1, TRACE_CHANNELS, SIDE[1] // 4, SIDE[0] // 4)
    passed, _ = Traces(NET, 8).follow(counts, state, 1, torch.tensor([0.05]))
    expected = 16.0 * torch.tensor([3.0] * 4 + [20.0] * 4)
    row = 5
    expected[row] *= 30.0 ** (1 / 6)
    assert passed.noise.shape == (1, 6, 8, 1)
    torch.testing.assert_close(passed.noise[0, :, :, 0], expected.expand(6, 8), rtol=0.01, atol=0.0)


def coming(hz, noise_hz, side=(20, 8)):
    """Return what a memory gets where so many events a second come in one cell, and noise elsewhere."""
    rates = torch.full((1, 6, side[1], side[0]), noise_hz)
    rates[:, :, 2, 3] = hz
    return SinceThen(torch.tensor([0.05]), rates, torch.full((1, 6, side[1], 1), noise_hz))


def test_a_state_lasts_by_time_and_not_by_windows():
    lasting = Lasting(6, 8)
    torch.nn.init.normal_(lasting.log_hz)
    once = lasting.shares(torch.tensor([0.1]), OPEN)
    often = lasting.shares(torch.full((5,), 0.02), OPEN).prod(dim=0, keepdim=True)
    torch.testing.assert_close(once, often)
    assert len(set(once.flatten().tolist())) == 6, "each channel has a time constant of its own"


def test_at_first_who_brakes_for_seconds_is_not_forgotten_though_his_events_are_seen():
    left = Lasting(3, 8).shares(torch.tensor([2.0]), OPEN).flatten()
    torch.testing.assert_close(left, torch.full((3,), math.exp(-0.25)))


@pytest.mark.parametrize("noise_hz", [0.0, 3.0, 50.0])
def test_the_gate_opens_by_what_comes_in_a_cell_and_beside_it(noise_hz):
    lasting = Lasting(6, 16)
    opened = lasting.opened(coming(20_000.0, noise_hz))
    assert opened.shape == (1, 6, 2, 5)
    assert opened[0, :, 0, 0].min() > 0.95
    assert opened[0, :, 1, 1].min() > 0.95, "a vehicle's inside has few events"
    assert opened[0, :, :, 2:].max() < 0.05


@pytest.mark.parametrize("noise_hz", [1.0, 10.0, 100.0])
def test_the_gate_opens_by_what_chance_does_not_make(noise_hz):
    """Ten standard deviations more than noise, of both polarities together, open it by half."""
    lasting = Lasting(2, 8)
    cells = 36.0
    expected = 2.0 * 0.1 * cells * 2.0 * noise_hz
    more = 10.0 * np.sqrt(expected) + 25.0  # (√n + 5)²
    evenly = coming(noise_hz, noise_hz)
    passed = evenly._replace(rates=evenly.rates + more / (2.0 * 0.1 * cells * 2.0))
    torch.testing.assert_close(lasting.opened(passed), torch.full((1, 2, 4, 10), 0.5), atol=0.15, rtol=0.0)


def test_at_first_what_is_remembered_stays_where_only_noise_comes():
    """A network by windows has forgotten half of it after a quarter of a second."""
    lasting = Lasting(4, 8)
    shares = lasting.shares(torch.tensor([0.25]), lasting.opened(coming(10.0, 10.0)))
    assert shares.min() > 0.95


def test_a_gate_that_is_closed_leaves_a_state_as_it_was():
    torch.manual_seed(3)
    memory, lasting = ConvGru(4), Lasting(4, 8)
    with torch.no_grad():
        lasting.open.bias.fill_(-50.0)
    state, noise = torch.rand(1, 4, 4, 6), torch.zeros(3, 6, 8, 1)
    passed = SinceThen(torch.full((3,), 0.05), torch.zeros(3, 6, 8, 12), noise)
    with torch.no_grad():
        _, last = remembered_by_time(memory, lasting, torch.rand(3, 4, 4, 6), state, 3, passed)
    torch.testing.assert_close(last, state)


def test_a_network_that_went_by_windows_goes_on_by_time(tmp_path):
    """What it says of events everywhere, with nothing before, is what it said: nothing new is added yet."""
    torch.manual_seed(5)
    old = DetectionNet(replace(NET, memory="windows")).eval()
    write_onnx(old, SIDE, {"net": vars(old.settings)}, tmp_path / "old.onnx")
    net = new_network(NET, [tmp_path / "old.onnx"]).eval()
    again = read_network(tmp_path / "old.onnx").eval()
    with torch.no_grad():
        for layer in net.backbone.lasting:
            layer.open.bias.fill_(50.0)  # wide open
        window = 3.0 * torch.rand(1, 20, SIDE[1], SIDE[0])
        said, _ = net(window, net.empty_state(1, SIDE), 1, torch.tensor([0.05]))
        before, _ = again(window, again.empty_state(1, SIDE))
    torch.testing.assert_close(said, before, atol=1e-5, rtol=1e-5)


def test_it_is_read_back_as_it_was_written(tmp_path):
    torch.manual_seed(6)
    net = DetectionNet(NET).eval()
    with torch.no_grad():
        torch.nn.init.normal_(net.backbone.traces.carry.weight)
        for layer in net.backbone.lasting:
            layer.log_hz.normal_()
    write_onnx(net, SIDE, {"net": vars(NET)}, tmp_path / "n.onnx")
    again = read_network(tmp_path / "n.onnx").eval()
    card = json.loads(read_onnx_head(tmp_path / "n.onnx").notes["card"])
    expected = torch.exp(-net.backbone.lasting[0].log_hz).tolist()
    assert card["lasts_s"][0] == pytest.approx(expected)
    shown = 3.0 * torch.rand(3, 20, SIDE[1], SIDE[0])
    elapsed = torch.tensor([0.05, 0.02, 0.03])
    with torch.no_grad():
        said, _ = net(shown, net.empty_state(1, SIDE), 3, elapsed)
        found, _ = again(shown, again.empty_state(1, SIDE), 3, elapsed)
    torch.testing.assert_close(found, said, atol=20 * 2.0**-11, rtol=20 * 2.0**-11)  # weights are halved


def test_a_wider_one_says_the_same():
    torch.manual_seed(7)
    narrow, wide = DetectionNet(NET).eval(), DetectionNet(replace(NET, width=8)).eval()
    torch.nn.init.normal_(narrow.backbone.traces.carry.weight)
    widen(narrow, wide)
    shown, elapsed = 3.0 * torch.rand(3, 20, SIDE[1], SIDE[0]), torch.tensor([0.05, 0.02, 0.03])
    with torch.no_grad():
        said, _ = narrow(shown, narrow.empty_state(1, SIDE), 3, elapsed)
        again, _ = wide(shown, wide.empty_state(1, SIDE), 3, elapsed)
    torch.testing.assert_close(again, said, atol=1e-4, rtol=1e-4)
