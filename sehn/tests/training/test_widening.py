"""A wider network begins with what a narrow one has learned, and its copies learn different things."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")

from jeat_graph.data.errors import DataError  # noqa: E402
from jeat_graph_sehn.training.export import write_onnx  # noqa: E402
from jeat_graph_sehn.training.making import new_network  # noqa: E402
from jeat_graph_sehn.training.network import VehicleNet  # noqa: E402
from jeat_graph_sehn.training.settings import NetSettings  # noqa: E402
from jeat_graph_sehn.training.widening import widen  # noqa: E402

SIDE = (48, 32)
#: Sums over some hundred channels in single precision, some twenty layers one after the other.
RELATIVE = ABSOLUTE = 20 * 100 * 2.0**-24


def used(settings: NetSettings) -> VehicleNet:
    """A network whose gates and normalisations are not those of a fresh one."""
    net = new_network(settings)
    with torch.no_grad():
        for value in net.parameters():
            value.add_(0.1 * torch.randn_like(value))
        for name, value in net.named_buffers():
            if name.endswith(("running_mean", "running_var")):
                value.add_(0.2 * torch.rand_like(value))
    return net.eval()


def moments(net: VehicleNet, count: int = 3):
    """What a network says of random inputs, one moment after the other."""
    generator = torch.Generator().manual_seed(7)
    state, rows = net.empty_state(1, SIDE), []
    for _ in range(count):
        shown = [3.0 * torch.rand(v.shape, generator=generator) for v in net.inputs(SIDE).values()]
        seen, state = net.serve([*shown, *state])
        rows.append(seen)
    return torch.cat(rows)


@pytest.mark.parametrize("kind", ["frames", "events", "fused"])
@pytest.mark.parametrize("times", [2, 3])
def test_a_wide_network_says_what_the_narrow_one_says(kind, times):
    torch.manual_seed(5)
    narrow = used(NetSettings(kind=kind, width=4))
    wide = new_network(NetSettings(kind=kind, width=4 * times))
    widen(narrow, wide)
    with torch.no_grad():
        torch.testing.assert_close(
            moments(wide.eval()),
            moments(narrow),
            rtol=RELATIVE,
            atol=ABSOLUTE * float(moments(narrow).abs().max()),
        )


def test_copies_of_a_channel_learn_different_things():
    torch.manual_seed(6)
    wide = new_network(NetSettings(kind="frames", width=8))
    widen(used(NetSettings(kind="frames", width=4)), wide)
    moments(wide.train()).square().sum().backward()
    weight = wide.backbone.stem.conv.weight
    assert torch.equal(weight[0::2], weight[1::2])
    apart = (weight.grad[0::2] - weight.grad[1::2]).abs().amax(dim=(1, 2, 3))
    learned = weight.grad[0::2].abs().amax(dim=(1, 2, 3))
    asked = learned > 0.0
    assert bool(asked.any())
    assert bool((apart[asked] > 1e-3 * learned[asked]).all())


def test_a_training_begins_with_the_file_of_a_narrow_network(tmp_path):
    torch.manual_seed(8)
    narrow = used(NetSettings(kind="frames", width=4))
    write_onnx(
        narrow, SIDE, {"net": {"kind": "frames", "width": 4, "spreads": True}}, tmp_path / "narrow.onnx"
    )
    same = new_network(narrow.settings, (tmp_path / "narrow.onnx",)).eval()
    wide = new_network(NetSettings(kind="frames", width=12), (tmp_path / "narrow.onnx",)).eval()
    with torch.no_grad():
        expected = moments(same)
        torch.testing.assert_close(
            moments(wide), expected, rtol=RELATIVE, atol=ABSOLUTE * float(expected.abs().max())
        )
    with pytest.raises(DataError, match="whole part"):
        new_network(NetSettings(kind="frames", width=6), (tmp_path / "narrow.onnx",))
