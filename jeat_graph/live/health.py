"""Sensors that fail: one that falls silent, one that delivers rubbish, and one that is well again.

A silent sensor needs no help in the tracker: only a scan that found nothing counts as a miss, and no scan
says nothing. One that delivers rubbish loses its weight by itself: the running estimates of its clutter and
of its noise rise, and that of its trust falls. What is done here is to notice, and to say so.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Scan
from jeat_graph.tracking.sensor_state import SensorState

SILENT, BACK, RUBBISH, WELL = "silent", "back", "rubbish", "well"
#: So many times the configured clutter, or the greatest noise scale, is rubbish; half of it is well again.
CLUTTER_FACTOR, NOISE_FACTOR, AGAIN = 10.0, 4.0, 0.5
#: So is a sensor that the others bear out so little (factor on its evidence); twice that is well again.
LEAST_TRUST = 0.05


class HealthChange(NamedTuple):
    """A change of a sensor's health.

    Attributes:
        t: time of the newest scan (s).
        sensor: its name.
        what: `silent`, `back`, `rubbish` or `well`.
        text: one sentence.
    """

    t: float
    sensor: str
    what: str
    text: str


class SensorHealth:
    """Watches the sensors that have given a scan.

    Args:
        config: declared rates, clutter, and when a sensor counts as silent (`live`).

    Attributes:
        last: time of the newest scan of each sensor (s), its latency taken off.
        silent: sensors that are silent now.
        rubbish: sensors that deliver rubbish now.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self.know(config)
        self.last: dict[str, float] = {}
        self.silent: list[str] = []
        self.rubbish: list[str] = []

    def know(self, config: Config) -> list[str]:
        """Go by a configuration from now on: that of a tracker which has met another sensor.

        Returns:
            A line for each sensor that has not been known before.
        """
        fresh = sorted(config.sensors.keys() - self._config.sensors.keys())
        self._config, live = config, config.live
        self._patience_s = {
            name: max(live.silent_s, live.silent_periods / sensor.rate_hz)
            for name, sensor in config.sensors.items()
        }
        rates = {name: config.sensors[name].rate_hz for name in fresh}
        return [
            f"sensor {name!r} is not declared: taken for a detector at {hz:g} Hz"
            for name, hz in rates.items()
        ]

    def saw(self, scans: Iterable[Scan], now: float) -> list[HealthChange]:
        """Take note of scans.

        Args:
            scans: what the tracker has taken (`Arrival.taken`), the sensors' latencies taken off.
            now: time of the newest scan of all (s), its latency taken off.

        Returns:
            What has changed: a sensor is back, or another one has fallen silent meanwhile.
        """
        events = []
        for scan in scans:
            self.last[scan.sensor] = max(scan.t, self.last.get(scan.sensor, scan.t))
        for name, t in self.last.items():
            quiet = now - t > self._patience_s[name]
            if quiet and name not in self.silent:
                self.silent.append(name)
                text = f"sensor {name!r} has given no scan since t = {t:.6g} s"
                events.append(HealthChange(now, name, SILENT, text))
            elif not quiet and name in self.silent:
                self.silent.remove(name)
                events.append(HealthChange(now, name, BACK, f"sensor {name!r} gives scans again"))
        return events

    def jumped(self, now: float) -> None:
        """Note that time goes on elsewhere: no sensor has been silent meanwhile.

        Args:
            now: time of the newest scan of all (s), its latency taken off.
        """
        self.last = dict.fromkeys(self.last, now)

    def judge(self, states: dict[str, SensorState], now: float) -> list[HealthChange]:
        """Compare what the tracker has learnt of the sensors with what is declared of them.

        Args:
            states: from `Tracker.sensor_states`.
            now: time of the newest scan of all (s).
        """
        events = []
        for name in self.last:
            state, declared = states[name], self._config.sensors[name].clutter_per_scan
            worst = max(
                state.clutter / (CLUTTER_FACTOR * declared),
                state.noise_scale / NOISE_FACTOR,
                LEAST_TRUST / max(state.trust, 1e-9),
            )
            if worst >= 1.0 and name not in self.rubbish:
                self.rubbish.append(name)
                text = (
                    f"sensor {name!r} delivers rubbish: {state.clutter:.3g} false boxes a scan ({declared:g} "
                    f"declared), noise variance {state.noise_scale:.3g} times that declared, trust "
                    f"{state.trust:.2g}; it weighs less"
                )
                events.append(HealthChange(now, name, RUBBISH, text))
            elif worst < AGAIN and name in self.rubbish:
                self.rubbish.remove(name)
                events.append(HealthChange(now, name, WELL, f"sensor {name!r} is as good as declared again"))
        return events
