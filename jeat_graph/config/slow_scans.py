"""Settings for scans that come seldom: what may move how far between two of them, and how long one waits.

The settings of motion say what a vehicle may do in a second, and with several scans a second that is little
from one to the next. At one scan a second it is so much that anything may have become anything: a new track
whose velocity has a standard deviation of four lengths a second could be any of the next boxes, none is
worth believing, and all that is found counts as clutter. Among many vehicles nobody can tell apart what moves
further between two scans than about its own length, so that bounds what is expected. But however seldom the
scans, a usual speed stays possible: where there are few vehicles, each can be told apart.
Tracks are waited for over a scan and a half at first, and over five when they are confirmed.
"""

from __future__ import annotations

from dataclasses import replace

from jeat_graph.config.schema import Config

# What two scans are expected to tell apart at most, in lengths of a vehicle, T being the time between two: a
# new track's velocity (over T) and acceleration (over T²), the root density of the jerk (over T^5/2), and the
# rate of ln size (over T) and its hardest density (over T³).
_VELOCITY, _ACCELERATION, _JERK, _SIZE_RATE, _SIZE_DENSITY = 0.78, 0.3, 0.2, 0.2, 0.3
# What vehicles usually do, in lengths a second: a new track's velocity is not expected to be less than that,
# unless it were more than so many lengths from one scan to the next.
_USUAL_VELOCITY, _MOST_APART = 1.6, 1.6
# From this rate on scans come often enough: there the bounds are no narrower than the motion of `default`.
_OFTEN_HZ = 4.9
# Scans that a track may miss and live.
_TENTATIVE_SCANS, _CONFIRMED_SCANS = 1.5, 5.0


def fastest_hz(config: Config) -> float:
    """Return the rate of the fastest of a configuration's sensors (Hz); there has to be one."""
    return max(sensor.rate_hz for sensor in config.sensors.values())


def for_slow_scans(config: Config) -> Config:
    """Return a configuration whose motion and patience suit the rate of its fastest sensor.

    From five scans a second on it is the one that was given.

    Args:
        config: its sensors with their rates.
    """
    rate_hz = fastest_hz(config)
    if rate_hz >= _OFTEN_HZ:
        return config
    period_s = 1.0 / rate_hz
    moved = max(_VELOCITY, min(_USUAL_VELOCITY * period_s, _MOST_APART))
    motion, size, lifecycle = config.motion, config.size, config.lifecycle
    return replace(
        config,
        motion=replace(
            motion,
            velocity_std_per_size=min(motion.velocity_std_per_size, moved / period_s),
            acceleration_std_per_size=min(motion.acceleration_std_per_size, _ACCELERATION / period_s**2),
            jerk_per_size=min(motion.jerk_per_size, _JERK / period_s**2.5),
        ),
        size=replace(
            size,
            rate_std=min(size.rate_std, _SIZE_RATE / period_s),
            rate_density=min(size.rate_density, _SIZE_DENSITY / size.change_step / period_s**3),
        ),
        lifecycle=replace(
            lifecycle,
            max_gap_tentative_s=max(lifecycle.max_gap_tentative_s, _TENTATIVE_SCANS * period_s),
            max_gap_confirmed_s=max(lifecycle.max_gap_confirmed_s, _CONFIRMED_SCANS * period_s),
        ),
    )
