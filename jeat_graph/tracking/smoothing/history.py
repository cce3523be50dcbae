"""What is kept of one track for smoothing: its measurements, its smoother, the times that have no row yet."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import RecordArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.filters.fit import fit_in_hindsight
from jeat_graph.smoothers.engine import TrackSmoother, make_smoother
from jeat_graph.smoothers.linking import MOVED_SIZES
from jeat_graph.smoothers.measurements import concatenate_measurements
from jeat_graph.smoothers.track_data import COINCIDENT_S, SmoothedTrack
from jeat_graph.tracking.classes import Votes
from jeat_graph.tracking.smoothing.cut_sides import (
    any_cut,
    place_by_sides,
    sizes_as_filtered,
    sizes_by_parts,
)
from jeat_graph.tracking.smoothing.observation_times import BELIEVED, ObservationTimes
from jeat_graph.tracking.smoothing.priors import ErrorStates, prior_of, size_prior_of
from jeat_graph.tracking.smoothing.rows import rows_of
from jeat_graph.tracking.smoothing.sizes import SizeWindow

#: Engines that solve for a track once it has ended; only with these can fragments be stitched.
WHOLE = ("full", "rts")


class TrackHistory:
    """What is kept of one track for its smoothed trajectory.

    As long as the track is tentative its measurements only wait. Once it is confirmed a smoother takes them,
    those of the tentative time first.

    Args:
        track_id: identity.
        config: settings of the smoother, the sizes and the output.
        errors: the error states of the sensors.
        keep: keep all measurements until the end, which stitching needs.
        given: identity that its rows have, if not that.

    Attributes:
        track_id: identity.
        given: identity that its rows have.
        confirmed: whether the track has ever been confirmed.
        measurements: measurements (M,) that wait, or all of them if `keep`, in pieces; the first
            row of the first piece is the birth.
        smoother: the smoother, once there is one.
        votes: weight of the detections so far that speak for each class, by name.
    """

    def __init__(
        self, track_id: int, config: Config, errors: ErrorStates, keep: bool, given: int | None = None
    ) -> None:
        self.track_id = track_id
        self.given = track_id if given is None else given
        self.confirmed = False
        self.measurements: list[RecordArray] = []
        self.votes: dict[str, float] = {}
        self._observed: list[ObservationTimes] = []
        self.smoother: TrackSmoother | None = None
        self._config = config
        self._errors = errors
        self._keep = keep
        self._whole = config.smoother.engine in WHOLE
        self._sizes: SizeWindow | None = None
        self._waiting = -1  # measurements that the smoother has not had; the birth does not count
        self._fed = 0  # pieces of `measurements` that it has had
        self._known = False  # whether it was believed in at a step whose row has been made
        self._last = -np.inf  # time of the last measurement

    @property
    def observed(self) -> ObservationTimes:
        """Steps of its life that have no row yet."""
        if len(self._observed) != 1:
            self._observed = [ObservationTimes.concatenate(self._observed)]
        return self._observed[0]

    @property
    def oldest(self) -> float:
        """Time of the first step without a row (s), or infinity."""
        return next((float(observed.t[0]) for observed in self._observed if len(observed)), np.inf)

    def add_measurements(self, rows: RecordArray) -> None:
        """Add measurements (M,) in order of time."""
        self.measurements.append(rows)
        self._waiting += len(rows)
        self._last = float(rows["t"][-1])

    def add_votes(self, votes: Votes) -> None:
        """Count what measurements say of the track's class."""
        names, place = np.unique(votes.classes, return_inverse=True)
        sums = np.bincount(place.reshape(-1), votes.weights, len(names))
        for name, weight in zip(names.tolist(), sums.tolist(), strict=True):
            if name:
                self.votes[name] = self.votes.get(name, 0.0) + weight

    def add_steps(self, observed: ObservationTimes, confirmed: bool) -> None:
        """Add steps that the track has lived through, and whether it was confirmed in one of them."""
        if len(observed):
            self._observed.append(observed)
        self.confirmed = self.confirmed or confirmed

    def to_solve(self, more: int = 0) -> int:
        """How many measurements are solved for when so many more have come; 0 while they only wait."""
        if not self.confirmed:
            return 0
        waiting = self._waiting + more + (0 if self.smoother is None else self.smoother.waiting)
        return waiting if waiting >= self._config.smoother.chunk else 0

    def feed(self) -> None:
        """Give the smoother what waits, if the track is confirmed."""
        if not self.confirmed or self._fed == len(self.measurements):
            return
        rows = concatenate_measurements(self.measurements[self._fed :])
        rows = sizes_by_parts(rows) if self._whole else sizes_as_filtered(rows)
        if self._sizes is None:
            self._sizes = SizeWindow(size_prior_of(rows[0]), self._config.size.rate_density)
            self._sizes.append(rows[1:])
        else:
            self._sizes.append(rows)
        if self._whole and any_cut(rows):
            rows = place_by_sides(rows, self._sizes.smooth())
        if self.smoother is None:
            settings = self._config.smoother
            self.smoother = make_smoother(
                settings.engine,
                prior_of(rows[0], self._errors),
                lag_s=settings.lag_s,
                chunk=settings.chunk,
                robust=settings.robust,
                correlation_time=self._errors.correlation_time,
            )
            rows = rows[1:]
        if self._keep:
            self._fed = len(self.measurements)
        else:
            self.measurements = []
        self._waiting = 0
        if len(rows):
            self.smoother.feed(rows)

    def departed(self) -> list[Trajectories]:
        """Return the rows that have become final since the last call."""
        if self.smoother is None:
            return []
        return [rows for piece in self.smoother.departed() for rows in self._final_rows(piece)]

    def current(self) -> tuple[list[Trajectories], list[Trajectories]]:
        """Take in all that waits; return the rows that are final then, as `departed`, and all others."""
        if self._whole:
            # What cut boxes say depends on all that follows: nothing is taken in for good before the end.
            draft = copy.copy(self)
            draft.measurements, draft._observed = list(self.measurements), list(self._observed)
            draft.feed()
            return [], [] if draft.smoother is None else draft._rows(draft.smoother.current(), np.inf)
        self.feed()
        if self.smoother is None:
            return [], []
        piece = self.smoother.current()
        final = self.departed()
        return final, self._rows(piece, np.inf)

    def finish(self) -> list[Trajectories]:
        """Return all rows not returned yet, and free the smoother; none for a tentative track."""
        if self.smoother is None:
            return []
        *pieces, last = self.smoother.finish()
        final = [rows for piece in pieces for rows in self._final_rows(piece)]
        return final + self._rows(last, np.inf)

    def whole(self) -> RecordArray:
        """Return all measurements (M,), the birth first; needs `keep`."""
        return concatenate_measurements(self.measurements)

    def close(self) -> None:
        """Free the smoother and all that waits."""
        if self.smoother is not None:
            self.smoother.close()
        self.measurements = []

    def _final_rows(self, piece: SmoothedTrack) -> list[Trajectories]:
        """Rows of the steps before the last state of a piece, with which the next one begins."""
        assert self._sizes is not None
        rows, end = self._rows(piece, float(piece.t[-1])), float(piece.t[-2])
        self._sizes.advance(end)
        observed = self.observed
        first = int(np.searchsorted(observed.t, piece.t[-1]))
        self._known = self._known or bool((observed.existence[:first] >= BELIEVED).any())
        self._observed = [observed.select(slice(first, None))]
        return rows

    def _rows(self, piece: SmoothedTrack, end: float) -> list[Trajectories]:
        """Rows of the steps before time `end` (s), those after the last measurement only where it is held."""
        assert self._sizes is not None
        observed = self.observed
        chosen = (observed.t < end) & ((observed.t <= self._last + COINCIDENT_S) | observed.held)
        # Of two steps at one time the later one counts.
        chosen[:-1] &= observed.t[1:] > observed.t[:-1]
        existence = observed.hindsight(self._config.lifecycle.lifetime_s, self._known)
        if self._whole and self._stays(piece):
            existence = observed.in_place(existence)
        chosen &= existence >= self._config.smoother.min_existence
        if self._config.smoother.max_gap_s > 0.0:
            chosen &= ~observed.hidden(piece.t, self._config.smoother.max_gap_s)
        output = self._config.output
        if output.min_fit > 0.0:
            chosen &= fit_in_hindsight(observed.t, observed.fit, output.fit_memory_s) >= output.min_fit
        if not chosen.any():
            return []
        kept = observed.select(chosen)
        rows = rows_of(self.given, piece, self._sizes.smooth(), kept, existence[chosen], self._config)
        return [self._classified(rows)]

    def _stays(self, piece: SmoothedTrack) -> bool:
        """Whether it has never left the place where it began."""
        assert self._sizes is not None
        size = np.exp(0.5 * self._sizes.smooth().mean[-1, :, 0].sum())
        way = np.hypot(*(piece.mean[:, :, 0] - piece.mean[0, :, 0]).T)
        return bool(way.max() <= MOVED_SIZES * size)

    def _classified(self, rows: Trajectories) -> Trajectories:
        """The rows with the class of all that has been taken in by now, if anything was said of it."""
        if not self.votes:
            return rows
        name = max(sorted(self.votes), key=self.votes.__getitem__)
        share = self.votes[name] / sum(self.votes[one] for one in sorted(self.votes))
        return replace(rows, classes=np.full(len(rows), name), class_probability=np.full(len(rows), share))
