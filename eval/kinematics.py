"""Errors of position, velocity and acceleration, and whether the covariances tell the truth about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.eval.frames import Frames
from jeat_graph.eval.matching import matched_entries

# A true box whose centre is this far from the true x, y was cut off by the picture's edge.
TRUNCATED_PX = 0.5


@dataclass(frozen=True)
class KinematicErrors:
    """Root mean square errors of the box centre over matched pairs, pooled; NaN where not known.

    Attributes:
        position_rmse: of x, y together (px).
        velocity_rmse: of vx, vy together (px/s).
        acceleration_rmse: of ax, ay together (px/s²).
        nees: mean of `ex²/var_x + ey²/var_y`; 2 is expected of a consistent estimate (the axes of the motion
            model are independent, so the 2-D covariance is diagonal).
        nees_low: lower end of the 95 % interval of `nees` for that many independent consistent estimates.
        nees_high: upper end. Neighbouring frames are correlated, so the true interval is wider.
        pairs: matched pairs judged.
        nees_pairs: those that NEES was taken of.
        truncated_pairs: matched pairs left out because the picture's edge cuts the box.
    """

    position_rmse: float
    velocity_rmse: float
    acceleration_rmse: float
    nees: float
    nees_low: float
    nees_high: float
    pairs: int
    nees_pairs: int
    truncated_pairs: int

    def as_dict(self) -> dict[str, float | int]:
        """Return the errors by name."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class MatchedErrors:
    """Errors of single matched pairs of one sequence.

    Attributes:
        truth_entry: (P,) entry of the truth in the `Frames`.
        track_entry: (P,) entry of the track.
        error: (P, 6) estimate minus truth of x, y, vx, vy, ax, ay; NaN where the table has no motion.
        var: (P, 6) variances claimed; NaN where unknown.
        truncated: (P,) true where the picture's edge cuts the true box.
    """

    truth_entry: IntArray
    track_entry: IntArray
    error: FloatArray
    var: FloatArray
    truncated: npt.NDArray[np.bool_]


def matched_errors(frames: Frames, *, iou: float = 0.5) -> MatchedErrors | None:
    """Errors of each matched pair of a sequence, or None if the truth has no motion.

    Args:
        frames: one sequence.
        iou: smallest IoU of a match.
    """
    motion = frames.truth.motion
    if motion is None:
        return None
    g, m = matched_entries(frames.iou, iou)
    true = motion[frames.truth_row[g]]
    box = frames.truth_boxes[g]
    error = frames.tracks.mean[m] - true
    # A table of boxes alone has zeros for motion, which is no claim that everything stands still.
    for part in (slice(2, 4), slice(4, 6)):
        if not frames.tracks.mean[:, part].any() and not np.isfinite(frames.tracks.var[:, part]).any():
            error[:, part] = np.nan
    off = np.abs(box[:, :2] + 0.5 * box[:, 2:] - true[:, :2]).max(axis=1, initial=0.0)
    return MatchedErrors(g, m, error, frames.tracks.var[m], off > TRUNCATED_PX)


def kinematic_errors(
    sequences: Sequence[Frames],
    *,
    iou: float = 0.5,
    nees_max_age_s: float = 0.01,
    include_truncated: bool = False,
) -> KinematicErrors | None:
    """Pool the errors of matched pairs over sequences.

    Args:
        sequences: laid out frame by frame.
        iou: smallest IoU of a match.
        nees_max_age_s: NEES is taken of estimates at most this far from a row of the table, since a table
            has no covariance between position and velocity, which a longer prediction would need.
        include_truncated: also judge boxes cut off by the picture's edge. The true x, y is that of the whole
            vehicle there, while a detector sees the centre of what is left.

    Returns:
        The errors, or None where no sequence has true motion.
    """
    errors, variances, fresh, cut = [], [], [], 0
    for frames in sequences:
        one = matched_errors(frames, iou=iou)
        if one is None:
            continue
        keep = np.ones(len(one.error), dtype=bool) if include_truncated else ~one.truncated
        cut += int((~keep).sum())
        errors.append(one.error[keep])
        variances.append(one.var[keep])
        fresh.append(frames.tracks.age_s[one.track_entry[keep]] <= nees_max_age_s)
    if not errors:
        return None
    error, var = np.concatenate(errors), np.concatenate(variances)[:, :2]
    known = np.isfinite(var).all(axis=1) & np.isfinite(error[:, :2]).all(axis=1)
    usable = np.concatenate(fresh) & known & (var > 0.0).all(axis=1)
    nees = (error[usable, :2] ** 2 / var[usable]).sum(axis=1)
    low, high = _nees_interval(len(nees))
    return KinematicErrors(
        position_rmse=_rmse(error[:, 0:2]),
        velocity_rmse=_rmse(error[:, 2:4]),
        acceleration_rmse=_rmse(error[:, 4:6]),
        nees=float(nees.mean()) if len(nees) else float("nan"),
        nees_low=low,
        nees_high=high,
        pairs=len(error),
        nees_pairs=len(nees),
        truncated_pairs=cut,
    )


def _rmse(error: FloatArray) -> float:
    known = error[np.isfinite(error).all(axis=1)]
    return float(np.sqrt((known**2).sum(axis=1).mean())) if len(known) else float("nan")


def _nees_interval(count: int) -> tuple[float, float]:
    """95 % interval of the mean of `count` independent χ² values of 2 degrees of freedom."""
    if not count:
        return float("nan"), float("nan")
    from scipy.special import chdtri

    return float(chdtri(2.0 * count, 0.975)) / count, float(chdtri(2.0 * count, 0.025)) / count
