"""At which times the smoothed table has rows: `smoother.output_rate_hz`."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.config.smoothing import LAGGED
from jeat_graph.data.trajectories import Trajectories

# A time that is an interval's begin but for rounding is in it.
_ROUNDING = 1e-9
# With a lag a row is given out after two of it at most; times older than so many are forgotten.
_LAGS_KEPT = 4.0


class SmoothedInstants:
    """Keeps rows at the first step of each interval of the output's rate; all of them without a rate.

    Args:
        config: of which the smoother's settings matter.
    """

    def __init__(self, config: Config) -> None:
        self._rate_hz = config.smoother.output_rate_hz
        self._lag_s = config.smoother.lag_s if config.smoother.engine in LAGGED else math.inf
        self._bin = -math.inf
        self._wanted: deque[float] = deque()

    def note(self, t: float) -> None:
        """Take note of a step that the smoother gets; in order of time."""
        if self._rate_hz <= 0.0:
            return
        interval = math.floor(t * self._rate_hz + _ROUNDING)
        if interval > self._bin:
            self._bin = interval
            self._wanted.append(t)
        while self._wanted and self._wanted[0] < t - _LAGS_KEPT * self._lag_s:
            self._wanted.popleft()

    def reset(self) -> None:
        """Let times begin again from any moment."""
        self._bin = -math.inf

    def of(self, table: Trajectories) -> Trajectories:
        """Return the rows of a table that are wanted."""
        if self._rate_hz <= 0.0:
            return table
        return table.take(np.isin(table.t, np.array(self._wanted)))

    def state(self) -> dict[str, Any]:
        """Return plain data for `set_state`."""
        return {"bin": self._bin, "wanted": np.array(self._wanted, dtype=np.float64)}

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned."""
        self._bin, self._wanted = float(state["bin"]), deque(state["wanted"].tolist())
