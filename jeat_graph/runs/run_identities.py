"""Who is who in a run whose smoother decided it: causal tracks that make up identities, and their links."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.identity_links import IdentityLinks
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.files.beside import check_beside
from jeat_graph.io.tables.links_io import read_links
from jeat_graph.io.tables.trajectories_io import read_trajectories
from jeat_graph.runs.directory import LINKS

_SMOOTHED = "smoothed.csv"


class IdentityPart(NamedTuple):
    """Rows of the smoothed table that follow each other in time, of one identity and one causal track.

    Attributes:
        track_id: the identity.
        causal_id: the causal track.
        first, last: times of the rows (s).
    """

    track_id: int
    causal_id: int
    first: float
    last: float


@dataclass(frozen=True, eq=False)
class RunIdentities:
    """Decided identities.

    Attributes:
        table: the smoothed table, which has causal identities.
        links: what was joined; None where a person has said who is who.
    """

    table: Trajectories
    links: IdentityLinks | None

    def of_identity(self, track_id: int) -> list[IdentityPart]:
        """Return the causal tracks that an identity is made of, in order of time; empty if it has no rows."""
        return self._parts(np.flatnonzero(self.table.track_id == track_id))

    def of_causal(self, causal_id: int) -> list[IdentityPart]:
        """Return to which identities a causal track went, in order of time; empty if to none."""
        assert self.table.causal_id is not None, "identities were decided"
        return self._parts(np.flatnonzero(self.table.causal_id == causal_id))

    def links_of(self, track_id: int) -> IdentityLinks | None:
        """Return the links of an identity, in order of time."""
        if self.links is None:
            return None
        return self.links.take(np.flatnonzero(self.links.track_id == track_id))

    def _parts(self, rows: IntArray) -> list[IdentityPart]:
        table = self.table
        assert table.causal_id is not None, "identities were decided"
        rows = rows[np.argsort(table.t[rows], kind="stable")]
        pair = np.stack([table.track_id[rows], table.causal_id[rows]])
        cuts = np.flatnonzero((np.diff(pair) != 0).any(axis=0)) + 1
        parts = [part for part in np.split(rows, cuts) if len(part)]
        return [
            IdentityPart(
                int(table.track_id[part[0]]),
                int(table.causal_id[part[0]]),
                float(table.t[part[0]]),
                float(table.t[part[-1]]),
            )
            for part in parts
        ]


def links_of_run(folder: Path) -> IdentityLinks | None:
    """Return what the smoother of a run joined; None where it decided nothing.

    Raises:
        DataError: `links.csv` cannot be read.
    """
    path = folder / LINKS
    if not path.is_file():
        return None
    check_beside(path, folder)
    return read_links(path)


def identities_of_run(folder: Path) -> RunIdentities | None:
    """Return who is who in a run; None where identities are those of the causal table.

    Raises:
        DataError: a file of the run cannot be read.
    """
    path = folder / _SMOOTHED
    if not path.is_file():
        return None
    check_beside(path, folder)
    table = read_trajectories(path)
    return None if table.causal_id is None else RunIdentities(table, links_of_run(folder))
