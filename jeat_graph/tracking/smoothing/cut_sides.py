"""With hindsight a box that the edge cut says more: the size of the vehicle is known once it was seen whole.

The filter turns the side that shows into a centre with the size that it knows at that moment. Of a vehicle
that enters the picture that is a guess; its smoothed size tells better, and the records of what the track
took in are written anew with it before a smoother gets them.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import BoolArray, RecordArray
from jeat_graph.filters.cut_boxes import BOTH_CUT, FIRST_LOG_GROWTH_STD, WHOLE, centre_from_side
from jeat_graph.smoothers.size import SmoothedSize

# Variance of ln size that leaves it to the whole boxes: a factor of e² to either side.
_OPEN_LOG_VAR = 4.0

# That with which the size that the filter knew stands for a cut box's, where there is no hindsight: the sizes
# that it turned into centres and those of the rows must be the same, or the side that shows would be off.
_FILTERED_LOG_VAR = 0.01


def any_cut(rows: RecordArray) -> bool:
    """Whether the edge of the picture cut any box of some records (M,)."""
    return bool((rows["cut"] != WHOLE).any())


def sizes_as_filtered(rows: RecordArray) -> RecordArray:
    """Let the size with which the filter placed a cut box stand for it; for smoothers with a lag.

    Args:
        rows: (M,) records of one track.

    Returns:
        (M,) records.
    """
    cut = (rows["cut"] != WHOLE) & (rows["birth"] == 0)[:, None]
    if not cut.any():
        return rows
    out = rows.copy()
    out["size_var"] = np.where(cut, _FILTERED_LOG_VAR, rows["size_var"])
    return out


def sizes_by_parts(rows: RecordArray) -> RecordArray:
    """Say what the parts that showed tell of a size, given whether the vehicle was seen whole as well.

    Of a vehicle that never was, they stand for the whole. Of one that was, they say nothing, and neither does
    the guess with which its track began.

    Args:
        rows: (M,) records of one track, the birth first.

    Returns:
        (M,) records.
    """
    cut = rows["cut"] != WHOLE
    if not cut.any():
        return rows
    out, never = rows.copy(), cut.all(axis=0)
    var = np.where(cut & never, FIRST_LOG_GROWTH_STD**2, rows["size_var"])
    var[0] = np.where(cut[0] & ~never, _OPEN_LOG_VAR, var[0])
    out["size_var"] = var
    return out


def place_by_sides(rows: RecordArray, sizes: SmoothedSize) -> RecordArray:
    """Write the centres of cut boxes anew, by the side that shows and the smoothed size.

    The side is as exact as the filter took it for; the size is what it is known to be now.

    Args:
        rows: (M,) records of one track, the birth too if it is among them.
        sizes: its smoothed sizes.

    Returns:
        (M,) records.
    """
    cut = rows["cut"]
    one_sided: BoolArray = (cut != WHOLE) & (cut != BOTH_CUT)
    if not one_sided.any():
        return rows
    out = rows.copy()
    at = np.clip(np.searchsorted(sizes.t, rows["t"]), 0, len(sizes.t) - 1)
    for i, axis in np.argwhere(one_sided).tolist():
        log_size, log_var = sizes.mean[at[i], axis, 0], sizes.cov[at[i], axis, 0, 0]
        z, var = centre_from_side(int(cut[i, axis]), rows["side"][i, axis], log_size, log_var)
        out["z"][i, axis], out["r"][i, axis] = z, rows["noise"][i, axis] + var
    return out
