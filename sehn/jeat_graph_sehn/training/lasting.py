"""A memory that knows how much time has passed: leaky counts of events, and states that last as learnt.

Where a vehicle stands there are no events. What is remembered of it then lasts, for the update gate closes
where no more events come than noise makes, and each channel forgets with a time constant of its own, which
is learnt: after Δt of any length a share exp(-Δt/τ) is left. What creeps shows in the sum of some seconds: of
each polarity there are leaky averages of the rate of events, in units of what most of the picture has: noise.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor, nn

from jeat_graph_sehn.training.blocks import ConvGru
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
#: Time constants of the states at first (s) are those of a memory that goes by windows, which in training are
#: so far apart on average (s).
_USUAL_STEP_S = 0.035
_FIRST_S = (0.05, 30.0)
#: The gate at first: wide open, and wider where more comes than noise in the shortest average. One that
#: closed at once, untrained, cost 12 points of AP50 (of 73), with these times and with 3 s.
_FIRST_GAIN, _FIRST_OFFSET = 1.0, 4.0


class SinceThen(NamedTuple):
    """What a memory gets of windows.

    Attributes:
        elapsed_s: (L x B,) time since the window before each (s); at the first that of the window itself.
        activity: (L x B, 6, H/4, W/4) logarithm of the leaky averages, in units of the noise.
    """

    elapsed_s: Tensor
    activity: Tensor


class Traces(nn.Module):
    """Leaky averages of events, as features that are added to those of the finest level.

    s' = e s + (1 - e) r with e = exp(-Δt/τ) and r the rate in the last Δt; a weight w follows likewise the
    number 1, so s/w is right from the first window on. The feature is log((s/w + ε) / (n + ε)), where n is
    the geometric mean over the picture of the slowest average: few cells have vehicles, so it is the noise.

    Args:
        settings: bins of the windows, and width.
        channels: of the features that it adds to.
    """

    ages: Tensor
    spans: Tensor

    def __init__(self, settings: NetSettings, channels: int) -> None:
        super().__init__()
        self._bin_s, self._bins = settings.bin_s, settings.bins
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

    def follow(self, counts: Tensor, state: Tensor, length: int, elapsed_s: Tensor) -> tuple[Tensor, Tensor]:
        """Return the activity (L x B, 6, H/4, W/4) of windows that follow one another, and the last state.

        Args:
            counts: (L x B, 2 x bins, H, W), from old to new, each first darker, then brighter.
            state: (B, 12, H/4, W/4) of the window before.
            length: L.
            elapsed_s: (L x B,) since the window before each; of what is longer than a window, the window
                stands for all.
        """
        pooled = float(CELL_PX**2) * nn.functional.avg_pool2d(counts, CELL_PX)
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
        logs = torch.log(together[:, :FEATURES] / together[:, FEATURES:] + _LEAST_HZ)
        noise = logs[:, FEATURES - 2 :].mean(dim=(2, 3), keepdim=True)
        return logs - torch.cat([noise] * len(SPANS_S), dim=1), state

    def forward(self, activity: Tensor) -> Tensor:
        """Return what is added to the features (L x B, channels, H/4, W/4)."""
        added: Tensor = self.carry(torch.relu(self.see(activity)))
        return added


class Lasting(nn.Module):
    """How long each channel of a state lasts, and where it may change.

    Args:
        channels: of the state.
        stride: of its cells (px).
        keep: share that is left at a window of usual length, at first.

    Attributes:
        log_hz: (channels,) logarithm of 1/τ (1/s).
    """

    def __init__(self, channels: int, stride: int, keep: float) -> None:
        super().__init__()
        self._times = stride // CELL_PX
        short, long = _FIRST_S
        lasts_s = long if keep >= 1.0 else -_USUAL_STEP_S / math.log(max(keep, 1e-9))
        first = math.log(min(max(lasts_s, short), long))
        self.log_hz = nn.Parameter(torch.full((channels,), -first))
        self.open = nn.Conv2d(FEATURES, channels, 1)
        nn.init.zeros_(self.open.weight)
        with torch.no_grad():
            self.open.weight[:, :2] = _FIRST_GAIN
            assert self.open.bias is not None
            self.open.bias.fill_(_FIRST_OFFSET)

    def shares(self, elapsed_s: Tensor) -> Tensor:
        """Return the share (N, channels, 1, 1) of a state that is left after times (N,) in seconds."""
        return torch.exp(-elapsed_s[:, None] * torch.exp(self.log_hz))[:, :, None, None]

    def opened(self, activity: Tensor) -> Tensor:
        """Return how far the update gate may open (N, channels, H/stride, W/stride), 0 to 1."""
        nearby = nn.functional.max_pool2d(activity, self._times)
        return torch.sigmoid(self.open(nearby))


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
    shares, opened = lasting.shares(passed.elapsed_s), lasting.opened(passed.activity)
    seen = []
    for one, share, gate in zip(x.chunk(length), shares.chunk(length), opened.chunk(length), strict=True):
        state = memory(one, share * state, gate)
        seen.append(state)
    return torch.cat(seen) if length > 1 else state, state
