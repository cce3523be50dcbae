"""Settings of smoothing: which engine, how far it looks back, and how fragments are joined."""

from __future__ import annotations

from dataclasses import dataclass

from jeat_graph.config.fields import Section, choice, flag, number

ENGINES = ("fixed-lag", "fixed-lag-rts", "full", "rts", "none")


@dataclass(frozen=True)
class SmootherConfig(Section):
    """How the trajectories of confirmed tracks are smoothed."""

    engine: str = choice(
        "fixed-lag",
        ENGINES,
        "fixed-lag: GTSAM with a window; full: GTSAM over each whole track once it has ended; fixed-lag-rts "
        "and rts: the same by our own Rauch-Tung-Striebel pass; none: no smoothing",
    )
    lag_s: float = number(
        1.0, "s", "fixed lag: a state is final once this much time has followed", open_low=True
    )
    chunk: int = number(48, "1", "fixed lag: measurements of a track per update", low=1)
    robust: str = choice(
        "none",
        ("none", "cauchy", "student-t"),
        "full and rts: kernel that weighs down outlying measurements",
    )
    road: str = choice(
        "spline",
        ("spline", "graph", "fixed-lag"),
        "with --camera, motion and size on the road. spline: of whole tracks, by our own compiled solver; "
        "graph: the same by a factor graph in GTSAM, which takes longer; fixed-lag: as they are known lag_s "
        "later, by windows of that graph, which is what stream --road writes while it runs",
    )
    min_existence: float = number(
        0.7, "1", "rows are written where the smoothed probability of existence is at least this", 0.0, 1.0
    )
    max_gap_s: float = number(
        0.0,
        "s",
        "where nobody sees a vehicle for longer, it has no rows meanwhile, unless it is known to stand; 0: "
        "it has, however long",
    )
    output_rate_hz: float = number(0.0, "Hz", "rows per second of the smoothed table; 0: one at each scan")
    worker: bool = flag(False, "smooth in a process of its own, so that no step of the tracker waits for it")
    exchange_share: float = number(
        0.02,
        "1",
        "full and rts, with stitch: in so many of the encounters of two vehicles the tracker mixes them up. "
        "When the recording ends they change places where, by all that is known then, that is likelier; 0: "
        "never",
        0.0,
        0.5,
    )
    stitch: bool = flag(True, "full and rts: join the fragments of one vehicle when the recording ends")
    stitch_max_gap_s: float = number(3.0, "s", "longest time between two fragments of one vehicle")
    stitch_hidden_s: float = number(
        0.5, "s", "mean time for which a vehicle is hidden while others are seen", open_low=True
    )
    stitch_gate_probability: float = number(
        0.9999, "1", "probability mass of the χ² gate within which two fragments agree", 0.5, 1.0 - 1e-12
    )
