"""Sensors that fail: one that falls silent, one that delivers rubbish, and one that is well again.

A silent sensor needs no help in the tracker: only a scan that found nothing counts as a miss, and no scan
says nothing. One that delivers rubbish loses its weight by itself: the running estimates of its clutter and
of its noise rise, and the probability that what it finds is real falls. What is done here is to notice, and
to say so: by what is usual of the sensor itself, as a slow mean over the time in which it was well.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from jeat_graph.config.schema import Config, SensorConfig
from jeat_graph.data.detections import Scan
from jeat_graph.tracking.sensor_state import SensorState

SILENT, BACK, RUBBISH, WELL, CLOCK = "silent", "back", "rubbish", "well", "clock"
#: So many times its usual clutter, or noise variance, is rubbish; half of it is well again.
CLUTTER_FACTOR, NOISE_FACTOR, AGAIN = 5.0, 4.0, 0.5
#: So is a sensor whose finds are real with no more than this probability; twice that is well again.
LEAST_REAL = 0.05
#: Fewer false boxes a scan than this are never many.
LEAST_CLUTTER = 1.0
# Weight of one judgement in what is usual.
_FOLLOWS = 0.02
#: Of a sensor that nobody declared; made once, since each message asks.
_UNDECLARED = SensorConfig()


class HealthChange(NamedTuple):
    """A change of a sensor's health.

    Attributes:
        t: time of the newest scan (s).
        sensor: its name.
        what: `silent`, `back`, `rubbish`, `well` or `clock`.
        text: one sentence.
        numbers: what belongs to it.
    """

    t: float
    sensor: str
    what: str
    text: str
    numbers: Mapping[str, float] = {}

    def line(self) -> str:
        """Return it as JSON."""
        return json.dumps(
            {"t": self.t, "event": f"sensor-{self.what}", "sensor": self.sensor, **self.numbers}
        )


class SensorHealth:
    """Watches the sensors that have given a scan.

    Args:
        config: declared rates, and when a sensor counts as silent (`live`).

    Attributes:
        last: time of the newest scan of each sensor (s), its latency taken off.
        silent: sensors that are silent now.
        rubbish: sensors that deliver rubbish now.
        usual: clutter and noise variance of each sensor, as far as it was well.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self.last: dict[str, float] = {}
        self.silent: list[str] = []
        self.rubbish: list[str] = []
        self.usual: dict[str, list[float]] = {}

    def know(self, config: Config) -> list[str]:
        """Go by a configuration from now on: that of a tracker which has met another sensor.

        Returns:
            A line for each sensor that has not been known before.
        """
        fresh = sorted(config.sensors.keys() - self._config.sensors.keys())
        self._config = config
        return [
            f"sensor {name!r} is not declared: taken for a detector; without a scan for "
            f"{self._patience_s(name):g} s it counts as silent"
            for name in fresh
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
            quiet = now - t > self._patience_s(name)
            if quiet and name not in self.silent:
                self.silent.append(name)
                text = f"sensor {name!r} has given no scan since t = {t:.3f} s"
                events.append(HealthChange(now, name, SILENT, text))
            elif not quiet and name in self.silent:
                self.silent.remove(name)
                events.append(HealthChange(now, name, BACK, f"sensor {name!r} gives scans again"))
        return events

    def _patience_s(self, sensor: str) -> float:
        """Return after how long without a scan a sensor counts as silent (s)."""
        live, declared = self._config.live, self._config.sensors.get(sensor, _UNDECLARED)
        return max(live.silent_s, live.silent_periods / declared.rate_hz)

    def jumped(self, now: float) -> None:
        """Note that time goes on elsewhere: no sensor has been silent meanwhile.

        Args:
            now: time of the newest scan of all (s), its latency taken off.
        """
        self.last = dict.fromkeys(self.last, now)

    def judge(self, states: dict[str, SensorState], now: float) -> list[HealthChange]:
        """Compare what the tracker has learnt of the sensors with what is usual of them.

        Args:
            states: from `Tracker.sensor_states`.
            now: time of the newest scan of all (s).
        """
        events = []
        for name in self.last:
            state = states[name]
            usual = self.usual.setdefault(name, [state.clutter, state.noise_scale])
            worst = max(
                state.clutter / (CLUTTER_FACTOR * max(usual[0], LEAST_CLUTTER)),
                state.noise_scale / (NOISE_FACTOR * usual[1]),
                LEAST_REAL / max(state.precision, 1e-9),
            )
            if worst >= 1.0 and name not in self.rubbish:
                self.rubbish.append(name)
                text = (
                    f"sensor {name!r} delivers rubbish: {state.clutter:.3g} false boxes a scan "
                    f"({usual[0]:.3g} usually), noise variance {state.noise_scale / usual[1]:.3g} times as "
                    f"usual, {100.0 * state.precision:.2g} % of what it finds are real; it weighs less"
                )
                events.append(HealthChange(now, name, RUBBISH, text))
            elif worst < AGAIN and name in self.rubbish:
                self.rubbish.remove(name)
                events.append(HealthChange(now, name, WELL, f"sensor {name!r} is as good as usual again"))
            if worst < AGAIN:
                usual[0] += _FOLLOWS * (state.clutter - usual[0])
                usual[1] += _FOLLOWS * (state.noise_scale - usual[1])
        return events
