"""Draws where causal tracks were joined to one identity: a broken line over the gap, with its probability."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.identity_links import IdentityLinks
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.drawing.movie.marks import NAME_SIZE, PALE, Canvas
from jeat_graph.drawing.palette import track_rgb

#: A join is shown from the beginning of its gap until so long after its end (s).
SHOWN_S = 1.0
# Between the line and what stands above it, in a picture 720 px high.
_CLEAR_PX = 8.0
_TOLERANCE_S = 1e-6


class Joins:
    """The joins of a run.

    Args:
        table: the smoothed table; joins of tracks that it has not are left out.
        links: what was joined.
    """

    def __init__(self, table: Trajectories, links: IdentityLinks) -> None:
        links = links.between_tracks()
        order = np.lexsort((table.t, table.track_id))
        ends = [_rows_at(table, order, links.track_id, t) for t in (links.t_tail, links.t_head)]
        keep = np.flatnonzero((ends[0] >= 0) & (ends[1] >= 0))
        self._links = links.take(keep)
        self._boxes = np.stack([table.boxes[rows[keep]] for rows in ends], axis=1)

    def __len__(self) -> int:
        return len(self._boxes)

    def draw(self, canvas: Canvas, t: float, way: PictureMap | None) -> None:
        """Draw the joins of a time (s).

        Args:
            canvas: where to.
            t: the time.
            way: from the picture that is drawn into to that of the boxes, or None.
        """
        links = self._links
        now = (links.t_tail <= t + _TOLERANCE_S) & (t <= links.t_head + SHOWN_S + _TOLERANCE_S)
        for k in np.flatnonzero(now).tolist():
            ends = self._boxes[k]
            if way is not None:
                ends, seen = way.back(ends)
                if not seen.all():
                    continue
            colour = track_rgb(int(links.track_id[k]), PALE)
            middles = ends[:, :2] + 0.5 * ends[:, 2:]
            canvas.dashed_line(middles, colour, 1.6)
            text = f"{links.tail[k]} to {links.head[k]}: {links.probability[k]:.2f}"
            x, y = (middles.mean(axis=0) * canvas.scale).tolist()
            canvas.text(text, (x, y - _CLEAR_PX * canvas.unit), colour, NAME_SIZE)


def _rows_at(table: Trajectories, order: IntArray, track_id: IntArray, t: FloatArray) -> IntArray:
    """Return the row (K,) of each track nearest to a time (K,), -1 where the table has none of the track."""
    ids, times = table.track_id[order], table.t[order]
    out = np.full(len(t), -1, dtype=np.int64)
    for k, (one, at) in enumerate(zip(track_id.tolist(), t.tolist(), strict=True)):
        low, high = np.searchsorted(ids, [one, one + 1]).tolist()
        if high > low:
            out[k] = order[low + int(np.abs(times[low:high] - at).argmin())]
    return out
