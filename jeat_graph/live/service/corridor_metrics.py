"""What a service of several cameras measures, for Prometheus: that of each camera, and the corridor's own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Protocol

from jeat_graph.live.service.metrics import Metrics, MetricsText, family
from jeat_graph.live.service.status import Status


class _Camera(Protocol):
    starts: int

    @property
    def status(self) -> Status: ...


class _Measured(Protocol):
    """A service of several cameras."""

    @property
    def cameras(self) -> Mapping[str, _Camera]: ...

    def health(self) -> dict[str, Any]: ...


class CorridorMetrics(MetricsText):
    """The metrics of a corridor; those of a camera have the label `camera`.

    Args:
        service: of several cameras.
    """

    def __init__(self, service: _Measured) -> None:
        self._service = service
        super().__init__()

    def collect(self) -> Iterator[Any]:
        """Yield the families of values, as the registry asks for them."""
        merged: dict[str, Any] = {}
        for name, camera in self._service.cameras.items():
            for one in Metrics(camera.status).collect():
                one.samples = [row._replace(labels={**row.labels, "camera": name}) for row in one.samples]
                if one.name in merged:
                    merged[one.name].samples += one.samples
                else:
                    merged[one.name] = one
        yield from merged.values()
        yield from self._own()

    def _own(self) -> Iterator[Any]:
        from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily

        gauge, counter = GaugeMetricFamily, CounterMetricFamily
        health = self._service.health()
        corridor, gaps = health["corridor"], health["corridor"]["gaps"]
        yield family(gauge, "corridor_ready", "1 if nothing is wrong", [([], float(health["ready"]))])
        age = health["checkpoint_age_s"]
        if age is not None:
            text = "since the newest checkpoint of who is on the way"
            yield family(gauge, "corridor_checkpoint_age_seconds", text, [([], age)])
        rows = [([name], float(one.starts)) for name, one in self._service.cameras.items()]
        yield family(counter, "camera_starts", "times that a camera's service was begun", rows, "camera")
        rows = [([name], one["passages"]) for name, one in corridor["cameras"].items()]
        yield family(counter, "passages", "vehicles that passed a camera's line", rows, "camera")
        for kind, name, key, text in (
            (counter, "followed", "followed", "vehicles that were followed through a gap"),
            (gauge, "on_the_way", "on_way", "vehicles in a gap"),
            (gauge, "followed_share", "followed_share", "of the last vehicles at the second camera"),
            (gauge, "learnt_share", "learnt_share", "that share when the corridor was learnt"),
            (gauge, "appearance_d_prime", "d_prime", "of embeddings that are compared, as learnt"),
            (gauge, "slowness", "slowness", "ln travel time beyond what speeds and learning say"),
            (gauge, "travel_time_seconds", "mean_s", "mean of the vehicles of the last interval"),
            (gauge, "travel_time_low_seconds", "low_s", "lower end of its 95 % interval"),
            (gauge, "travel_time_high_seconds", "high_s", "upper end of its 95 % interval"),
        ):
            rows = [([one["from"], one["to"]], float(one[key])) for one in gaps if one[key] is not None]
            yield family(kind, name, text, rows, "from", "to")
        rows = [([one["from"], one["to"]], one["vehicles"]) for one in corridor["od"]]
        yield family(
            counter, "od", "vehicles by the first and last camera that they passed", rows, "from", "to"
        )
