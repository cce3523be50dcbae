"""Sensors that nobody has declared: a tracker declares them when it meets their first scan.

A sensor that is declared and silent changes nothing. So a tracker that is told again all that it was told, by
a configuration with one more sensor, comes to the same state, and goes on from there. That takes as long as
it took before; a tracker that has been told too much to remember ends its tracks and begins anew instead.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from jeat_graph.config.schema import Config, SensorConfig
from jeat_graph.data.errors import ConfigError, UnknownSensorError

#: What a tracker was told is remembered up to so many calls, and so many boxes.
MOST_CALLS, MOST_BOXES = 1024, 20_000


class ToldSoFar:
    """The calls by which a tracker came to its state, while they are few enough to be made again."""

    def __init__(self) -> None:
        self._calls: list[tuple[str, Any]] | None = []
        self._boxes = 0

    @property
    def is_known(self) -> bool:
        """Whether all of it is remembered."""
        return self._calls is not None

    def note(self, method: str, argument: Any = None, boxes: int = 0) -> None:
        """Remember a call.

        Args:
            method: name of the method.
            argument: what it was given, or None for nothing.
            boxes: how many boxes that holds.
        """
        if self._calls is None:
            return
        self._calls.append((method, argument))
        self._boxes += boxes
        if len(self._calls) > MOST_CALLS or self._boxes > MOST_BOXES:
            self.forget()

    def forget(self) -> None:
        """Remember nothing, and nothing from now on."""
        self._calls = None

    def tell(self, other: Any) -> None:
        """Make the calls to another tracker."""
        for method, argument in self._calls or ():
            getattr(other, method)(*(() if argument is None else (argument,)))


def wider(config: Config, names: Iterable[str]) -> Config | None:
    """Return a configuration that declares some more sensors, as `track` does with those of a recording.

    Args:
        config: the configuration.
        names: of sensors, known ones too.

    Returns:
        The wider one; None where there is nothing to declare, or the configuration declares nobody's but its
        own (`input.undeclared`).

    Raises:
        UnknownSensorError: a name that no sensor can have, or too many sensors.
    """
    fresh = sorted(set(names) - set(config.sensors))
    if not fresh or config.input.undeclared != "declare":
        return None
    sensor = SensorConfig()
    try:
        return replace(config, sensors={**config.sensors, **dict.fromkeys(fresh, sensor)})
    except ConfigError as error:  # no fault of the configuration, but of a scan
        raise UnknownSensorError(str(error)) from None
