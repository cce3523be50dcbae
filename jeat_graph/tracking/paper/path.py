"""One track as its smoother sees it: segments, and the states between them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jeat_graph.config.paper import PaperConfig
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.smoothers.fixed_lag import FixedLagChain
from jeat_graph.smoothers.gtsam.elimination import join
from jeat_graph.smoothers.gtsam.full import solve_track
from jeat_graph.smoothers.gtsam.linear_graph import load_gtsam
from jeat_graph.smoothers.gtsam.window import GtsamError
from jeat_graph.smoothers.segments import Given, smoothed_by
from jeat_graph.tracking.paper.segmenting import Piece

if TYPE_CHECKING:
    from jeat_graph.tracking.paper.smoothing import StepTaken

# So many segments have a factor of their own inside GTSAM.
_TOGETHER = 2


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
        begun: whether some of its states are final.
        open_from: time of its first state that is not final (s).
        pieces: the segments.
        fallbacks: how often our own pass stood in for GTSAM.
    """

    def __init__(self, engine: PathEngine, given: int, number: int, taken: StepTaken, row: int) -> None:
        self.identity, self.given = int(taken.ids[row]), given
        self.first_step, self.open_from = number, taken.t
        self.fallbacks, self.begun = 0, False
        self._engine = engine
        self._prior = taken.tracks.mean[row], taken.tracks.cov[row]
        birth = taken.tracks.take(np.array([row]))
        t = np.array([taken.t])
        self._birth = Rows(t, birth.used, birth.mean, birth.cov, birth.size_mean, birth.size_cov)
        self.reference: FloatArray = taken.tracks.mean[row]
        self.pieces: list[Piece] = []
        self._left = 0  # states that GTSAM was told of and that are final
        self._chain: FixedLagChain | None = None
        self._told: list[int] = []  # of how many segments are the factors in GTSAM's window
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
        """Return how many of the segments end before a time or at it (s) and can become final."""
        count = sum(bool(piece.t[-1] <= t) for piece in self.pieces)
        ends = np.cumsum(self._shared())
        return int(ends[ends <= count].max(initial=0))

    def _shared(self) -> list[int]:
        """Return how many segments share each factor inside GTSAM, when it is told of all that there are."""
        pairs, rest = divmod(len(self.pieces) - sum(self._told), _TOGETHER)
        return [*self._told, *([_TOGETHER] * pairs), *([rest] if rest else [])]

    def leave(self, count: int) -> None:
        """Forget the first segments, which are final now."""
        states = int(np.searchsorted(np.cumsum(self._told), count)) + 1
        if self._chain is not None:
            self._chain.leave(states)
        del self._told[:states]
        self._left += states
        self.begun = True
        self.open_from = float(self.pieces[count - 1].t[-1])
        del self.pieces[:count]

    def alone(self) -> Rows | None:
        """Return the only state of a track that has lived through one step, else None."""
        return None if self.pieces or self.begun else self._birth

    def solved_ends(self) -> dict[int, FloatArray]:
        """Return GTSAM's means (2, 3) of the last states of segments, by their places; {} without it.

        Not of all: where two segments share a factor the state between them is none of GTSAM's.
        """
        new = self._share()
        if not self._gtsam or not self.pieces:
            return {}
        try:
            if self._engine.lagged:
                chain = self._told_of(new)
                means = chain.means(range(self._left + 1, self._left + 1 + len(self._told)))
                return dict(zip((np.cumsum(self._told) - 1).tolist(), means, strict=True))
            factors = [piece.factor for piece in self.pieces if piece.factor is not None]
            reference = np.stack([self._prior[0], *(piece.motion.mean[-1] for piece in self.pieces)])
            return dict(enumerate(solve_track(self._prior[1], factors, reference)[1:]))
        except GtsamError:
            # Our own pass knows as much.
            self._chain, self._gtsam = None, False
            self.fallbacks += 1
            return {}

    def _share(self) -> list[list[Piece]]:
        """Let the segments that are new share factors, and return these groups."""
        told, self._told = len(self._told), self._shared()
        ends = np.cumsum([0, *self._told])[told:].tolist()
        return [self.pieces[first:last] for first, last in itertools.pairwise(ends)]

    def _told_of(self, new: list[list[Piece]]) -> FixedLagChain:
        """Return GTSAM's window with groups of segments added to it."""
        if self._chain is None:
            self._chain = FixedLagChain(*self._prior)
        factors = [_joined([one.factor for one in group if one.factor is not None]) for group in new]
        self._chain.append(factors, [group[-1].motion.mean[-1] for group in new])
        return self._chain


def _joined(factors: list[FloatArray]) -> FloatArray:
    """Return one factor (6, 8) of segments that follow one another."""
    out = factors[0][None]
    for factor in factors[1:]:
        out = join(out, factor[None])
    return np.asarray(out[0])


class _Ends(NamedTuple):
    """Smoothed states of n tracks at the ends of their segments: motion and size, means and covariances."""

    mean: FloatArray
    cov: FloatArray
    size_mean: FloatArray
    size_cov: FloatArray


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
    known = [path.solved_ends() for path in paths]
    state: _Ends | None = None
    for back in range(max((path.number for path in paths), default=0)):
        # PaperTracks that have more segments stand first.
        active = [i for i in order if paths[i].number > back]
        pieces = [paths[i].pieces[-1 - back] for i in active]
        filtered = _filtered_ends(pieces)
        state = filtered if state is None else _Ends(*(one[: len(active)] for one in state))
        state = state._replace(mean=state.mean.copy())
        for n, i in enumerate(active):
            place = paths[i].number - 1 - back
            state.mean[n] = known[i].get(place, state.mean[n])
            if place < counts[i]:
                stop = None if whole and back == 0 else -1
                out[i].append(_rows(pieces[n], _Ends(*(one[n] for one in state)), stop))
        motion = smoothed_by(_firsts([one.motion for one in pieces]), filtered.mean, state.mean, state.cov)
        firsts = _firsts([one.size for one in pieces])
        size = smoothed_by(firsts, filtered.size_mean, state.size_mean, state.size_cov)
        state = _Ends(*motion, *size)
    return [rows[::-1] for rows in out]


def _filtered_ends(pieces: Sequence[Piece]) -> _Ends:
    """Return the filtered last states of segments."""
    return _Ends(
        np.stack([one.motion.mean[-1] for one in pieces]),
        np.stack([one.cov for one in pieces]),
        np.stack([one.size.mean[-1] for one in pieces]),
        np.stack([one.size_cov for one in pieces]),
    )


def _firsts(parts: Sequence[Given]) -> Given:
    """Return the first states of segments."""
    return Given(
        np.stack([one.mean[0] for one in parts]),
        np.stack([one.gain[0] for one in parts]),
        np.stack([one.cov[0] for one in parts]),
    )


def _rows(piece: Piece, end: _Ends, stop: int | None) -> Rows:
    """Return the states of a segment, up to one of them, from its smoothed last one."""
    mean, cov = smoothed_by(piece.motion, piece.motion.mean[-1], end.mean, end.cov)
    size, size_cov = smoothed_by(piece.size, piece.size.mean[-1], end.size_mean, end.size_cov)
    here = slice(stop)
    return Rows(piece.t[here], piece.used[here], mean[here], cov[here], size[here], size_cov[here])
