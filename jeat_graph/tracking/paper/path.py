"""One track as its smoother sees it: segments, and the states between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jeat_graph.config.paper import PaperConfig
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.smoothers.fixed_lag import FixedLagChain
from jeat_graph.smoothers.gtsam.full import solve_track
from jeat_graph.smoothers.gtsam.linear_graph import load_gtsam
from jeat_graph.smoothers.gtsam.window import GtsamError
from jeat_graph.smoothers.segments import Given, smoothed_by
from jeat_graph.tracking.paper.segmenting import Piece

if TYPE_CHECKING:
    from jeat_graph.tracking.paper.smoothing import StepTaken


@dataclass(frozen=True)
class PathEngine:
    """Which smoother is asked for.

    Attributes:
        gtsam: whether GTSAM solves for the states between segments, or our own pass.
        lagged: whether states become final while their track lives.
        settings: of the motion model.
    """

    gtsam: bool
    lagged: bool
    settings: PaperConfig

    @staticmethod
    def of(config: Config) -> PathEngine:
        """Read it from a configuration: fixed-lag and full are GTSAM's, fixed-lag-rts and rts our own."""
        name = config.smoother.engine
        return PathEngine(name in ("fixed-lag", "full"), name.startswith("fixed-lag"), config.paper)

    def load(self) -> None:
        """Load what it needs now rather than in the middle of a live run: GTSAM takes a while."""
        if self.gtsam:
            load_gtsam()


class Rows(NamedTuple):
    """Smoothed states of a track at T times.

    Attributes:
        t: (T,) times (s).
        used: (T,) bit s is set where a detection of sensor s was taken.
        mean: (T, 2, 3) motion.
        cov: (T, 3, 3) of either axis.
        size_mean: (T, 2, 2) of ln width and ln height.
        size_cov: (T, 2, 2) of either.
    """

    t: FloatArray
    used: IntArray
    mean: FloatArray
    cov: FloatArray
    size_mean: FloatArray
    size_cov: FloatArray


class TrackPath:
    """The segments of one track that are not final yet.

    Args:
        engine: which smoother.
        given: identity that its rows have.
        number: number of the step in which it was born.
        taken: that step.
        row: its row there.

    Attributes:
        identity: of the track.
        given: identity that its rows have.
        first_step: number of the step at which the open segment begins.
        reference: (2, 3) what the state there is counted from inside GTSAM.
        open_from: time of its first state that is not final (s).
        pieces: the segments.
        fallbacks: how often our own pass stood in for GTSAM.
    """

    def __init__(self, engine: PathEngine, given: int, number: int, taken: StepTaken, row: int) -> None:
        self.identity, self.given = int(taken.ids[row]), given
        self.first_step, self.open_from = number, taken.t
        self.fallbacks = 0
        self._engine = engine
        self._prior = taken.tracks.mean[row], taken.tracks.cov[row]
        birth = taken.tracks.take(np.array([row]))
        t = np.array([taken.t])
        self._birth = Rows(t, birth.used, birth.mean, birth.cov, birth.size_mean, birth.size_cov)
        self.reference: FloatArray = taken.tracks.mean[row]
        self.pieces: list[Piece] = []
        self._left = 0  # segments that are final
        self._chain: FixedLagChain | None = None
        self._told = 0  # segments of `pieces` that GTSAM's window has had
        self._gtsam = engine.gtsam

    def add(self, piece: Piece, number: int) -> None:
        """Take in the segment that was open, closed at the step of a number, unless no time has passed."""
        if len(piece.t) < 2:
            return
        self.first_step = number
        self.reference = piece.motion.mean[-1]
        self.pieces.append(piece)

    @property
    def number(self) -> int:
        """How many segments are not final."""
        return len(self.pieces)

    def before(self, t: float) -> int:
        """Return how many of the segments end before a time or at it (s)."""
        return sum(bool(piece.t[-1] <= t) for piece in self.pieces)

    def leave(self, count: int) -> None:
        """Forget the first segments, which are final now."""
        if self._chain is not None:
            self._chain.leave(count)
        self.open_from = float(self.pieces[count - 1].t[-1])
        del self.pieces[:count]
        self._told -= count
        self._left += count

    def alone(self) -> Rows | None:
        """Return the only state of a track that has lived through one step, else None."""
        return None if self.pieces or self._left else self._birth

    def solved_ends(self) -> FloatArray | None:
        """Return GTSAM's means (B, 2, 3) of the last states of the segments, or None without it."""
        if not self._gtsam or not self.pieces:
            return None
        try:
            if self._engine.lagged:
                chain = self._told_chain()
                return chain.means(range(self._left + 1, self._left + 1 + len(self.pieces)))
            rows = [piece.rows for piece in self.pieces if piece.rows is not None]
            reference = np.stack([self._prior[0], *(piece.motion.mean[-1] for piece in self.pieces)])
            return solve_track(self._prior[1], rows, reference)[1:]
        except GtsamError:
            # Our own pass knows as much.
            self._chain, self._gtsam = None, False
            self.fallbacks += 1
            return None

    def _told_chain(self) -> FixedLagChain:
        """Return GTSAM's window with all segments in it."""
        if self._chain is None:
            self._chain = FixedLagChain(*self._prior)
        for piece in self.pieces[self._told :]:
            if piece.rows is not None:
                self._chain.append(piece.rows, piece.motion.mean[-1])
            self._told += 1
        return self._chain


def solve(paths: Sequence[TrackPath], counts: Sequence[int], whole: bool = False) -> list[list[Rows]]:
    """Return the states of tracks given all that they have been told: each segment's, without its last one.

    The pass back goes over all tracks at once, from segment to segment.

    Args:
        paths: n tracks.
        counts: of each, how many of its first segments are wanted.
        whole: whether the last state of all is wanted, too.
    """
    out: list[list[Rows]] = [[] for _ in paths]
    order = sorted(range(len(paths)), key=lambda i: -paths[i].number)
    solved = [paths[i].solved_ends() for i in order]
    state: list[FloatArray] = []
    for j in range(max((path.number for path in paths), default=0)):
        active = [i for i in order if paths[i].number > j]
        pieces = [paths[i].pieces[-1 - j] for i in active]
        ends = [np.stack([piece.motion.mean[-1] for piece in pieces]), None]
        ends[1] = np.stack([piece.size.mean[-1] for piece in pieces])
        if j == 0:
            state = [
                ends[0].copy(),
                np.stack([p.cov for p in pieces]),
                ends[1],
                np.stack([p.size_cov for p in pieces]),
            ]
        mean, cov, size_mean, size_cov = (one[: len(active)] for one in state)
        for n, known in enumerate(solved[: len(active)]):
            if known is not None:
                mean[n] = known[-1 - j]
        for n, (i, piece) in enumerate(zip(active, pieces, strict=True)):
            if paths[i].number - 1 - j < counts[i]:
                motion = smoothed_by(piece.motion, piece.motion.mean[-1], mean[n], cov[n])
                size = smoothed_by(piece.size, piece.size.mean[-1], size_mean[n], size_cov[n])
                stop = len(piece.t) if whole and j == 0 else -1
                out[i].append(Rows(*(one[:stop] for one in (piece.t, piece.used, *motion, *size))))
        first = Given(
            *(np.stack(part) for part in zip(*((a[0] for a in p.motion) for p in pieces), strict=True))
        )
        first_size = Given(
            *(np.stack(part) for part in zip(*((a[0] for a in p.size) for p in pieces), strict=True))
        )
        state = [
            *smoothed_by(first, ends[0], mean, cov),
            *smoothed_by(first_size, ends[1], size_mean, size_cov),
        ]
    return [rows[::-1] for rows in out]
