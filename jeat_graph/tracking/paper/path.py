"""One track as its smoother sees it: segments, and the states between them."""

from __future__ import annotations

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
from jeat_graph.smoothers.segments import smoothed_by
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
        called: class and its share, as far as known.
        fallbacks: how often our own pass stood in for GTSAM.
    """

    def __init__(self, engine: PathEngine, given: int, number: int, taken: StepTaken, row: int) -> None:
        self.identity, self.given = int(taken.ids[row]), given
        self.first_step, self.open_from = number, taken.t
        self.called = "", float("nan")
        self.fallbacks = 0
        self._engine = engine
        self._prior = taken.tracks.mean[row], taken.tracks.cov[row]
        birth = taken.tracks.take(np.array([row]))
        t = np.array([taken.t])
        self._birth = Rows(t, birth.used, birth.mean, birth.cov, birth.size_mean, birth.size_cov)
        self.reference: FloatArray = taken.tracks.mean[row]
        self._pieces: list[Piece] = []
        self._left = 0  # segments that are final
        self._chain: FixedLagChain | None = None
        self._told = 0  # segments of `_pieces` that GTSAM's window has had
        self._gtsam = engine.gtsam

    def add(self, piece: Piece, number: int) -> None:
        """Take in the segment that was open, closed at the step of a number, unless no time has passed."""
        if len(piece.t) < 2:
            return
        self.first_step = number
        self.reference = piece.motion.mean[-1]
        self._pieces.append(piece)

    def departed(self, until: float, last_seen: float) -> list[Rows]:
        """Return the rows that are final: of segments before a time, and before its last detection (s)."""
        if self._engine.lagged and self._gtsam:
            self._tell()
        bound = min(until, last_seen)
        count = sum(piece.t[-1] <= bound for piece in self._pieces)
        if not count:
            return []
        rows = self._solved(count)
        if self._chain is not None:
            self._chain.leave(count)
        del self._pieces[:count]
        self._told -= count
        self._left += count
        self.open_from = float(self._pieces[0].t[0]) if self._pieces else bound
        return rows

    def remaining(self, last_seen: float) -> list[Rows]:
        """Return the rows of all segments that are not final, up to a time (s)."""
        if self._engine.lagged and self._gtsam:
            self._tell()
        if not self._pieces:
            return [] if self._left else [self._birth]
        rows = self._solved(len(self._pieces), with_last=True)
        out = []
        for part in rows:
            here = part.t <= last_seen
            out.append(Rows(*(column[here] for column in part)))
        return out

    def _tell(self) -> None:
        """Give GTSAM's window the segments that it has not had."""
        try:
            if self._chain is None:
                self._chain = FixedLagChain(*self._prior)
            for piece in self._pieces[self._told :]:
                if piece.rows is not None:
                    self._chain.append(piece.rows, piece.motion.mean[-1])
                self._told += 1
        except GtsamError:
            self._give_up()

    def _give_up(self) -> None:
        """Go on without GTSAM: our own pass knows as much."""
        self._chain, self._gtsam = None, False
        self.fallbacks += 1

    def _ends(self) -> FloatArray | None:
        """Return GTSAM's means (B, 2, 3) of the last states of the segments, or None without it."""
        if not self._gtsam or not self._pieces:
            return None
        try:
            if self._chain is not None:
                return self._chain.means(range(self._left + 1, self._left + 1 + len(self._pieces)))
            rows = [piece.rows for piece in self._pieces if piece.rows is not None]
            reference = np.stack([self._prior[0], *(piece.motion.mean[-1] for piece in self._pieces)])
            return solve_track(self._prior[1], rows, reference)[1:]
        except GtsamError:
            self._give_up()
            return None

    def _solved(self, count: int, with_last: bool = False) -> list[Rows]:
        """Return the states of the first `count` segments given all, each without its last one or with it."""
        solved = self._ends()
        out: list[Rows] = []
        later: tuple[FloatArray, FloatArray, FloatArray, FloatArray] | None = None
        for k in range(len(self._pieces) - 1, -1, -1):
            piece = self._pieces[k]
            end, size_end = piece.motion.mean[-1], piece.size.mean[-1]
            now = later or (end, piece.cov, size_end, piece.size_cov)
            if solved is not None:
                now = (solved[k], *now[1:])
            whole = k < count
            part = slice(None) if whole else slice(0, 1)
            mean, cov = smoothed_by(piece.motion._make(a[part] for a in piece.motion), end, *now[:2])
            size, size_cov = smoothed_by(piece.size._make(a[part] for a in piece.size), size_end, *now[2:])
            later = mean[0], cov[0], size[0], size_cov[0]
            if whole:
                stop = len(piece.t) if with_last and k == len(self._pieces) - 1 else -1
                columns = (piece.t, piece.used, mean, cov, size, size_cov)
                out.append(Rows(*(column[:stop] for column in columns)))
        return out[::-1]
