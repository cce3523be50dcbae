"""A memory that knows how much time has passed: leaky counts of events, and states that last as learnt.

Where a vehicle stands there are no events. What is remembered of it then lasts, for a gate closes where no
more events come than noise makes: nothing is learned there, and nothing is forgotten. Where it is open, each
channel forgets with a time constant of its own, which is learnt: after Δt of any length a share exp(-gΔt/τ)
is left, g how far the gate is open. What creeps shows in the sum of some seconds: of each polarity there are
leaky averages of the rate of events, in units of what most of their row of the picture has: noise.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor, nn

from jeat_graph_sehn.training.blocks import ConvGru, summing
from jeat_graph_sehn.training.settings import STRIDES, NetSettings

#: Name of the input that says how much time has passed since the window before (s).
ELAPSED_INPUT = "elapsed"
#: Time constants of the leaky averages (s): what drives, what creeps, and what has just stopped.
SPANS_S = (0.1, 0.5, 2.0)
#: They are kept of cells as large as the finest level's (px): a slow vehicle's edge is one to two wide.
CELL_PX = STRIDES[0]
#: Each of two polarities.
FEATURES = 2 * len(SPANS_S)
#: Channels of their state: the averages, and how much of each is filled since the beginning.
TRACE_CHANNELS = 2 * FEATURES
#: Events of a cell in a second that cannot be distinguished from none: so cells without noise have a
#: logarithm.
_LEAST_HZ = 0.5
#: Time constants of the states at first (s). Who brakes makes fewer and fewer events, his gate open for all
#: that time: a state that fades in a fraction of a second has lost him before he stands. What is over,
#: the memory's own update tells.
_FIRST_S = 8.0
#: Of so many cells about each one, by side, the gate sees the sum: a vehicle's inside has few events.
_NEARBY = 3
#: By so many standard deviations of the noise it counts, up to this many times that.
_DEVIATIONS, _MOST_TIMES = 10.0, 2.0
#: Anscombe's: with it roots of few events spread as those of many.
_ADDED = 0.375
#: The gate at first: half open at ten standard deviations in the shortest average, both polarities together.
#: From a gate that was wide open two trainings did not get to one that closes: gradients go back a few
#: windows. What to forget shows at once, in boxes where nobody is any more.
_FIRST_GAIN, _FIRST_OFFSET = 5.0, -5.0


class SinceThen(NamedTuple):
    """What a memory gets of windows.

    Attributes:
        elapsed_s: (L x B,) time since the window before each (s); at the first that of the window itself.
        rates: (L x B, 6, H/4, W/4) leaky averages of events (1/s).
        noise: (L x B, 6, H/4, 1) of these what most of each row has.
    """

    elapsed_s: Tensor
    rates: Tensor
    noise: Tensor


class Traces(nn.Module):
    """Leaky averages of events, as features that are added to those of the finest level.

    s' = e s + (1 - e) r with e = exp(-Δt/τ) and r the rate in the last Δt; a weight w follows likewise the
    number 1, so s/w is right from the first window on. The feature is log((s/w + ε) / (n + ε)), where n is
    the geometric mean over the row of the slowest average: few of its cells have vehicles, so it is noise.
    A sky has another than a road, the far end of it another than the near one, and all the more at night: a
    mean over the picture takes the noise of a tenth to a third of it for more than noise.

    Args:
        settings: bins of the windows, and width.
        channels: of the features that it adds to.

    Attributes:
        sums: of the counts of each cell, bin by bin.
    """

    ages: Tensor
    spans: Tensor

    def __init__(self, settings: NetSettings, channels: int) -> None:
        super().__init__()
        self._bin_s, self._bins = settings.bin_s, settings.bins
        self.sums = summing(settings.channels, CELL_PX)
        self.see = nn.Conv2d(FEATURES, settings.width, 3, padding=1)
        self.carry = nn.Conv2d(settings.width, channels, 1)
        # At first nothing is added: a network that starts from one without is as good as that one is.
        nn.init.zeros_(self.carry.weight)
        assert self.carry.bias is not None
        nn.init.zeros_(self.carry.bias)
        ages = settings.bin_s * torch.arange(settings.bins - 1, -1, -1).repeat_interleave(2)
        self.register_buffer("ages", ages.float(), persistent=False)
        spans = torch.tensor(SPANS_S).repeat_interleave(2).repeat(2)
        self.register_buffer("spans", spans, persistent=False)

    def follow(
        self, counts: Tensor, state: Tensor, length: int, elapsed_s: Tensor
    ) -> tuple[SinceThen, Tensor]:
        """Return what comes in windows that follow one another, and the last state.

        Args:
            counts: (L x B, 2 x bins, H, W), from old to new, each first darker, then brighter.
            state: (B, 12, H/4, W/4) of the window before.
            length: L.
            elapsed_s: (L x B,) since the window before each; of what is longer than a window, the window
                stands for all.
        """
        pooled: Tensor = self.sums(counts)
        within = torch.clamp((elapsed_s[:, None] - self.ages) / self._bin_s, 0.0, 1.0)
        height, width = pooled.shape[2:]
        newest = pooled * within[:, :, None, None]
        summed = newest.reshape(-1, self._bins, 2, height * width).sum(dim=1).reshape(-1, 2, height, width)
        seen_s = torch.clamp(elapsed_s, self._bin_s, self._bin_s * self._bins)
        rates = summed / seen_s[:, None, None, None]
        left = torch.exp(-elapsed_s[:, None] / self.spans)[:, :, None, None]
        given = torch.cat([rates] * len(SPANS_S) + [rates * 0.0 + 1.0] * len(SPANS_S), dim=1)
        found = []
        for share, now in zip(left.chunk(length), given.chunk(length), strict=True):
            state = state * share + now * (1.0 - share)
            found.append(state)
        together = torch.cat(found) if length > 1 else state
        averages = together[:, :FEATURES] / together[:, FEATURES:]
        noise = _noise_by_row(averages[:, FEATURES - 2 :])
        return SinceThen(elapsed_s, averages, torch.cat([noise] * len(SPANS_S), dim=1)), state

    def forward(self, passed: SinceThen) -> Tensor:
        """Return what is added to the features (L x B, channels, H/4, W/4)."""
        activity = torch.log((passed.rates + _LEAST_HZ) / (passed.noise + _LEAST_HZ))
        added: Tensor = self.carry(torch.relu(self.see(activity)))
        return added


def _noise_by_row(rates: Tensor) -> Tensor:
    """Return the geometric mean over each row (N, 2, H, 1) of rates (N, 2, H, W) of events (1/s).

    Columns without a single event are beside the camera's picture, where its shape is not the input's.
    """
    seen = (rates.amax(dim=(1, 2), keepdim=True) > 0.0).to(rates.dtype)
    logs = (torch.log(rates + _LEAST_HZ) * seen).sum(dim=3, keepdim=True)
    return torch.exp(logs / torch.clamp(seen.sum(dim=3, keepdim=True), min=1.0)) - _LEAST_HZ


class Lasting(nn.Module):
    """Where a state may change, and how long each of its channels lasts there.

    Args:
        channels: of the state.
        stride: of its cells (px).

    Attributes:
        log_hz: (channels,) logarithm of 1/τ (1/s) where the gate is open.
    """

    counts: Tensor

    def __init__(self, channels: int, stride: int) -> None:
        super().__init__()
        self._times = stride // CELL_PX
        self.log_hz = nn.Parameter(torch.full((channels,), -math.log(_FIRST_S)))
        # How many events an average of 1/s is nearby.
        spans = torch.tensor(SPANS_S).repeat_interleave(2)
        counts = 2.0 * float(_NEARBY * self._times) ** 2 * spans
        self.register_buffer("counts", counts[:, None, None], persistent=False)
        self.open = nn.Conv2d(FEATURES, channels, 1)
        nn.init.zeros_(self.open.weight)
        with torch.no_grad():
            self.open.weight[:, :2] = _FIRST_GAIN / math.sqrt(2.0)
            assert self.open.bias is not None
            self.open.bias.fill_(_FIRST_OFFSET)

    def shares(self, elapsed_s: Tensor, opened: Tensor) -> Tensor:
        """Return the share (N, channels, H, W) of a state that is left after times (N,) in seconds.

        Args:
            elapsed_s: times.
            opened: (N, channels, H, W) how far the gate is open.
        """
        rates = elapsed_s[:, None] * torch.exp(self.log_hz)
        return torch.exp(-opened * rates[:, :, None, None])

    def opened(self, passed: SinceThen) -> Tensor:
        """Return how far the gate is open (N, channels, H/stride, W/stride), 0 to 1.

        It sees by how many standard deviations more events come nearby than noise makes: twice the difference
        of the roots of what came and what is expected, in twice an average's time constant. In the dark,
        where noise is strong, what moves makes little more than that, and yet certainly more.

        Source: Anscombe, "The transformation of Poisson, binomial and negative-binomial data" (1948).
        """
        nearby = nn.functional.avg_pool2d(passed.rates, self._times)
        nearby = nn.functional.avg_pool2d(nearby, _NEARBY, 1, _NEARBY // 2, count_include_pad=False)
        noise = nn.functional.avg_pool2d(passed.noise, (self._times, 1))
        came, expected = (torch.sqrt(one * self.counts + _ADDED) for one in (nearby, noise))
        above = (2.0 / _DEVIATIONS) * (came - expected)
        return torch.sigmoid(self.open(torch.clamp(above, -_MOST_TIMES, _MOST_TIMES)))


def remembered_by_time(
    memory: ConvGru, lasting: Lasting, x: Tensor, state: Tensor, length: int, passed: SinceThen
) -> tuple[Tensor, Tensor]:
    """Let a memory see windows (L x B, C, H, W) in their order; return what it says, and its last state.

    Args:
        memory: of the features.
        lasting: how long its state lasts.
        x: features, first the first windows of all sequences.
        state: (B, C, H, W) of the window before.
        length: L.
        passed: time, and what came.
    """
    opened = lasting.opened(passed)
    shares = lasting.shares(passed.elapsed_s, opened)
    seen = []
    for one, share, gate in zip(x.chunk(length), shares.chunk(length), opened.chunk(length), strict=True):
        state = memory(one, share * state, gate)
        seen.append(state)
    return torch.cat(seen) if length > 1 else state, state
