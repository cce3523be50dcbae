"""A wider network that says what a narrow one says, to be trained on: what was learned is not lost.

Each channel of the narrow network becomes several that carry the same; a layer that reads them takes from
each a share of what it took from the one, drawn at random. The shares add up to one, so nothing changes what
the network says; they differ, so its copies learn different things from the first step on.

Source: Chen, Goodfellow and Shlens, "Net2Net: Accelerating learning via knowledge transfer" (2016).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from jeat_graph_sehn.training.lasting import Lasting
from jeat_graph_sehn.training.network import VehicleNet

#: Shares of k copies are drawn from (1 ± this) / k: copies that count equally would learn the same for long.
_SPREAD = 0.5


@torch.no_grad()
def widen(narrow: VehicleNet, wide: VehicleNet) -> None:
    """Give a wide network weights by which it says what a narrow one says, but for rounding.

    Args:
        narrow: its weights are left as they are.
        wide: of the same kind, and a whole multiple as wide. Random numbers are PyTorch's own.
    """
    of_narrow = dict(narrow.named_modules())
    for name, layer in wide.named_modules():
        given = of_narrow[name]
        if isinstance(layer, Lasting):
            assert isinstance(given, Lasting)
            layer.log_hz.copy_(_copies(given.log_hz, len(layer.log_hz)))
        if isinstance(layer, nn.Conv2d | nn.Linear):
            assert isinstance(given, nn.Conv2d | nn.Linear)
            layer.weight.copy_(_weight(given.weight, layer.weight))
            if layer.bias is not None and given.bias is not None:
                layer.bias.copy_(_copies(given.bias, len(layer.bias)))
        elif isinstance(layer, nn.BatchNorm2d):
            for mine, old in zip(layer.state_dict().values(), given.state_dict().values(), strict=True):
                mine.copy_(_copies(old, len(mine)) if mine.ndim else old)


def _weight(given: Tensor, like: Tensor) -> Tensor:
    """Return weights (O', I', …) that do with copies what those given (O, I, …) do with the channels."""
    rows = _copies(given, like.shape[0])
    times = like.shape[1] // given.shape[1]
    if times == 1:
        return rows
    drawn = _SPREAD * (2.0 * torch.rand(*rows.shape[:2], times) - 1.0)
    shares = (1.0 + drawn - drawn.mean(dim=2, keepdim=True)) / times
    shares = shares.reshape(*shares.shape, *(1,) * (rows.ndim - 2))
    return (rows[:, :, None] * shares).flatten(1, 2)


def _copies(given: Tensor, count: int) -> Tensor:
    """Return `count` rows: each of those given as often, one after the other.

    Side by side, so that what is put behind one another (both halves of a block, what comes and what is
    remembered) stays in its place.
    """
    return given.repeat_interleave(count // len(given), dim=0)
