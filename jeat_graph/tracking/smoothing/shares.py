"""What a packet of steps holds of each track, and about what it costs to smooth it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, RecordArray
from jeat_graph.tracking.classes import Votes
from jeat_graph.tracking.smoothing.history import TrackHistory
from jeat_graph.tracking.smoothing.observation_times import ObservationTimes
from jeat_graph.tracking.smoothing.recorder import Packet

_SIDES: tuple[Literal["left"], Literal["right"]] = ("left", "right")

#: In measurements to be solved for: what a solve costs besides these, and handing a share to a track.
SOLVING, HANDING = 60, 1


class SortedPacket(NamedTuple):
    """A packet's steps and measurements, those of each track together and in order of time.

    Attributes:
        observed: (L,) steps that the table has rows at.
        confirmed: (L',) whether the track was confirmed, in all steps.
        updates: (M,) measurements.
        votes: what these say of classes, or None.
    """

    observed: ObservationTimes
    confirmed: BoolArray
    updates: RecordArray
    votes: Votes | None = None


class Share(NamedTuple):
    """What a packet holds of one track; cut out of it only when its turn comes.

    Attributes:
        packet: the packet.
        observed: its part of `packet.observed`.
        steps: its part of `packet.confirmed`.
        updates: its part of `packet.updates`.
        last: whether the track ended in the packet.
    """

    packet: SortedPacket
    observed: slice
    steps: slice
    updates: slice
    last: bool

    @property
    def measured(self) -> int:
        """How many measurements it holds."""
        return int(self.updates.stop - self.updates.start)

    @property
    def oldest(self) -> float:
        """Time of its first row (s), or infinity."""
        part = self.observed
        return float(self.packet.observed.t[part.start]) if part.stop > part.start else np.inf

    def saved(self) -> dict[str, Any]:
        """Return what it holds, without the rest of the packet, for `from_saved`."""
        packet = self.packet
        return {
            **vars(packet.observed.select(self.observed)),
            "confirmed": packet.confirmed[self.steps],
            "updates": packet.updates[self.updates],
            "votes": None if packet.votes is None else packet.votes.take(self.updates),
            "last": self.last,
        }

    @staticmethod
    def from_saved(saved: dict[str, Any]) -> Share:
        """Make a share of what `saved` returned, in a packet of its own."""
        names = ("confirmed", "updates", "votes", "last")
        confirmed, updates, votes, last = (saved.pop(name) for name in names)
        observed = ObservationTimes(**saved)
        steps, rows = slice(0, len(confirmed)), slice(0, len(updates))
        packet = SortedPacket(observed, confirmed, updates, votes)
        return Share(packet, slice(0, len(observed)), steps, rows, last)

    def give_to(self, history: TrackHistory) -> None:
        """Hand it to the track's history."""
        history.add_steps(
            self.packet.observed.select(self.observed), bool(self.packet.confirmed[self.steps].any())
        )
        if self.measured:
            history.add_measurements(self.packet.updates[self.updates])
            if self.packet.votes is not None:
                history.add_votes(self.packet.votes.take(self.updates))


def packet_cost(packet: Packet, chunk: int) -> int:
    """About what a packet will cost in all, in measurements to be solved for, by chunks of so many."""
    solves = len(packet.updates) / chunk
    return int(HANDING * packet.counts.max(initial=0) + SOLVING * solves) + len(packet.updates)


def cost_of_solving(to_solve: int) -> int:
    """What it costs to solve for so many measurements."""
    return SOLVING + to_solve if to_solve else 0


def split(packet: Packet, rate_hz: float) -> Iterator[tuple[int, Share]]:
    """Cut a packet into the shares of its tracks, by identity.

    Args:
        packet: the packet.
        rate_hz: rate of the smoothed table (Hz), or 0 for a row at every step.
    """
    ended = set(packet.ended)
    order = np.argsort(packet.ids, kind="stable")
    rows = order if rate_hz <= 0.0 else order[np.repeat(packet.wanted, packet.counts)[order]]
    observed = ObservationTimes(
        np.repeat(packet.t, packet.counts)[rows],
        packet.existence[rows],
        packet.worth[rows],
        packet.used[rows],
        packet.held[rows],
        packet.fit[rows],
    )
    by_track = np.argsort(packet.updates["track_id"], kind="stable")
    updates = packet.updates[by_track]
    votes = None if packet.votes is None else packet.votes.take(by_track)
    whole = SortedPacket(observed, packet.confirmed[order], updates, votes)
    # A track that ended between two packets has no step in this one.
    ids = np.union1d(packet.ids, np.array(packet.ended, dtype=np.int64))
    owners = packet.ids[rows], packet.ids[order], updates["track_id"]
    parts = [zip(*(np.searchsorted(o, ids, side).tolist() for side in _SIDES), strict=True) for o in owners]
    for track_id, observed_in, stepped, updated in zip(ids.tolist(), *parts, strict=True):
        bounds = slice(*observed_in), slice(*stepped), slice(*updated)
        yield track_id, Share(whole, *bounds, track_id in ended)
