"""What the tracker has learnt of each sensor while it ran: false boxes, detection probability, noise."""

from __future__ import annotations

from typing import NamedTuple


class SensorState(NamedTuple):
    """Running estimates of one sensor; NaN where the engine does not estimate it.

    Attributes:
        noise_scale: variance of its boxes over the prior one; of the engine `paper` the mean of eq. 5.
        clutter: mean number of boxes in a scan that are of nothing real.
        p_detect: mean probability that it detects an object that it can see.
        precision: probability that what it detects again and again is real.
        unseen: share of real objects that it never detects.
        stationary_unseen: share of the others that it does not detect while they stand.
        lasting_error: standard deviation of what its boxes are off as long as they show one object (sizes).
        score_weight: weight of its scores as evidence: less than 1 where they turn out to say nothing.
        even_score: score at which its boxes are as likely real as false, by their scores alone.
        spread_factor: by which the standard deviations that it gives with its boxes are multiplied;
            1 where it gives none.
        offset_centre_share: offset of its boxes' centres from those of the other sensors, as a share of the
            side; it is subtracted from its boxes, and so is
        offset_log_size: that of ln width and ln height.
    """

    noise_scale: float
    clutter: float = float("nan")
    p_detect: float = float("nan")
    precision: float = float("nan")
    unseen: float = float("nan")
    stationary_unseen: float = float("nan")
    lasting_error: float = float("nan")
    score_weight: float = float("nan")
    even_score: float = float("nan")
    spread_factor: float = float("nan")
    offset_centre_share: tuple[float, float] = (0.0, 0.0)
    offset_log_size: tuple[float, float] = (0.0, 0.0)
