"""What the tracker has learnt of each sensor while it ran: false boxes, detection probability, noise."""

from __future__ import annotations

from typing import NamedTuple

from jeat_graph.tracking.snapshot import Snapshot


class SensorState(NamedTuple):
    """Running estimates of one sensor; they weigh what it says.

    Attributes:
        clutter: expected false boxes in a scan.
        p_detect: mean probability that it detects a confirmed track.
        trust: factor on the weight of its evidence, as far as the other sensors bear it out, in (0, 1].
        blind: probability that it is blind as a whole now: finds nothing, whatever is there.
        noise_scale: mean factor on its noise variance over the confirmed tracks (paper eq. 5), 1 without any.
        offset_centre_share: what its centres are off by beside those of others, as a share of the side;
        offset_centre_px: and by so much whatever the size (px).
        offset_log_size: what its ln width and ln height are off by. All of it is taken off its boxes.
    """

    clutter: float
    p_detect: float
    trust: float
    blind: float
    noise_scale: float
    offset_centre_share: tuple[float, float] = (0.0, 0.0)
    offset_centre_px: tuple[float, float] = (0.0, 0.0)
    offset_log_size: tuple[float, float] = (0.0, 0.0)


def sensor_states(now: Snapshot, sensors: tuple[str, ...]) -> dict[str, SensorState]:
    """Return the state of each sensor, by name."""
    scale = now.tracks.scale[now.tracks.confirmed]
    return {
        name: SensorState(
            float(now.scene.clutter[s]),
            float(now.scene.p_detect[s]),
            float(now.scene.trust[s]),
            float(now.scene.blind[s]),
            float(scale[:, s].mean()) if len(scale) else 1.0,
            *[(float(x), float(y)) for x, y in now.scene.offsets[s].T],
        )
        for s, name in enumerate(sensors)
    }
