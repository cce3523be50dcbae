"""A trained network as it is used: pictures in, boxes out; large vehicles by a second look at half the size.

A network knows things of the sizes that its layers overlook. Shown a picture large enough for vehicles of a
few pixels, it sees of one that is near no more than a part. So it may look twice, the second time at the
picture made half as wide and high: small ones are taken from the first look, large ones from the second.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from jeat_graph.detection.models.layouts.record import SPREADS
from jeat_graph_sehn.training.blocks import summing
from jeat_graph_sehn.training.network import (
    EVENTS_INPUT,
    PICTURE_INPUT,
    VehicleNet,
    cell_places,
    served_boxes,
    served_spreads,
)
from jeat_graph_sehn.training.settings import COARSEST

#: Names of outputs.
BOXES = "boxes"
#: √area (px of the input) from which on the first look is not asked, and below which the second is not. What
#: lies between is asked of both: whoever is surer counts.
LARGE_PX, SMALL_PX = 96.0, 48.0
#: A box this much beyond a limit (px²) counts for nothing. Steep, and of layers that every engine knows.
_STEEPNESS = 1e3


class ServedNet(nn.Module):
    """A trained network for pictures of one size, its rows turned into boxes.

    Args:
        net: trained.
        side: width and height of the input (px), whole multiples of 16; of 32 with a second look.
        second_look: whether it looks at half the size, too.

    Attributes:
        looks: width and height of what it looks at (px), once or twice.
    """

    def __init__(self, net: VehicleNet, side: tuple[int, int], second_look: bool = False) -> None:
        super().__init__()
        self.net = net
        self.looks = (side, (side[0] // 2, side[1] // 2)) if second_look else (side,)
        self._names = tuple(net.inputs((COARSEST, COARSEST)))
        halves = second_look and EVENTS_INPUT in self._names
        self.halves = summing(net.settings.channels, 2) if halves else None
        for k, look in enumerate(self.looks):
            places, strides = cell_places(look)
            self.register_buffer(f"places_{k}", places)
            self.register_buffer(f"strides_{k}", strides)

    @property
    def outputs(self) -> list[str]:
        """Names of what it returns: boxes, spreads if it has them, and the next states."""
        states = range(len(self.looks) * len(self.net.states))
        spreads = [SPREADS] if self.net.settings.spreads else []
        return [BOXES, *spreads, *(f"next_state_{k}" for k in states)]

    def empty_state(self) -> tuple[Tensor, ...]:
        """Return the states of nothing seen: those of the first look, then those of the second."""
        return tuple(one for look in self.looks for one in self.net.empty_state(1, look))

    def forward(self, *values: Tensor) -> tuple[Tensor, ...]:
        """Return what `outputs` names, of inputs and states.

        Boxes and scores are (1, 5, N), spreads (1, 4, N).
        """
        shown, state = values[: len(self._names)], values[len(self._names) :]
        count = len(self.net.states)
        (boxes, *spreads), kept = self._look(0, shown, state[:count])
        if len(self.looks) == 1:
            return (boxes, *spreads, *kept)
        halved = [self._halved(name, value) for name, value in zip(self._names, shown, strict=True)]
        (large, *also_spreads), also_kept = self._look(1, halved, state[count:])
        large = torch.cat([2.0 * large[:, :4], large[:, 4:]], dim=1)
        both = torch.cat([_among(boxes, -1.0, LARGE_PX), _among(large, 1.0, SMALL_PX)], dim=2)
        pairs = zip(spreads, also_spreads, strict=True)
        spreads = [torch.cat([small, 2.0 * doubled], dim=2) for small, doubled in pairs]
        return (both, *spreads, *kept, *also_kept)

    def _halved(self, name: str, value: Tensor) -> Tensor:
        """Return an input at half its width and height: the mean of a picture's pixels, the sum of events."""
        if name == PICTURE_INPUT:
            return nn.functional.avg_pool2d(value, 2)
        if self.halves is None or name != EVENTS_INPUT:
            return value
        halved: Tensor = self.halves(value)
        return halved

    def _look(
        self, number: int, shown: Sequence[Tensor], state: Sequence[Tensor]
    ) -> tuple[list[Tensor], tuple[Tensor, ...]]:
        """Return boxes, and spreads if there are any; and the next states."""
        rows, kept = self.net.serve((*shown, *state))
        places, strides = self.get_buffer(f"places_{number}"), self.get_buffer(f"strides_{number}")
        found = [served_boxes(rows, places, strides)]
        if self.net.settings.spreads:
            found.append(served_spreads(rows, strides))
        return found, kept


def _among(boxes: Tensor, sign: float, limit_px: float) -> Tensor:
    """Let boxes (1, 5, N) score nothing that are not above a limit of √area (sign 1), or below it (-1)."""
    area = boxes[:, 2:3] * boxes[:, 3:4]
    counts = torch.clamp(sign * _STEEPNESS * (area - limit_px**2), 0.0, 1.0)
    return torch.cat([boxes[:, :4], counts * boxes[:, 4:]], dim=1)
