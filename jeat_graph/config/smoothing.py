"""Settings of smoothing: which engine, and how far it looks back."""

from __future__ import annotations

from dataclasses import dataclass

from jeat_graph.config.fields import Section, choice, number

ENGINES = ("fixed-lag", "fixed-lag-rts", "full", "rts", "none")


@dataclass(frozen=True)
class SmootherConfig(Section):
    """How trajectories are smoothed."""

    engine: str = choice(
        "fixed-lag",
        ENGINES,
        "fixed-lag: rows are final at most twice `lag_s` later; full: once their track has ended; both by a "
        "Rauch-Tung-Striebel pass, of the engine `paper` by a factor graph in GTSAM, and there fixed-lag-rts "
        "and rts are the same by its own pass; none: no smoothing",
    )
    lag_s: float = number(
        1.0, "s", "fixed lag: a state is final once this much time has followed", open_low=True
    )
    road: str = choice(
        "spline",
        ("spline", "graph", "fixed-lag"),
        "with --camera, motion and size on the road. spline: of whole tracks, by our own compiled solver; "
        "graph: the same by a factor graph in GTSAM, which takes longer; fixed-lag: as they are known lag_s "
        "later, by windows of that graph, which is what stream --road writes while it runs",
    )
    output_rate_hz: float = number(0.0, "Hz", "rows per second of the smoothed table; 0: one at each scan")
