"""What a service measures, for Prometheus: the values of its status at the moment when they are asked for."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

from jeat_graph.data.errors import ConfigError
from jeat_graph.data.extras import install
from jeat_graph.live.service.status import Status

_PREFIX = "jeat_graph_"


class MetricsText:
    """Makes the text of `/metrics` of what `collect` yields.

    Attributes:
        content_type: of the text.

    Raises:
        ConfigError: the package `prometheus-client` is missing.
    """

    def __init__(self) -> None:
        try:
            from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
        except ImportError:
            raise ConfigError(
                f"/metrics needs a package more: {install('serve')}; or set web.port: 0"
            ) from None
        self.content_type: str = CONTENT_TYPE_LATEST
        self._generate = generate_latest
        self._registry: Any = CollectorRegistry()
        self._registry.register(self)

    def text(self) -> bytes:
        """Return the values of now."""
        return bytes(self._generate(self._registry))

    def collect(self) -> Iterator[Any]:
        """Yield the families of values, as the registry asks for them."""
        raise NotImplementedError


def family(kind: Any, name: str, text: str, rows: list[tuple[list[str], float]], *labels: str) -> Any:
    """Return a family of metrics.

    Args:
        kind: class of the family.
        name: without the prefix that all have.
        text: what it is.
        rows: values of the labels, and the value.
        labels: their names.
    """
    made = kind(_PREFIX + name, text, labels=labels)
    for values, value in rows:
        made.add_metric(values, value)
    return made


class Metrics(MetricsText):
    """The metrics of a service.

    Args:
        status: of the service.
    """

    def __init__(self, status: Status) -> None:
        self._status = status
        super().__init__()

    def collect(self) -> Iterator[Any]:
        """Yield the families of values, as the registry asks for them."""
        from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily

        status, now = self._status, time.monotonic()
        health = status.health()
        gauge, counter = GaugeMetricFamily, CounterMetricFamily
        yield family(gauge, "ready", "1 if nothing is wrong", [([], float(health["ready"]))])
        yield family(gauge, "up_seconds", "since the start of the process", [([], health["up_s"])])
        yield family(gauge, "tracks", "tracks reported now", [([], float(status.tracks))])
        if status.lag_s is not None:
            yield family(gauge, "lag_seconds", "from a scan's time to its answer", [([], status.lag_s)])
        if status.saved is not None:
            age: list[tuple[list[str], float]] = [([], now - status.saved)]
            yield family(gauge, "checkpoint_age_seconds", "since the newest checkpoint", age)
        aside: list[tuple[list[str], float]] = [([], float(len(status.set_aside)))]
        yield family(gauge, "checkpoints_set_aside", "that could not be continued from at the start", aside)
        for name, value in health["messages"].items():
            if name != "passed_over":  # scans, by sensor
                text = f"messages or checkpoints {name.replace('_', ' ')}"
                yield family(counter, name, text, [([], value)])
        passed = [([sensor], float(count)) for sensor, count in status.passed_over.items()]
        yield family(counter, "passed_over", "scans of a sensor passed over", passed, "sensor")
        yield family(counter, "dropped", "pictures dropped and scans passed over", [([], status.dropped)])
        sensors = health["sensors"].items()
        for name, key in (("scans", "scans"), ("boxes", "boxes")):
            rows = [([sensor], one[key]) for sensor, one in sensors]
            yield family(counter, f"sensor_{name}", f"{name} of a sensor", rows, "sensor")
        rows = [([sensor], one["last_scan"]) for sensor, one in sensors]
        yield family(gauge, "sensor_last_scan_seconds", "time of the newest scan", rows, "sensor")
        rows = [([sensor], one["age_s"]) for sensor, one in sensors]
        yield family(gauge, "sensor_age_seconds", "since the newest scan came", rows, "sensor")
        rows = [([sensor], one["behind_s"]) for sensor, one in sensors]
        yield family(gauge, "sensor_behind_seconds", "from the newest scan's time to now", rows, "sensor")
        rows = [([sensor], one["clock"]["lag_s"]) for sensor, one in sensors if one["clock"] is not None]
        yield family(gauge, "sensor_clock_lag_seconds", "found, and taken off its times", rows, "sensor")
        ends = [("source", one) for one in (*health["sources"], *health["cameras"])]
        ends += [("sink", one) for one in health["sinks"]]
        for kind, name, key in ((gauge, "connected", "connected"), (counter, "reconnects", "reconnects")):
            rows = [([role, one["name"], one.get("sensor", "")], float(one[key])) for role, one in ends]
            yield family(kind, name, f"{name} of sources and sinks", rows, "role", "name", "sensor")
        for name in ("pictures", "dropped"):
            rows = [([one["name"], one["sensor"]], one[name]) for one in health["cameras"]]
            yield family(counter, f"camera_{name}", f"{name} of a camera", rows, "name", "sensor")
