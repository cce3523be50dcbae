"""Whether a taught network is better than before: by how much, how sure that is, and what it forgot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray


class Held(NamedTuple):
    """Average precision at IoU 0.50 (%) on what was held back.

    Attributes:
        all: of all pieces together.
        pieces: (K,) of each piece; NaN where nothing is asked for.
        boxes: (K,) how many boxes are asked for in each.
    """

    all: float
    pieces: FloatArray
    boxes: FloatArray


class TeachingOutcome(NamedTuple):
    """What teaching did.

    Attributes:
        before: AP50 on the held-back part of the own road (%).
        after: the same of the taught network.
        sigma: standard error of the gain (points); NaN where one piece alone says something.
        old_before: AP50 on old worlds (%); NaN without any.
        old_after: the same of the taught network.
    """

    before: float
    after: float
    sigma: float
    old_before: float
    old_after: float

    @property
    def gain(self) -> float:
        """Points of AP50 that it is better by."""
        return self.after - self.before

    @property
    def lost(self) -> float:
        """Points of AP50 that it is worse by on old worlds; 0 without any."""
        return 0.0 if np.isnan(self.old_before) else self.old_before - self.old_after

    def described(self) -> list[str]:
        """Return it in words, a line each."""
        sure = "" if np.isnan(self.sigma) else f" ± {self.sigma:.1f}"
        lines = [f"own road, held back: AP50 {self.before:.1f} -> {self.after:.1f} ({self.gain:+.1f}{sure})"]
        if not np.isnan(self.old_before):
            lines.append(
                f"old worlds: AP50 {self.old_before:.1f} -> {self.old_after:.1f} ({-self.lost:+.1f})"
            )
        return lines

    def refusal(self, least_gain: float, most_lost: float) -> str | None:
        """Return why it is not to be kept, or None.

        Args:
            least_gain: points that it must gain; also more than the standard error of the gain.
            most_lost: points that it may lose on old worlds.
        """
        if not self.gain >= least_gain:
            return f"it gained {self.gain:.1f} points of AP50, and {least_gain:g} are asked for"
        if not np.isnan(self.sigma) and self.gain <= self.sigma:
            return f"it gained {self.gain:.1f} points of AP50, no more than chance ({self.sigma:.1f})"
        if self.lost > most_lost:
            return f"it lost {self.lost:.1f} points of AP50 on old worlds, and {most_lost:g} are allowed"
        return None


def compared(before: Held, after: Held, old_before: float, old_after: float) -> TeachingOutcome:
    """Compare a network before and after on the same pieces.

    The standard error is that of the mean of the pieces' differences, weighed by the boxes each asks for.
    """
    known = np.isfinite(before.pieces) & np.isfinite(after.pieces)
    change, weight = (after.pieces - before.pieces)[known], before.boxes[known]
    count, sigma = len(change), float("nan")
    if count > 1:
        away = change - np.average(change, weights=weight)
        sigma = float(np.sqrt(((weight * away) ** 2).sum() * count / (count - 1)) / weight.sum())
    return TeachingOutcome(before.all, after.all, sigma, old_before, old_after)
