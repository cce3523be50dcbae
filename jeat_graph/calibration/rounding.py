"""Rounding of calibrated numbers to what the data can say, so that configuration files read well."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from jeat_graph.config.fields import SMALLEST
from jeat_graph.config.schema import Config

_DIGITS = 4
_Section = TypeVar("_Section")


def with_estimates(section: _Section, **values: Any) -> _Section:
    """Replace fields of a section by estimates.

    Of data without any noise an estimate may be closer to 0 than a setting may be: then it is 0.
    """
    return replace(section, **{name: _or_zero(value) for name, value in values.items()})  # type: ignore[type-var]


def _or_zero(value: Any) -> Any:
    if isinstance(value, float):
        return 0.0 if abs(value) < SMALLEST else value
    return tuple(map(_or_zero, value)) if isinstance(value, tuple) else value


def rounded(config: Config, digits: int = _DIGITS) -> Config:
    """Round every number of the sensors, motion, size and birth sections to significant digits.

    Args:
        config: any.
        digits: significant digits kept.
    """
    sensors = {name: _section(s, digits) for name, s in config.sensors.items()}
    return replace(
        config,
        sensors=sensors,
        motion=_section(config.motion, digits),
        size=_section(config.size, digits),
        birth=_section(config.birth, digits),
    )


def _section(section: Any, digits: int) -> Any:
    values = {f.name: _value(getattr(section, f.name), digits) for f in fields(section)}
    # Scores may crowd near 1; the knots are rounded where they are made, and stay apart.
    for knots in ("score_precision", "score_fit", "score_noise"):
        values.pop(knots, None)
    return replace(section, **values)


def _value(value: Any, digits: int) -> Any:
    if isinstance(value, float):
        return float(f"{value:.{digits}g}")
    if is_dataclass(value):
        return _section(value, digits)
    if isinstance(value, tuple):
        return tuple(_value(v, digits) for v in value)
    return value
