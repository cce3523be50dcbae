"""Names that a tracker's methods had before: they warn, and do the same."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from jeat_graph.data.arrays import IntArray


class OldNames:
    """Methods of `Tracker` by their old names."""

    if TYPE_CHECKING:

        def assigned(self, count: int) -> IntArray:
            """Which track took each detection of the last step."""
            ...

        def reset(self, t: float) -> None:
            """End all tracks and let time go on from another moment."""

    def takers(self, count: int) -> IntArray:
        """Old name of `assigned`."""
        warnings.warn("takers is now called assigned", DeprecationWarning, stacklevel=2)
        return self.assigned(count)

    def begin_anew(self, t: float) -> None:
        """Old name of `reset`."""
        warnings.warn("begin_anew is now called reset", DeprecationWarning, stacklevel=2)
        self.reset(t)
