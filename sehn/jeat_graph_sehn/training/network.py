"""The network: one family for pictures and for events, anchor-free, at strides of 4, 8 and 16 px.

A backbone of CSP blocks, a pyramid that carries what the coarse levels know to the fine ones, and one head
for all levels. For each cell it says where the middle of a vehicle is, how large it is, and how sure that is.
For events a memory (ConvGRU) at strides 8 and 16 keeps vehicles that have stopped; `lasting` says how long.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from jeat_graph_sehn.training.blocks import ConvBlock, ConvGru, CspBlock
from jeat_graph_sehn.training.lasting import (
    CELL_PX,
    ELAPSED_INPUT,
    TRACE_CHANNELS,
    Lasting,
    SinceThen,
    Traces,
    remembered_by_time,
)
from jeat_graph_sehn.training.settings import COARSEST, STRIDES, NetSettings

#: Names of inputs.
PICTURE_INPUT, EVENTS_INPUT = "picture", "events"
#: Numbers of a cell: two of the middle, two of the size, one of the class.
ROW = 5
#: And of its sides, left, top, right, bottom, how far off they may be.
SIDES = 4
#: Share of the cells with a vehicle that the first weights expect: so the many empty ones do not drown them.
_PRIOR = 0.01
#: A box is first about e cells wide: 11, 22 and 43 px.
_FIRST_SIZE = 1.0
_LOG_SIZE = (-3.0, 5.0)
#: Sides are first said to be off by a quarter of a cell.
_FIRST_SPREAD = -1.4
_LOG_SPREAD = (-4.0, 4.0)
#: Events of a pixel in a bin above this say no more. The first normalisation sees to their scale.
_MOST_COUNT = 8


class Backbone(nn.Module):
    """Features of pictures or of windows of events at strides of 4, 8 and 16 px.

    Args:
        channels: of the input.
        settings: width, and how its memory lasts.
        has_memory: whether it remembers windows before, at the two coarser strides.

    Attributes:
        states: channels and stride (px) of each state, fine to coarse; empty without a memory.
    """

    def __init__(self, channels: int, settings: NetSettings, has_memory: bool) -> None:
        super().__init__()
        self._keep = settings.memory_keep
        w = settings.width
        fine, middle, coarse = level_channels(w)
        self.stem = ConvBlock(channels, w, 3, 2)
        self.to_4 = nn.Sequential(ConvBlock(w, fine, 3, 2), CspBlock(fine, fine))
        self.to_8 = nn.Sequential(ConvBlock(fine, middle, 3, 2), CspBlock(middle, middle))
        self.to_16 = nn.Sequential(ConvBlock(middle, coarse, 3, 2), CspBlock(coarse, coarse, 2))
        self.states = ((middle, STRIDES[1]), (coarse, STRIDES[2])) if has_memory else ()
        self.memory = nn.ModuleList(ConvGru(channels) for channels, _ in self.states)
        self.traces: Traces | None = None
        self.lasting = nn.ModuleList()
        if has_memory and settings.by_time:
            self.lasting.extend(Lasting(*state) for state in self.states)
            self.traces = Traces(settings, fine)
            self.states = (*self.states, (TRACE_CHANNELS, CELL_PX))

    def forward(
        self,
        x: Tensor,
        state: Sequence[Tensor] = (),
        length: int = 1,
        elapsed_s: Tensor | None = None,
    ) -> tuple[tuple[Tensor, Tensor, Tensor], tuple[Tensor, ...]]:
        """Return the features (L x B, C, H/stride, W/stride), fine to coarse, and the last state.

        Arguments as `DetectionNet.forward`.
        """
        if not self.states:
            fine = self.to_4(self.stem(x))
            middle = self.to_8(fine)
            return (fine, middle, self.to_16(middle)), ()
        x = _cut_off(x)
        fine = self.to_4(self.stem(x))
        passed: SinceThen | None = None
        traced: tuple[Tensor, ...] = ()
        if self.traces is not None:
            assert elapsed_s is not None, "a memory by time gets how much has passed"
            passed, followed = self.traces.follow(x, state[2], length, elapsed_s)
            fine, traced = fine + self.traces(passed), (followed,)
        middle, of_middle = self._recall(0, self.to_8(fine), state, length, passed)
        coarse, of_coarse = self._recall(1, self.to_16(middle), state, length, passed)
        return (fine, middle, coarse), (of_middle, of_coarse, *traced)

    def _recall(
        self, level: int, x: Tensor, state: Sequence[Tensor], length: int, passed: SinceThen | None
    ) -> tuple[Tensor, Tensor]:
        """Let the memory of a level see features; return what it says, and its last state."""
        memory = self.memory[level]
        if passed is None:
            return remembered(memory, x, state[level], length, self._keep)
        lasting = self.lasting[level]
        assert isinstance(memory, ConvGru)
        assert isinstance(lasting, Lasting)
        return remembered_by_time(memory, lasting, x, state[level], length, passed)


class Head(nn.Module):
    """A pyramid that carries what coarse levels know to the fine ones, and the rows of all cells.

    How far off sides may be is learned of the same features without changing them: boxes and scores are those
    that they would be without.

    Args:
        width: of the backbone.
        spreads: whether it says how far off sides may be.
    """

    def __init__(self, width: int, spreads: bool) -> None:
        super().__init__()
        shared = 2 * width
        self.lateral = nn.ModuleList(ConvBlock(given, shared, 1) for given in level_channels(width))
        self.merge = nn.ModuleList(ConvBlock(shared, shared) for _ in range(2))
        self.tower = nn.Conv2d(shared, shared, 3, padding=1, bias=False)
        self.tower_norm = nn.ModuleList(nn.BatchNorm2d(shared) for _ in STRIDES)
        self.row = nn.Conv2d(shared, ROW, 1)
        nn.init.normal_(self.row.weight, std=0.01)
        prior = -math.log((1 - _PRIOR) / _PRIOR)
        self.row.bias = nn.Parameter(torch.tensor([0.0, 0.0, _FIRST_SIZE, _FIRST_SIZE, prior]))
        self.spread = nn.Conv2d(shared, SIDES, 1) if spreads else None
        if self.spread is not None:
            nn.init.zeros_(self.spread.weight)
            assert self.spread.bias is not None
            nn.init.constant_(self.spread.bias, _FIRST_SPREAD)

    def hold_boxes(self) -> None:
        """Keep boxes and scores as they are; how far off sides may be is still learned."""
        self.requires_grad_(False)
        if self.spread is not None:
            self.spread.requires_grad_(True)

    def forward(self, levels: tuple[Tensor, Tensor, Tensor]) -> Tensor:
        """Return rows (B, N, 5), or 9 with spreads, of features, fine to coarse."""
        fine, middle, coarse = levels
        low = self.lateral[2](coarse)
        mid = self.merge[1](self.lateral[1](middle) + _doubled(low))
        top = self.merge[0](self.lateral[0](fine) + _doubled(mid))
        rows = []
        for level, features in enumerate((top, mid, low)):
            seen = torch.relu(self.tower_norm[level](self.tower(features)))
            row = self.row(seen)
            if self.spread is not None:
                row = torch.cat([row, self.spread(seen.detach())], dim=1)
            rows.append(row.flatten(2))
        return torch.cat(rows, dim=2).transpose(1, 2)


class VehicleNet(nn.Module):
    """What networks of all kinds have in common.

    Args:
        settings: what it looks like.
        states: channels and stride (px) of each state; empty without a memory.

    Attributes:
        settings: the same.
        states: the same.
        head: says where vehicles are.
    """

    head: Head

    def __init__(self, settings: NetSettings, states: tuple[tuple[int, int], ...]) -> None:
        super().__init__()
        self.settings, self.states = settings, states

    def empty_state(self, batch: int, side: tuple[int, int]) -> tuple[Tensor, ...]:
        """Return states of nothing seen, (batch, C, height/stride, width/stride) each.

        Args:
            batch: how many sequences.
            side: width and height of the input (px), whole multiples of 16.
        """
        like = next(self.parameters())
        return tuple(
            torch.zeros(batch, channels, side[1] // s, side[0] // s, device=like.device, dtype=like.dtype)
            for channels, s in self.states
        )

    def learn(self, settled: bool) -> None:
        """Take the mode for learning.

        Args:
            settled: normalise as in use, by means and variances seen so far, and leave those as they are.
        """
        self.train()
        for layer in self.modules():
            if isinstance(layer, nn.BatchNorm2d):
                layer.train(not settled)

    def inputs(self, side: tuple[int, int]) -> dict[str, Tensor]:
        """Return what it takes in use, by name and beside its states: zeros of the right shapes.

        Args:
            side: width and height (px), whole multiples of 16.
        """
        raise NotImplementedError

    def serve(self, values: Sequence[Tensor]) -> tuple[Tensor, tuple[Tensor, ...]]:
        """Return rows (1, N, 5) and the next state, of inputs in the order of `inputs` and of the state."""
        raise NotImplementedError


class DetectionNet(VehicleNet):
    """Finds vehicles in pictures, or in events.

    Args:
        settings: what it looks like.
    """

    def __init__(self, settings: NetSettings) -> None:
        backbone = Backbone(settings.channels, settings, settings.has_memory)
        super().__init__(settings, backbone.states)
        self.backbone = backbone
        self.head = Head(settings.width, settings.spreads)

    def forward(
        self,
        x: Tensor,
        state: Sequence[Tensor] = (),
        length: int = 1,
        elapsed_s: Tensor | None = None,
    ) -> tuple[Tensor, tuple[Tensor, ...]]:
        """Look at a batch, or at windows that follow one another, of B sequences at once.

        All that has no memory looks at all windows together: that is quicker, and batch normalisation then
        knows more than one moment of few sequences.

        Args:
            x: (L x B, 3, H, W) red, green, blue of 0 to 1, or (L x B, 2 x bins, H, W) counts of events; first
                the first windows of all sequences, then the second ones.
            state: of the windows before; for a network without a memory none.
            length: L.
            elapsed_s: (L x B,) since the window before each (s), for a memory that goes by time.

        Returns:
            Rows (L x B, N, 5), fine level first, row by row: middle (cells from the cell's own), size
            (logarithm, in cells) and logit, with spreads four numbers more: logarithms, in cells, of how far
            off left, top, right and bottom are on the average; and the state after the last window.
        """
        levels, kept = self.backbone(x, state, length, elapsed_s)
        return self.head(levels), kept

    def hold_first(self) -> None:
        """Keep the layers up to the finest level as they are; the rest is learned."""
        for part in (self.backbone.stem, self.backbone.to_4):
            part.requires_grad_(False)

    def inputs(self, side: tuple[int, int]) -> dict[str, Tensor]:
        """Return what it takes in use: one picture, or one window of events."""
        name = EVENTS_INPUT if self.settings.has_memory else PICTURE_INPUT
        shown = {name: torch.zeros(1, self.settings.channels, side[1], side[0])}
        return {**shown, **elapsed_input(self.settings)}

    def serve(self, values: Sequence[Tensor]) -> tuple[Tensor, tuple[Tensor, ...]]:
        """Return rows and the next state of one picture or window."""
        if self.settings.by_time:
            rows, kept = self(values[0], values[2:], 1, values[1][:, 0])
        else:
            rows, kept = self(values[0], values[1:])
        return rows, kept


def elapsed_input(settings: NetSettings) -> dict[str, Tensor]:
    """Return the input (1, 1) that says how much time has passed, if a network takes it."""
    return {ELAPSED_INPUT: torch.full((1, 1), settings.bins * settings.bin_s)} if settings.by_time else {}


def level_channels(width: int) -> tuple[int, int, int]:
    """Return channels of the features, fine to coarse, of a network's width."""
    return 2 * width, 3 * width, 4 * width


def remembered(
    memory: nn.Module, x: Tensor, state: Tensor, length: int, keep: float
) -> tuple[Tensor, Tensor]:
    """Let a memory see windows (L x B, C, H, W) in their order; return what it says, and its last state.

    Args:
        memory: takes features and a state, and returns the next state.
        x: features, as `DetectionNet.forward` has them.
        state: (B, C, H, W) of the window before.
        length: L.
        keep: share of a state that is left at the next window.
    """
    if length == 1:
        state = memory(x, keep * state)
        return state, state
    seen = []
    for one in x.chunk(length):
        state = memory(one, keep * state)
        seen.append(state)
    return torch.cat(seen), state


def _cut_off(counts: Tensor) -> Tensor:
    """Cut off high counts, while they are bytes, and bring them to the precision of the layers."""
    device = counts.device.type
    kind = torch.get_autocast_dtype(device) if torch.is_autocast_enabled(device) else torch.float32
    return torch.clamp(counts, max=_MOST_COUNT).to(kind)


def _doubled(x: Tensor) -> Tensor:
    return nn.functional.interpolate(x, scale_factor=2.0, mode="nearest")


def cell_places(side: tuple[int, int]) -> tuple[Tensor, Tensor]:
    """Return column and row (N, 2) and stride (N,) of each cell, in the order of the network's rows.

    Args:
        side: width and height of the input (px), whole multiples of 16.

    Raises:
        ValueError: they are not.
    """
    if side[0] % COARSEST or side[1] % COARSEST:
        raise ValueError(f"{side} are no whole multiples of {COARSEST}")
    places, strides = [], []
    for stride in STRIDES:
        width, height = side[0] // stride, side[1] // stride
        row, column = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
        places.append(torch.stack([column, row], dim=-1).reshape(-1, 2).float())
        strides.append(torch.full((width * height,), float(stride)))
    return torch.cat(places), torch.cat(strides)


def centred_boxes(rows: Tensor, places: Tensor, strides: Tensor) -> Tensor:
    """Turn rows (B, N, 5 and more) into middle and size (B, N, 4) in px of the input."""
    middle = (places + 0.5 + rows[..., :2]) * strides[:, None]
    size = torch.exp(torch.clamp(rows[..., 2:4], *_LOG_SIZE)) * strides[:, None]
    return torch.cat([middle, size], dim=-1)


def served_boxes(rows: Tensor, places: Tensor, strides: Tensor) -> Tensor:
    """Turn rows (B, N, 5 and more) into middle and size in px of the input, and score, as ONNX has them.

    Returns:
        (B, 5, N).
    """
    boxes = centred_boxes(rows, places, strides)
    return torch.cat([boxes, rows[..., 4:ROW].sigmoid()], dim=-1).transpose(1, 2)


def mean_errors(rows: Tensor, strides: Tensor) -> Tensor:
    """Return how far off left, top, right and bottom are on the average (B, N, 4), px, of rows (B, N, 9)."""
    return torch.exp(torch.clamp(rows[..., ROW:], *_LOG_SPREAD)) * strides[:, None]


def served_spreads(rows: Tensor, strides: Tensor) -> Tensor:
    """Return standard deviations of the sides (B, 4, N) in px of the input, as ONNX has them.

    Of errors with a Laplace distribution, whose mean size times √2 they are.
    """
    return math.sqrt(2.0) * mean_errors(rows, strides).transpose(1, 2)


def corners_of(boxes: Tensor) -> Tensor:
    """Turn middle and size (…, 4) into left, top, right, bottom."""
    half = boxes[..., 2:] / 2.0
    return torch.cat([boxes[..., :2] - half, boxes[..., :2] + half], dim=-1)
