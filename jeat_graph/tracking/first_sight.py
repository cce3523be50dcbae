"""Sensors that nobody has declared: a tracker declares them when it meets their first scan."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from jeat_graph.config.schema import Config, SensorConfig
from jeat_graph.data.errors import ConfigError, UnknownSensorError


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
