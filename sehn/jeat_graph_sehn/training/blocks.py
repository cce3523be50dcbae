"""Layers that the networks are made of."""

from __future__ import annotations

import torch
from torch import Tensor, nn


class ConvBlock(nn.Module):
    """Convolution, batch normalisation, ReLU: (B, C, H, W) to (B, D, H/stride, W/stride)."""

    def __init__(self, given: int, made: int, kernel: int = 3, stride: int = 1) -> None:
        super().__init__()
        self.conv = nn.Conv2d(given, made, kernel, stride, kernel // 2, bias=False)
        self.norm = nn.BatchNorm2d(made)

    def forward(self, x: Tensor) -> Tensor:
        """Return the features."""
        return torch.relu_(self.norm(self.conv(x)))


def summing(channels: int, size: int) -> nn.Conv2d:
    """Return a layer that sums size x size pixels of each channel: (B, C, H, W) to (B, C, H/size, W/size).

    A convolution, though it learns nothing: engines add up 8-bit numbers by it in a tenth of the time of a
    mean, which they compute in single precision. Channel by channel it would be less work, and takes longer.
    """
    layer = nn.Conv2d(channels, channels, size, size, bias=False)
    layer.requires_grad_(False)
    with torch.no_grad():
        layer.weight.copy_(torch.eye(channels)[:, :, None, None].expand_as(layer.weight))
    return layer


class CspBlock(nn.Module):
    """Half of the channels go through residual convolutions, half around them: cheaper, and gradients differ.

    Source: Wang et al., "CSPNet: A new backbone that can enhance learning capability of CNN" (2020).
    """

    def __init__(self, given: int, made: int, depth: int = 1) -> None:
        super().__init__()
        half = made // 2
        self.around = ConvBlock(given, half, 1)
        self.inward = ConvBlock(given, half, 1)
        self.steps = nn.ModuleList(
            nn.Sequential(ConvBlock(half, half), ConvBlock(half, half)) for _ in range(depth)
        )
        self.join = ConvBlock(2 * half, made, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Return features (B, made, H, W) of x (B, given, H, W)."""
        inner = self.inward(x)
        for step in self.steps:
            inner = inner + step(inner)
        joined: Tensor = self.join(torch.cat([self.around(x), inner], dim=1))
        return joined


class ConvGru(nn.Module):
    """A memory in each cell of the features, which also sees its neighbours' (depthwise 3 x 3).

    h' = h + z (n - h), z, r = σ(W [x, m]), n = tanh(V [x, r m]), m = h + depthwise(h).

    Source: Ballas et al., "Delving Deeper into Convolutional Networks for Learning Video Representations"
    (2016); depthwise as in RVT (Gehrig and Scaramuzza, 2023).
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.near = nn.Conv2d(channels, channels, 3, padding=1, groups=channels)
        self.gates = nn.Conv2d(2 * channels, 2 * channels, 1)
        self.candidate = nn.Conv2d(2 * channels, channels, 1)

    def forward(self, x: Tensor, state: Tensor, most: Tensor | None = None) -> Tensor:
        """Return the next state (B, C, H, W), which is the output as well.

        Args:
            x: (B, C, H, W) features.
            state: of the window before.
            most: (B, C, H, W) what is left of the update gate z, 0 to 1; None: all.
        """
        seen = state + self.near(state)
        update, reset = torch.sigmoid(self.gates(torch.cat([x, seen], dim=1))).chunk(2, dim=1)
        if most is not None:
            update = update * most
        fresh = torch.tanh(self.candidate(torch.cat([x, reset * seen], dim=1)))
        return state + update * (fresh - state)
