"""Settings of smoothing: which engine, and how far it looks back."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

from jeat_graph.config.fields import Section, choice, number
from jeat_graph.data.errors import InputWarning

IDENTITIES = ("auto", "causal", "lag", "whole")
ENGINES = ("fixed-lag", "full", "gtsam", "gtsam-full", "none")
#: Names that engines had.
FORMER = {"fixed-lag-rts": "fixed-lag", "rts": "full"}
#: Engines whose rows are final while their track lives.
LAGGED = ("fixed-lag", "gtsam")


@dataclass(frozen=True)
class SmootherConfig(Section):
    """How trajectories are smoothed."""

    engine: str = choice(
        "fixed-lag",
        (*ENGINES, *FORMER),
        "fixed-lag: rows are final at most twice `lag_s` later; full: once their track has ended; both by a "
        "Rauch-Tung-Striebel pass; gtsam and gtsam-full: the same numbers by a factor graph in GTSAM, with "
        "that lag and of whole tracks; none: no smoothing; fixed-lag-rts and rts are fixed-lag and full",
    )
    lag_s: float = number(
        1.0, "s", "fixed lag: a state is final once this much time has followed", open_low=True
    )
    identities: str = choice(
        "auto",
        IDENTITIES,
        "who is who in the smoothed table. causal: as the causal table says; lag: decided once more with "
        "`lag_s` of the future in view, and never changed again; whole: decided at the end with the whole "
        "recording in view, which is kept in memory; not for streams; auto: whole where a recording is "
        "tracked from beginning to end (`track`, `batch`, Python's `track`), else causal",
    )
    road: str = choice(
        "spline",
        ("spline", "graph", "fixed-lag"),
        "with --camera, motion and size on the road. spline: of whole tracks, by our own compiled solver; "
        "graph: the same by a factor graph in GTSAM, which takes longer; fixed-lag: as they are known lag_s "
        "later, by windows of that graph, which is what stream --road writes while it runs",
    )
    output_rate_hz: float = number(0.0, "Hz", "rows per second of the smoothed table; 0: one at each scan")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.engine in FORMER:
            now = FORMER[self.engine]
            warnings.warn(f"smoother.engine: {self.engine} is called {now} now", InputWarning, stacklevel=2)
            object.__setattr__(self, "engine", now)
