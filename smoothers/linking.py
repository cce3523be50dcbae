"""Which fragments of tracks are one vehicle? The smoothed end of one against the smoothed start of another.

Two explanations of a fragment's first state are weighed: it is the continuation of an earlier fragment,
predicted over the gap by the motion model, or a vehicle that appears there for the first time. The pairs with
the greatest total log odds are joined, in one assignment over the whole recording.

That two fragments agree says that they are of one *thing*. Whether it is a vehicle is another question, for
what a detector wrongly takes for one it takes again and again, at the same place: a fragment whose hits and
misses had it most likely for nothing when it was last seen is no vehicle that went on unseen, however well
its return agrees. What has not left its place is told from nothing by hits and misses, and from such a false
thing by what its detections look like alone; and a false thing needs nobody to hide it.

Source: the tracklet linking of Huang, Wu, Nevatia, Robust Object Tracking by Hierarchical Association of
Detection Responses, ECCV 2008, with the motion model's own densities.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.filters.motion import size_process_noise, size_transition
from jeat_graph.smoothers.transitions import motion_matrices

#: Degrees of freedom of a pair's squared distance: position, velocity, acceleration and size, in x and y.
FREEDOM = 8


# Standard deviation, in sizes of the vehicle, up to which a fragment's place over the gap counts as known.
_FORESEEN_SIZES = 1.25

#: So far from where it began, in sizes, a fragment has left the place: five times a usual error.
MOVED_SIZES = 0.25


@dataclass(frozen=True, eq=False)
class FragmentEnds:
    """First and last smoothed states of N fragments.

    Attributes:
        start_t: (N,) time of the first state (s).
        start_mean: (N, 2, 3) per axis [p, v, a] (px, px/s, px/s²): the motion alone, no error states.
        start_cov: (N, 2, 3, 3) its covariance.
        start_size: (N, 2) ln width and ln height then.
        start_size_var: (N, 2) their variances.
        end_t: (N,) time of the last state (s).
        end_mean: (N, 2, 3) per axis.
        end_cov: (N, 2, 3, 3) its covariance.
        end_size: (N, 2, 2) ln width and ln height with their rates.
        end_size_cov: (N, 2, 2, 2) their covariances.
        jerk: (N,) root spectral density of the jerk at the end (px/s^2.5).
        birth_log_density: (N,) ln of the density with which new vehicles appear in the first state.
        seen_t: (K,) times at which the sensors saw anything at all (s), ascending, and
        seen_s: (K,) for how long they had been seeing by then (s). Where the sensors see others, a vehicle
            is not hidden for long; where they see nothing, its silence says nothing.
        end_existence: (N,) probability, by all until then, that the fragment was a vehicle when last seen.
        end_worth: (N,) the same by nothing but what its detections look like.
    """

    start_t: FloatArray
    start_mean: FloatArray
    start_cov: FloatArray
    start_size: FloatArray
    start_size_var: FloatArray
    end_t: FloatArray
    end_mean: FloatArray
    end_cov: FloatArray
    end_size: FloatArray
    end_size_cov: FloatArray
    jerk: FloatArray
    birth_log_density: FloatArray
    seen_t: FloatArray
    seen_s: FloatArray
    end_existence: FloatArray
    end_worth: FloatArray


def seeing_time(t: FloatArray, longest_pause_s: float) -> tuple[FloatArray, FloatArray]:
    """For how long the sensors have been seeing, from the times (M,) of all detections taken, in any order.

    A pause longer than `longest_pause_s` in which nothing at all was detected does not count.

    Returns:
        (K,) ascending times (s) and (K,) seconds of seeing up to each.
    """
    moments = np.unique(t)
    steps = np.diff(moments, prepend=moments[:1])
    return moments, np.cumsum(np.where(steps <= longest_pause_s, steps, 0.0))


def candidate_pairs(ends: FragmentEnds, max_gap_s: float) -> tuple[IntArray, IntArray]:
    """Pairs (P,), (P,) in which the second fragment starts after the first ends, within `max_gap_s`."""
    order = np.argsort(ends.start_t, kind="stable")
    sorted_t = ends.start_t[order]
    low = np.searchsorted(sorted_t, ends.end_t, side="right")
    high = np.searchsorted(sorted_t, ends.end_t + max_gap_s, side="right")
    first = np.repeat(np.arange(len(low)), high - low)
    offset = np.arange(len(first)) - np.repeat(np.cumsum(high - low) - (high - low), high - low)
    return first, order[np.repeat(low, high - low) + offset]


def pair_scores(
    ends: FragmentEnds, first: IntArray, second: IntArray, size_density: float
) -> tuple[FloatArray, FloatArray]:
    """Compare the prediction of one fragment's end with another's start.

    S = F P Fᵀ + Q + P'; d² = eᵀ S⁻¹ e, summed over the axes and the size.

    Args:
        ends: the fragments.
        first: (P,) fragments that end.
        second: (P,) fragments that start.
        size_density: root spectral density of the rate of ln size (1/s^1.5).

    Returns:
        (P,) squared distances, χ² with `FREEDOM` degrees of freedom if the pair is one vehicle, and (P,) log
        likelihood ratios against a new vehicle.
    """
    gap = ends.start_t[second] - ends.end_t[first]
    F, Q = motion_matrices(gap, ends.jerk[first])
    F, Q = F[:, None], Q[:, None]
    error = ends.start_mean[second] - (F @ ends.end_mean[first, :, :, None])[..., 0]
    S = F @ ends.end_cov[first] @ F.swapaxes(-1, -2) + Q + ends.start_cov[second]
    d2 = (error * np.linalg.solve(S, error[..., None])[..., 0]).sum(axis=(1, 2))
    log_det = np.linalg.slogdet(S)[1].sum(axis=1)

    F2 = np.stack([size_transition(dt) for dt in gap.tolist()]).reshape(-1, 1, 2, 2)
    Q2 = np.stack([size_process_noise(dt, size_density) for dt in gap.tolist()]).reshape(-1, 1, 2, 2)
    predicted = (F2 @ ends.end_size[first, :, :, None])[..., 0, 0]
    spread = (F2 @ ends.end_size_cov[first] @ F2.swapaxes(-1, -2) + Q2)[..., 0, 0]
    var = spread + ends.start_size_var[second]
    d2 += ((ends.start_size[second] - predicted) ** 2 / var).sum(axis=1)
    log_det += np.log(var).sum(axis=1)
    log_density = -0.5 * (d2 + log_det + FREEDOM * np.log(2.0 * np.pi))
    return d2, log_density - ends.birth_log_density[second]


def foreseeable(ends: FragmentEnds, first: IntArray, second: IntArray) -> BoolArray:
    """Mark the pairs (P,) whose places over the gap are known to within about the size of the vehicle.

    A fragment of one or two detections has no velocity to speak of: it agrees with any vehicle that turns up
    near by, and where vehicles enter the picture one after the other, the likelihood of a new one is greater
    than that of one anywhere. The condition is on what is known of the states, not on how far they may have
    changed in between, forward from the end and backward from the start.
    """
    gap = ends.start_t[second] - ends.end_t[first]
    size = np.exp(0.5 * ends.end_size[first, :, 0].sum(axis=1))
    F, _ = motion_matrices(np.concatenate([gap, -gap]), np.ones(2 * len(gap)))
    P = np.concatenate([ends.end_cov[first], ends.start_cov[second]])
    spread = (F[:, None] @ P @ F[:, None].swapaxes(-1, -2))[..., 0, 0].max(axis=1).reshape(2, -1)
    return np.asarray((spread <= (_FORESEEN_SIZES * size) ** 2).all(axis=0))


def stay_in_place(ends: FragmentEnds, first: IntArray, second: IntArray) -> BoolArray:
    """Mark the pairs (P,) of which no end is far from where the first fragment began."""
    size = np.exp(0.5 * ends.end_size[first, :, 0].sum(axis=1))
    began = ends.start_mean[first, :, 0]
    others = ends.end_mean[first, :, 0], ends.start_mean[second, :, 0], ends.end_mean[second, :, 0]
    way = np.stack([np.hypot(*(other - began).T) for other in others]).max(axis=0)
    return np.asarray(way <= MOVED_SIZES * size)


def continuation_score(
    ratio: FloatArray, existence: FloatArray, hidden: FloatArray, silent: FloatArray
) -> FloatArray:
    """Log odds (P,) that a vehicle went on unseen, against a new vehicle or a false box that comes again.

    With r the probability that the first fragment was a vehicle, L the likelihood ratio of one thing against
    a new one, and h and f the probabilities that a vehicle and a false thing are not seen in between:
    r h L : (1 - r) f L + 1. False things come back as vehicles do, so agreement alone never makes a vehicle
    of one.

    Args:
        ratio: (P,) ln L.
        existence: (P,) r.
        hidden: (P,) ln h.
        silent: (P,) ln f.
    """
    tiny = np.finfo(np.float64).tiny
    doubt = np.log(np.maximum(1.0 - existence, tiny))
    vehicle = np.log(np.maximum(existence, tiny)) + hidden + ratio
    return np.asarray(vehicle - np.logaddexp(doubt + silent + ratio, 0.0))


def link(
    ends: FragmentEnds, *, max_gap_s: float, gate: float, size_density: float, hidden_s: float = np.inf
) -> IntArray:
    """Choose which fragments continue which, by one assignment of greatest total log odds.

    Args:
        ends: N fragments.
        max_gap_s: longest time between two fragments of one vehicle (s).
        gate: bound on a pair's squared distance.
        size_density: root spectral density of the rate of ln size (1/s^1.5).
        hidden_s: mean time for which a vehicle is hidden while the sensors see others (s).

    Returns:
        (N,) the fragment that each continues, or -1. Each is continued by one at most.
    """
    from scipy.optimize import linear_sum_assignment
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count = len(ends.start_t)
    before = np.full(count, -1, dtype=np.int64)
    first, second = candidate_pairs(ends, max_gap_s)
    if not len(first):
        return before
    d2, ratio = pair_scores(ends, first, second, size_density)
    seen = np.interp(ends.start_t[second], ends.seen_t, ends.seen_s)
    hidden = (np.interp(ends.end_t[first], ends.seen_t, ends.seen_s) - seen) / hidden_s
    in_place = stay_in_place(ends, first, second)
    existence = ends.end_existence[first] * np.where(in_place, ends.end_worth[first], 1.0)
    score = continuation_score(ratio, existence, hidden, np.where(in_place, 0.0, hidden))
    keep = (d2 <= gate) & (score > 0.0) & foreseeable(ends, first, second)
    first, second, score = first[keep], second[keep], score[keep]
    if not len(first):
        return before
    # Ends and starts are two sides of a graph, which falls into small independent parts.
    graph = coo_matrix((np.ones(len(first)), (first, count + second)), shape=(2 * count, 2 * count))
    part = connected_components(graph, directed=False)[1][first]
    for p in np.unique(part):
        mine = part == p
        rows, row = np.unique(first[mine], return_inverse=True)
        cols, col = np.unique(second[mine], return_inverse=True)
        gain = np.zeros((len(rows), len(cols)))
        gain[row, col] = score[mine]
        for a, b in zip(*linear_sum_assignment(gain, maximize=True), strict=True):
            if gain[a, b] > 0.0:
                before[cols[b]] = rows[a]
    return before
