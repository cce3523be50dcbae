"""What the tracker has learnt of each sensor while it ran: false boxes, detection probability, noise."""

from __future__ import annotations

from typing import NamedTuple


class SensorState(NamedTuple):
    """Running estimates of one sensor.

    Attributes:
        clutter: mean number of boxes in a scan that no track takes.
        p_detect: mean probability that it detects an object that it can see.
        trust: probability that an object that it reports again and again is real, in (0, 1].
        blind: 0; not estimated.
        noise_scale: variance of its boxes over the prior one; of the engine `paper` the mean of eq. 5.
        offset_centre_share: offset of its boxes' centres from those of the other sensors, as a share of the
            side; it is subtracted from its boxes, and so is
        offset_log_size: that of ln width and ln height.
        offset_centre_px, offset_place_x, offset_place_y: 0; not estimated.
        lag_s, lag_std_s: 0 and None; not estimated while tracking (`calibrate` does).
    """

    clutter: float
    p_detect: float
    trust: float
    blind: float
    noise_scale: float
    offset_centre_share: tuple[float, float] = (0.0, 0.0)
    offset_centre_px: tuple[float, float] = (0.0, 0.0)
    offset_log_size: tuple[float, float] = (0.0, 0.0)
    offset_place_x: tuple[float, float] = (0.0, 0.0)
    offset_place_y: tuple[float, float] = (0.0, 0.0)
    lag_s: float = 0.0
    lag_std_s: float | None = None
