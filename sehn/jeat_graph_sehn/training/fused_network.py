"""The network that looks at pictures and events at once: two backbones, summed at each level through gates.

Pictures may be older than the events, or missing; so may the events. The network gets how old the picture
is and what there is, and each cell weighs what the two sensors say. What it has seen of both it remembers, at
each level: of a vehicle that one dark picture hardly shows, several show more. It is the family's early
fusion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn

from jeat_graph_sehn.training.blocks import ConvGru
from jeat_graph_sehn.training.network import (
    EVENTS_INPUT,
    PICTURE_INPUT,
    Backbone,
    Head,
    VehicleNet,
    elapsed_input,
    level_channels,
    remembered,
)
from jeat_graph_sehn.training.settings import COLOURS, STRIDES, NetSettings

#: Name of the input that says what there is: `AVAILABILITY` numbers.
GIVEN_INPUT = "given"
#: Whether there is a picture (1 or 0), its age (s), whether there are events (1 or 0).
AVAILABILITY = 3
#: The age is given in units of this (s), and above the most of them all ages are the same.
_AGE_S, _MOST_AGES = 0.1, 5.0


class SeenPictures(NamedTuple):
    """The pictures that go with windows of events.

    Attributes:
        pictures: (K, 3, H, W) red, green, blue of 0 to 1.
        which: (L x B,) the picture of each window.
        given: (L x B, 3) whether there is one, its age at the window's end (s), whether there are events.
    """

    pictures: Tensor
    which: Tensor
    given: Tensor


def silence(layer: nn.Conv2d) -> None:
    """Let a layer say nothing until it has learned something."""
    nn.init.zeros_(layer.weight)
    assert layer.bias is not None
    nn.init.zeros_(layer.bias)


class GatedSum(nn.Module):
    """Sums the features of both sensors: each cell and channel weighs them by itself.

    f = 2σ(a) p + 2σ(b) C e, where (a, b) = G [p, C e] + T given, p and e are of the picture and the events,
    and C brings what events say to the channels of the picture.

    Args:
        channels: of the features.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.carry = nn.Conv2d(channels, channels, 1)
        self.gate = nn.Conv2d(2 * channels, 2 * channels, 1)
        self.availability = nn.Linear(AVAILABILITY, 2 * channels, bias=False)
        # At first everything counts equally.
        silence(self.gate)
        nn.init.zeros_(self.availability.weight)

    def forward(self, picture: Tensor, events: Tensor, available: Tensor) -> Tensor:
        """Return the sum (B, C, H, W) of features of that shape; available: (B, 3)."""
        picture = picture * available[:, 0, None, None, None]
        events = self.carry(events) * available[:, 2, None, None, None]
        offsets = self.availability(available)[:, :, None, None]
        gates = self.gate(torch.cat([picture, events], dim=1)) + offsets
        of_picture, of_events = (2.0 * torch.sigmoid(gates)).chunk(2, dim=1)
        return of_picture * picture + of_events * events


class Recall(nn.Module):
    """Adds to the features of both what is remembered of those before: f + C h, with a memory h of f.

    Args:
        channels: of the features.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.memory = ConvGru(channels)
        self.carry = nn.Conv2d(channels, channels, 1)
        # At first nothing is added: a network that starts from others is as good as they are.
        silence(self.carry)

    def forward(self, x: Tensor, state: Tensor, length: int, keep: float) -> tuple[Tensor, Tensor]:
        """Return the sum and the last state; arguments as `remembered`."""
        seen, state = remembered(self.memory, x, state, length, keep)
        return x + self.carry(seen), state


class FusedNet(VehicleNet):
    """Finds vehicles in pictures and events together.

    Args:
        settings: what it looks like.
    """

    def __init__(self, settings: NetSettings) -> None:
        events = Backbone(settings.channels, settings, has_memory=True)
        levels = level_channels(settings.width)
        super().__init__(settings, (*events.states, *zip(levels, STRIDES, strict=True)))
        self.pictures = Backbone(COLOURS, settings, has_memory=False)
        self.events = events
        self.join = nn.ModuleList(GatedSum(channels) for channels in levels)
        self.recall = nn.ModuleList(Recall(channels) for channels in levels)
        self.head = Head(settings.width, settings.spreads)

    def hold_pictures(self) -> None:
        """Keep what looks at pictures and says where vehicles are as it is; the rest learns."""
        self.pictures.requires_grad_(False)
        self.head.hold_boxes()

    def forward(
        self,
        x: Tensor,
        state: Sequence[Tensor],
        length: int,
        seen: SeenPictures,
        elapsed_s: Tensor | None = None,
    ) -> tuple[Tensor, tuple[Tensor, ...]]:
        """Look at windows of events with the pictures that there were; arguments as `DetectionNet.forward`.

        Args:
            x: (L x B, 2 x bins, H, W) counts of events.
            state: of the windows before: that of the events, then that of both.
            length: L.
            seen: the pictures.
            elapsed_s: (L x B,) since the window before each (s), for a memory that goes by time.

        Returns:
            Rows as `DetectionNet.forward`, and the state after the last window.
        """
        count = len(self.events.states)
        of_events, kept = self.events(x, state[:count], length, elapsed_s)
        of_pictures, _ = self.pictures(seen.pictures)
        age = torch.clamp(seen.given[:, 1:2] / _AGE_S, max=_MOST_AGES)
        available = torch.cat([seen.given[:, :1], age, seen.given[:, 2:]], dim=1)
        levels = [
            join(picture[seen.which] if len(seen.which) else picture, events, available)
            for join, picture, events in zip(self.join, of_pictures, of_events, strict=True)
        ]
        for k, (recall, before) in enumerate(zip(self.recall, state[count:], strict=True)):
            levels[k], now = recall(levels[k], before, length, self.settings.memory_keep)
            kept = (*kept, now)
        rows: Tensor = self.head((levels[0], levels[1], levels[2]))
        return rows, kept

    def inputs(self, side: tuple[int, int]) -> dict[str, Tensor]:
        """Return what it takes in use: a window of events, the last picture, and what there is."""
        return {
            EVENTS_INPUT: torch.zeros(1, self.settings.channels, side[1], side[0]),
            PICTURE_INPUT: torch.zeros(1, COLOURS, side[1], side[0]),
            GIVEN_INPUT: torch.zeros(1, AVAILABILITY),
            **elapsed_input(self.settings),
        }

    def serve(self, values: Sequence[Tensor]) -> tuple[Tensor, tuple[Tensor, ...]]:
        """Return rows and the next state of a window, a picture, and what there is."""
        window, picture, given, *state = values
        elapsed_s = state.pop(0)[:, 0] if self.settings.by_time else None
        none = torch.zeros(0, dtype=torch.long)  # of one picture none need be chosen
        return self(window, state, 1, SeenPictures(picture, none, given), elapsed_s)
