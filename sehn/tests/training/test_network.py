"""The network's memory: windows that are looked at together give what they give one after the other."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")

from jeat_graph_sehn.training.network import DetectionNet  # noqa: E402
from jeat_graph_sehn.training.settings import NetSettings  # noqa: E402

SIDE = (48, 32)
LENGTH, BATCH = 3, 2


def test_windows_together_are_windows_one_after_the_other():
    torch.manual_seed(1)
    net = DetectionNet(NetSettings(kind="events", width=4)).eval()
    shown = 3.0 * torch.rand(LENGTH, BATCH, net.settings.channels, SIDE[1], SIDE[0])
    with torch.no_grad():
        together, last = net(shown.flatten(0, 1), net.empty_state(BATCH, SIDE), LENGTH)
        state, rows = net.empty_state(BATCH, SIDE), []
        for window in shown:
            seen, state = net(window, state)
            rows.append(seen)
    torch.testing.assert_close(together, torch.cat(rows), atol=1e-5, rtol=1e-4)
    for one, other in zip(last, state, strict=True):
        torch.testing.assert_close(one, other, atol=1e-5, rtol=1e-4)


def test_what_was_seen_before_counts():
    torch.manual_seed(2)
    net = DetectionNet(NetSettings(kind="events", width=4)).eval()
    window = torch.rand(1, net.settings.channels, SIDE[1], SIDE[0])
    with torch.no_grad():
        fresh, state = net(window, net.empty_state(1, SIDE))
        again, _ = net(window, state)
    assert not torch.allclose(fresh, again)


@pytest.mark.parametrize("keep", [0.0, 0.5])
def test_of_a_memory_a_share_is_left_at_the_next_window(keep):
    torch.manual_seed(4)
    net = DetectionNet(NetSettings(kind="events", width=4, memory_keep=keep)).eval()
    whole = DetectionNet(NetSettings(kind="events", width=4, memory_keep=1.0)).eval()
    whole.load_state_dict(net.state_dict())
    window = torch.rand(1, net.settings.channels, SIDE[1], SIDE[0])
    with torch.no_grad():
        _, state = net(window, net.empty_state(1, SIDE))
        again, _ = net(window, state)
        expected, _ = whole(window, [keep * one for one in state])
    torch.testing.assert_close(again, expected)


@pytest.mark.parametrize("settled", [False, True])
def test_a_network_that_has_settled_learns_with_the_normalisation_that_it_is_used_with(settled):
    torch.manual_seed(3)
    net = DetectionNet(NetSettings(kind="frames", width=4))
    shown = torch.rand(BATCH, 3, SIDE[1], SIDE[0])
    with torch.no_grad():
        used, _ = net.eval()(shown)
        means = {name: value.clone() for name, value in net.named_buffers()}
        net.learn(settled)
        learned, _ = net(shown)
    assert net.training
    assert all(torch.equal(value, means[name]) for name, value in net.named_buffers()) == settled
    assert torch.allclose(used, learned, atol=1e-6) == settled
