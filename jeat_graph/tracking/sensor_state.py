"""What the tracker has learnt of each sensor while it ran: false boxes, detection probability, noise."""

from __future__ import annotations

from typing import NamedTuple


class SensorState(NamedTuple):
    """Running estimates of one sensor; they weigh what it says.

    Attributes:
        clutter: expected false boxes in a scan.
        p_detect: mean probability that it detects a confirmed track.
        trust: factor on the weight of its evidence, as far as the other sensors bear it out, in (0, 1].
        blind: probability that it is blind as a whole now: finds nothing, whatever is there.
        noise_scale: mean factor on its noise variance over the confirmed tracks (paper eq. 5), 1 without any.
        offset_centre_share: what its centres are off by beside those of others, as a share of the side;
        offset_centre_px: and by so much whatever the size (px), in the middle of where vehicles have been.
        offset_log_size: what its ln width and ln height are off by.
        offset_place_x: what its centres are off by for each px to the right of that middle (px per px),
        offset_place_y: and for each px below it. All of these are taken off its boxes.
        lag_s: by how much its boxes are older than the youngest sensor's, as moving vehicles tell (s);
        lag_std_s: the standard deviation of that, None before there is any. It is not taken off:
            `sensors.*.latency_s` does that.
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
