"""A second look at half the size: large vehicles are taken from it, small ones from the first."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")

from jeat_graph_sehn.training.export import write_onnx  # noqa: E402
from jeat_graph_sehn.training.making import looks_twice, new_network, read_network  # noqa: E402
from jeat_graph_sehn.training.network import cell_places, served_boxes  # noqa: E402
from jeat_graph_sehn.training.resizing import resized  # noqa: E402
from jeat_graph_sehn.training.serving import LARGE_PX, SMALL_PX, ServedNet  # noqa: E402
from jeat_graph_sehn.training.settings import NetSettings  # noqa: E402

SIDE, HALF = (128, 64), (64, 32)
KINDS = ["frames", "events", "fused"]


def net_of(kind):
    """A network that says boxes of all sizes."""
    torch.manual_seed(3)
    net = new_network(NetSettings(kind=kind, width=4)).eval()
    with torch.no_grad():
        for value in net.parameters():
            value.add_(0.1 * torch.randn_like(value))
        net.head.row.weight[2:4].mul_(8.0)
        net.head.row.bias[2:4] = 1.5
        net.head.row.bias[4] = 0.0
    return net


def shown_to(net, seed):
    """Two moments: inputs at full and at half size; half as wide and high by loops over 2 x 2 pixels."""
    generator = torch.Generator().manual_seed(seed)
    whole = {name: torch.rand(v.shape, generator=generator) for name, v in net.inputs(SIDE).items()}
    halved = {}
    for name, value in whole.items():
        if name == "given":
            halved[name] = value
            continue
        quads = sum(value[..., row::2, column::2] for row in (0, 1) for column in (0, 1))
        halved[name] = quads / 4.0 if name == "picture" else quads
    return tuple(whole.values()), tuple(halved.values())


def boxes_by_hand(net, shown, state, side):
    rows, kept = net.serve((*shown, *state))
    places, strides = cell_places(side)
    spreads = 2.0**0.5 * torch.exp(rows[0, :, 5:].clamp(-4.0, 4.0)) * strides[:, None]
    return served_boxes(rows, places, strides)[0].T, spreads, kept


@pytest.mark.parametrize("kind", KINDS)
def test_two_looks_are_two_networks_each_asked_for_its_sizes(kind):
    net = net_of(kind)
    served = ServedNet(net, SIDE, second_look=True)
    state, first, second = served.empty_state(), net.empty_state(1, SIDE), net.empty_state(1, HALF)
    with torch.no_grad():
        for seed in (1, 2):  # both remember, each its own
            whole, halved = shown_to(net, seed)
            boxes, spreads, *state = served(*whole, *state)
            near, of_near, first = boxes_by_hand(net, whole, first, SIDE)
            far, of_far, second = boxes_by_hand(net, halved, second, HALF)
            far = far * torch.tensor([2.0, 2.0, 2.0, 2.0, 1.0])
            torch.testing.assert_close(spreads[0].T, torch.cat([of_near, 2.0 * of_far]), rtol=1e-5, atol=1e-5)
            expected = torch.cat([near, far])
            size = (expected[:, 2] * expected[:, 3]).sqrt()
            is_near = torch.arange(len(expected)) < len(near)
            counts = torch.where(is_near, size < LARGE_PX, size > SMALL_PX)
            # Within a hair of a limit a box counts in part.
            clear = torch.where(is_near, (size - LARGE_PX).abs(), (size - SMALL_PX).abs()) > 1e-3
            assert counts[clear].any()
            assert (~counts[clear]).any()
            torch.testing.assert_close(boxes[0].T[:, :4], expected[:, :4], rtol=1e-5, atol=1e-4)
            torch.testing.assert_close(
                boxes[0].T[clear, 4], (expected[:, 4] * counts)[clear], rtol=1e-5, atol=1e-6
            )


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_that_looks_twice_holds_its_weights_once_and_is_read_back(kind, tmp_path):
    net = net_of(kind)
    card = {"net": {"kind": kind, "width": 4, "spreads": True}, "side": list(SIDE)}
    once, twice = tmp_path / "once.onnx", tmp_path / "twice.onnx"
    write_onnx(net, SIDE, card, once)
    write_onnx(net, SIDE, card, twice, second_look=True)
    assert not looks_twice(once)
    assert looks_twice(twice)
    for one, other in zip(read_network(once).parameters(), read_network(twice).parameters(), strict=True):
        assert torch.equal(one, other)
    again = resized(twice, SIDE, tmp_path / "again.onnx")
    assert not looks_twice(again)
    assert resized(again, SIDE, tmp_path / "none.onnx") == again
    import onnx

    weights = [
        sum(len(t.raw_data) for t in onnx.load(str(path)).graph.initializer if len(t.raw_data) > 64)
        for path in (once, twice)
    ]
    places = 2 * 4 * sum(HALF[0] * HALF[1] // s**2 for s in (4, 8, 16))  # of the cells of the second look
    halving = 0 if kind == "frames" else 4 * net.settings.channels**2  # of counts, for the second look
    assert weights[1] - weights[0] <= 2 * (places + halving)
