"""Who is who in a recording that goes on: decided in windows, once and for all, with a lag in view.

Each window holds what is not decided and, of every identity that was decided, its last detections. These
are one piece that nothing precedes: whatever was joined or cut before stays so, and its forward state goes
on into the window. What is older than the lag is then decided as the window has it. Windows
follow each other by a share of the lag, so that every detection is decided with as much future in view as
any other.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jeat_graph.association import agreement
from jeat_graph.association.linking import TERMS, Past
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.box_std import join_std, known_std
from jeat_graph.data.detections import Scan
from jeat_graph.data.identity_links import IdentityLinks
from jeat_graph.tracking.identities import deciding, saved_parts
from jeat_graph.tracking.identities.deciding import LONGEST_GAP_S, Recording, SoFar
from jeat_graph.tracking.identities.passes import Pass, took
from jeat_graph.tracking.identities.whole import measured_boxes
from jeat_graph.tracking.identities.window_rows import WindowRows, continuing, one_piece_an_identity

if TYPE_CHECKING:
    from jeat_graph.tracking.model_tracker import ModelTracker

#: Windows move by this share of the lag.
SHARE = 0.5
#: The pass backward goes on into what is decided for this share of the lag: so it meets the identities.
OVERLAP = 0.5
# Detections that are kept of an identity: its state is filtered over them.
_KEPT = 30
# Gaps that the length of the next ones is learnt from.
_GAPS = 200
# Identities that begin so soon after the first scan had begun before it (in times of scans).
_AT_BEGINNING = 2.5


class DecidedStep(NamedTuple):
    """A step of which it is decided who is who.

    Attributes:
        t: its time (s).
        batch: its scans.
        owner: (M,) identity of each detection, 0 for nobody's.
        causal: (M,) the causal one.
        probability: (M,) that the detection is of the object that its identity is mostly of.
        later: (M,) posterior of an object by what comes later.
    """

    t: float
    batch: list[Scan]
    owner: IntArray
    causal: IntArray
    probability: FloatArray
    later: FloatArray


@dataclass
class _Step:
    """A step that is in the window: of its M detections the first has this number."""

    t: float
    batch: list[Scan]
    taken: Pass
    camera: FloatArray
    first: int


class _Choice(NamedTuple):
    """What a window decides of its rows (N,).

    Attributes:
        chain: (N,) of each row, -1 for nobody's.
        probability: (N,).
        in_cover: (N,) whether the row is of a piece that is.
        tail, head: (K,) rows that it joins, with
        ratio, joined, terms: as `IdentityLinks` has them.
    """

    chain: IntArray
    probability: FloatArray
    in_cover: BoolArray
    tail: IntArray
    head: IntArray
    ratio: FloatArray
    joined: FloatArray
    terms: FloatArray


@dataclass
class LagDecider:
    """Decides who is who while a recording goes on; memory is bounded by what is in view.

    Args:
        lag_s: of the future that is in view at least (s).
    """

    lag_s: float
    _steps: deque[_Step] = field(default_factory=deque)
    _done: int = 0  # of these so many are decided
    _kept: WindowRows = field(default_factory=WindowRows.none)
    _count: dict[int, int] = field(default_factory=dict)  # detections of each identity that is kept
    _named: set[int] = field(default_factory=set)
    _past: Past = field(default_factory=Past.none)
    _number: int = 0
    _times: int = 0  # of scans so far
    _begun: float | None = None
    _next: float = 0.0
    _back: ModelTracker | None = None

    def add(self, batch: Sequence[Scan], taken: Pass, camera: FloatArray) -> None:
        """Take down a step.

        Args:
            batch: its scans.
            taken: which causal tracks took its detections (M,), with their posteriors.
            camera: (2,) how far the camera's motion has taken what is at rest (px).
        """
        t = float(batch[0].t)
        if self._begun is None:
            self._begun, self._next = t, t + self.lag_s
        self._times += 1
        self._steps.append(_Step(t, list(batch), taken, camera, self._number))
        self._number += len(taken.assigned)

    def reset(self) -> None:
        """Let time begin again from any moment, when all that came is decided; identities go on."""
        self._steps.clear()
        self._done, self._kept, self._begun = 0, WindowRows.none(), None
        self._count, self._times = {}, 0

    def in_view(self) -> tuple[set[int], set[int]]:
        """Return the causal tracks, and the identities, that windows to come may have."""
        causal = set(self._kept.causal.tolist())
        for step in self._steps:
            causal.update(step.taken.assigned.tolist())
        return causal, set(self._kept.owner.tolist())

    def is_due(self) -> bool:
        """Return whether something can be decided."""
        return bool(self._steps) and self._steps[-1].t >= self._next

    def state(self) -> dict[str, Any]:
        """Return plain data, arrays and scans for `set_state`."""
        taken = [step.taken for step in self._steps]
        return {
            "steps": [step.batch for step in self._steps],
            "assigned": np.concatenate([np.zeros(0, dtype=np.int64), *(one.assigned for one in taken)]),
            "real": np.concatenate([np.zeros(0), *(one.real for one in taken)]),
            "camera": np.array([step.camera for step in self._steps]).reshape(-1, 2),
            "done": self._done,
            "kept": self._kept._asdict(),
            "count": saved_parts.by_number(self._count, np.int64),
            "named": np.array(sorted(self._named), dtype=np.int64),
            "past": self._past._asdict(),
            "number": self._number,
            "times": self._times,
            "begun": self._begun,
            "next": self._next,
            "back": saved_parts.tracker_state(self._back),
        }

    def set_state(self, state: dict[str, Any], tracker: ModelTracker) -> None:
        """Go on from what `state` returned.

        Args:
            state: what it returned.
            tracker: that made the causal pass.

        Raises:
            DataError: no decider can be in that state.
        """
        whole_number, floats = saved_parts.whole_number, saved_parts.floats
        sensors = tracker.engine_sensors
        steps = saved_parts.steps_of(state["steps"], sensors)
        ends = np.cumsum([0, *(sum(map(len, batch)) for batch in steps)]).tolist()
        assigned = saved_parts.ints(state["assigned"], ends[-1])
        real, camera = floats(state["real"], ends[-1]), floats(state["camera"], len(steps), 2)
        self._number, self._times = whole_number(state["number"]), whole_number(state["times"])
        self._done, first = whole_number(state["done"], len(steps)), self._number - ends[-1]
        self._steps = deque(
            _Step(batch[0].t, batch, Pass(assigned[low:high], real[low:high]), moved, first + low)
            for batch, moved, low, high in zip(steps, camera, ends[:-1], ends[1:], strict=True)
        )
        undecided_s = steps[self._done][0].t if self._done < len(steps) else np.inf
        self._kept = WindowRows.of_state(state["kept"], len(sensors), first + ends[self._done], undecided_s)
        self._count = saved_parts.number_pairs(state["count"])
        self._named = set(saved_parts.ints(state["named"]).tolist())
        gaps = state["past"]["gaps"]
        counts = {name: floats(state["past"][name], 2) for name in ("births", "leaving", "continued")}
        self._past = Past(gaps=floats(gaps, -1)[-_GAPS:], **counts)
        if min(*(one.min() for one in counts.values()), self._past.gaps.min(initial=0.0), first) < 0.0:
            raise saved_parts.damaged("counts")
        self._begun = None if state["begun"] is None else float(floats(np.array([state["begun"]]), 1)[0])
        self._next = saved_parts.real_number(state["next"])
        if (self._begun is None) != (not self._times) or (steps and tracker._model.picture() is None):
            raise saved_parts.damaged("scans")
        self._back = saved_parts.tracker_of(state["back"], tracker, smooths=False)

    def decide(
        self, tracker: ModelTracker, *, final: bool = False
    ) -> tuple[list[DecidedStep], IdentityLinks]:
        """Decide what is older than the lag, or all of it.

        Args:
            tracker: that made the causal pass.
            final: whether nothing comes any more.

        Returns:
            The steps that are decided now, in order of time, and the links that were made.
        """
        if self._done == len(self._steps):
            return [], no_links()
        now = self._steps[-1].t
        self._next = now + SHARE * self.lag_s
        back = self._backward(tracker)
        rows, taken_back, later = self._rows(tracker, back)
        choice = self._choose(tracker, rows, taken_back, later)
        until = np.inf if final else now - self.lag_s
        fresh = (rows.owner < 0) & (rows.t <= until)
        identity = self._identities(tracker, rows, choice, fresh)
        owner = np.where(fresh, np.where(choice.chain >= 0, identity[choice.chain], 0), rows.owner)
        rows = rows._replace(owner=owner)
        links = self._links(tracker, rows, choice, fresh)
        decided = self._leave(rows, choice, later, until)
        self._keep(tracker, rows, fresh)
        return decided, links

    def _backward(self, tracker: ModelTracker) -> Pass:
        """Return who took the detections of the steps in the window on reversed time."""
        if self._back is None:
            self._back = tracker.fresh_copy(smooths=False)
        first, now = self._steps[0].first, self._steps[-1].t
        assigned = np.zeros(self._number - first, dtype=np.int64)
        real = np.zeros(len(assigned))
        for step in reversed(self._steps):
            t = now - step.t + 1e-3
            self._back.take_in([replace(scan, t=t, camera_motion=None) for scan in step.batch])
            at = slice(step.first - first, step.first - first + len(step.taken.assigned))
            assigned[at], real[at] = took(self._back, at.stop - at.start)
        self._back.reset(0.0)  # only what it has learnt goes on, and is saved
        return Pass(assigned, real)

    def _rows(self, tracker: ModelTracker, back: Pass) -> tuple[WindowRows, IntArray, FloatArray]:
        """Return what is kept and what is undecided, who took it backward, 0 for what is older, how real."""
        new = list(self._steps)[self._done :]
        sensors, parts = tracker.engine_sensors, []
        for step in new:
            size = [len(scan) for scan in step.batch]
            boxes = np.concatenate([scan.boxes for scan in step.batch])
            count = len(boxes)
            std = join_std([scan.box_std for scan in step.batch], size)
            parts.append(
                WindowRows(
                    np.arange(step.first, step.first + count),
                    np.full(count, step.t),
                    np.repeat([sensors.index(scan.sensor) for scan in step.batch], size).astype(np.int64),
                    np.concatenate([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]], axis=1),
                    step.taken.assigned,
                    deciding.log_odds(step.taken.real),
                    np.full(count, -1, dtype=np.int64),
                    np.broadcast_to(step.camera, (count, 2)),
                    np.full((count, 4), np.nan) if std is None else std,
                )
            )
        rows = WindowRows(*(np.concatenate(columns) for columns in zip(self._kept, *parts, strict=True)))
        place = rows.number - self._steps[0].first
        inside = place >= 0
        assigned, real = np.zeros(len(place), dtype=np.int64), np.full(len(place), -1.0)
        assigned[inside], real[inside] = back.assigned[place[inside]], back.real[place[inside]]
        fresh = rows.owner < 0
        both = 0.5 * (rows.odds + deciding.log_odds(np.maximum(real, 0.0)))
        return rows._replace(odds=np.where(fresh, both, rows.odds)), assigned, real

    def _choose(self, tracker: ModelTracker, rows: WindowRows, back: IntArray, later: FloatArray) -> _Choice:
        """Return the best chains of what is in the window; what is decided stays as it is."""
        c = tracker.constants
        std = known_std(rows.box_std)
        seen, scene = measured_boxes(tracker, rows.t, rows.sensor, rows.boxes, rows.camera, std)
        assigned = np.stack([continuing(rows, rows.causal), continuing(rows, back)])
        piece = agreement.pieces(agreement.SeenBoxes(rows.t, rows.sensor), assigned, deciding.AGREED)
        piece = one_piece_an_identity(piece, rows.owner)
        pieces = int(piece.max(initial=-1)) + 1
        owner = np.zeros(pieces, dtype=np.int64)
        np.maximum.at(owner, piece, rows.owner)
        odds = np.full(pieces, -np.inf)
        np.maximum.at(odds, piece, rows.odds)
        count = np.bincount(piece[rows.owner < 0], minlength=pieces)
        count += np.array([self._count.get(one, 0) for one in owner.tolist()], dtype=np.int64)
        in_cover = (odds > deciding.LEAST_LOG_ODDS) & (count >= deciding.LEAST_DETECTIONS)
        number = np.full(pieces, -1)
        number[in_cover] = np.arange(in_cover.sum())
        place = number[piece]
        used = place >= 0
        scan_t = np.array([step.t for step in self._steps])
        so_far = SoFar(owner[in_cover] > 0, self._past, float(self._begun or 0.0), self._times)
        votes = np.stack([rows.causal, np.where(back > 0, back, -rows.causal - 1)])
        best = deciding.best_chains(Recording(seen, scan_t, scene), place, votes, c, so_far)
        of = best.chain
        # Identities of few detections, then what is weak, go on along their causal tracks.
        owned = (owner[piece] > 0) & ~used
        of[owned] = pieces + piece[owned]
        of = deciding.with_weak(seen, rows.causal, np.where(used | owned, piece, -1), of)
        known = np.unique(rows.causal[of >= 0])
        alone = (of < 0) & ~np.isin(rows.causal, known)
        of[alone] = 2 * pieces + np.unique(rows.causal[alone], return_inverse=True)[1].reshape(-1)
        of[rows.owner == 0] = -1
        return _Choice(of, best.probability, used, *best[2:])

    def _identities(
        self, tracker: ModelTracker, rows: WindowRows, choice: _Choice, fresh: BoolArray
    ) -> IntArray:
        """Return the identity (C,) of each chain, a new one where its first detection is decided now."""
        identity = np.zeros(int(choice.chain.max(initial=-1)) + 2, dtype=np.int64)
        old = (rows.owner > 0) & (choice.chain >= 0)
        identity[choice.chain[old]] = rows.owner[old]
        for row in np.flatnonzero(fresh & (choice.chain >= 0)).tolist():
            chain = int(choice.chain[row])
            if identity[chain]:
                continue
            name = int(rows.causal[row])
            if name in self._named or name <= 0:
                name = max(tracker.num_born, max(self._named, default=0)) + 1
            self._named.add(name)
            identity[chain] = name
            beginning = _AT_BEGINNING * (rows.t[-1] - (self._begun or 0.0)) / max(self._times - 1, 1)
            if choice.in_cover[row] and rows.t[row] > (self._begun or 0.0) + beginning:
                rim = self._at_rim(tracker, rows.boxes[row : row + 1])
                self._past = self._past._replace(births=self._past.births + np.bincount(rim, minlength=2))
        return identity

    def _at_rim(self, tracker: ModelTracker, boxes: FloatArray) -> IntArray:
        """Return 1 for boxes (N, 4) at the rim of the picture, 0 for the others."""
        picture = tracker._model.picture()
        assert picture is not None, "the model has one"
        return deciding.at_rim(boxes, picture).astype(np.int64)

    def _links(
        self, tracker: ModelTracker, rows: WindowRows, choice: _Choice, fresh: BoolArray
    ) -> IdentityLinks:
        """Return the links that are decided now: those to pieces that begin with what is."""
        now = np.flatnonzero(fresh[choice.head])
        now = now[np.argsort(rows.t[choice.tail[now]], kind="stable")]
        tail, head = choice.tail[now], choice.head[now]
        gaps = np.concatenate([self._past.gaps, rows.t[head] - rows.t[tail]])[-_GAPS:]
        rim = self._at_rim(tracker, rows.boxes[tail])
        self._past = self._past._replace(
            gaps=gaps, continued=self._past.continued + np.bincount(rim, minlength=2)
        )
        return IdentityLinks(
            rows.owner[head],
            rows.causal[tail],
            rows.causal[head],
            rows.t[tail],
            rows.t[head],
            choice.ratio[now],
            choice.joined[now],
            choice.terms[now],
        )

    def _leave(self, rows: WindowRows, choice: _Choice, later: FloatArray, until: float) -> list[DecidedStep]:
        """Give out the steps that are decided, and forget those that no window needs any more."""
        decided = []
        while self._done < len(self._steps) and self._steps[self._done].t <= until:
            step = self._steps[self._done]
            low, high = np.searchsorted(rows.number, [step.first, step.first + len(step.taken.assigned)])
            own = slice(int(low), int(high))
            decision = rows.owner[own], rows.causal[own], choice.probability[own], later[own]
            decided.append(DecidedStep(step.t, step.batch, *decision))
            self._done += 1
        last = decided[-1].t if decided else -np.inf
        while self._done and self._steps[0].t < last - OVERLAP * self.lag_s:
            self._steps.popleft()
            self._done -= 1
        return decided

    def _keep(self, tracker: ModelTracker, rows: WindowRows, fresh: BoolArray) -> None:
        """Keep the last detections of each identity that something may still be joined to."""
        for one, count in zip(*np.unique(rows.owner[fresh], return_counts=True), strict=True):
            self._count[int(one)] = self._count.get(int(one), 0) + int(count)
        now = float(rows.t[fresh].max(initial=-np.inf))
        rows = rows.take(rows.owner > 0)
        order = np.lexsort((-rows.number, rows.owner))
        owner = rows.owner[order]
        begins = np.r_[True, np.diff(owner) != 0][: len(owner)]
        starts = np.flatnonzero(begins)
        rank = np.arange(len(owner)) - starts[np.cumsum(begins) - 1]
        # The first of each, in this order, is its last detection.
        alive = rows.t[order[starts]] >= now - LONGEST_GAP_S
        best = np.maximum.reduceat(rows.odds[order], starts) if len(starts) else np.zeros(0)
        odds = rows.odds.copy()
        odds[order[starts]] = best
        keep = order[(rank < _KEPT) & alive[np.cumsum(begins) - 1]]
        ended = order[starts[~alive]]
        over = set(rows.owner[ended].tolist())
        counts = np.array([self._count.get(one, 0) for one in rows.owner[ended].tolist()], dtype=np.int64)
        rim = self._at_rim(tracker, rows.boxes[ended[counts >= deciding.LEAST_DETECTIONS]])
        self._past = self._past._replace(leaving=self._past.leaving + np.bincount(rim, minlength=2))
        self._count = {one: count for one, count in self._count.items() if one and one not in over}
        self._kept = rows._replace(odds=odds).take(np.sort(keep))
        causal, _ = self.in_view()
        most = max(causal, default=0)
        self._named = {name for name in self._named if name in causal or name > most}


def no_links() -> IdentityLinks:
    """Return none."""
    none, nothing = np.zeros(0, dtype=np.int64), np.zeros(0)
    return IdentityLinks(none, none, none, nothing, nothing, nothing, nothing, np.zeros((0, len(TERMS))))
