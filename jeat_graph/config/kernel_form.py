"""The configuration in the form in which compiled kernels take it: named tuples of numbers and arrays.

The tuples of settings are made from the schema: each number and flag of a section, and each property that
derives one from them (a bound from a probability, a number from a name), stands under its own name, as
`settings.motion.jerk_px`. A setting added to the schema is there for kernels without another line.
"""

from __future__ import annotations

import typing
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, NewType

import numpy as np

from jeat_graph.config.schema import Config, SensorConfig
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.lent import lent

_SCALARS = (bool, int, float)
# Of a sensor whose scores say nothing of how boxes fit, or of how exact they are.
_ALWAYS_ONE = ((0.0, 1.0),)


def _members(section: type[Any]) -> dict[str, type[Any]]:
    """Names and types of a section's numbers and flags, declared or derived, in their order."""
    hints = typing.get_type_hints(section)
    declared = {f.name: hints[f.name] for f in fields(section)}
    derived = {
        name: typing.get_type_hints(value.fget)["return"]
        for name, value in vars(section).items()
        if isinstance(value, property)
    }
    return {name: kind for name, kind in {**declared, **derived}.items() if kind in _SCALARS}


def _sections() -> dict[str, type[Any]]:
    """Sections of the configuration that kernels know, by their names."""
    hints = typing.get_type_hints(Config)
    return {
        f.name: hints[f.name]
        for f in fields(Config)
        if is_dataclass(hints[f.name]) and f.metadata.get("kernels", True)
    }


def _tuple_class(name: str, members: dict[str, type[Any]]) -> type[Any]:
    """Make a named tuple that is lent, in this module, where numba's cache on disk looks for it again."""
    made = NamedTuple(name, list(members.items()))  # type: ignore[misc]
    made.__module__ = __name__
    globals()[name] = made
    return lent(made)


# Types are written as texts in the schema; to resolve them anew for every tracker took most of its setup.
_MEMBERS = {section: _members(section) for section in (Config, SensorConfig, *_sections().values())}
_SECTION_TUPLES = {
    name: _tuple_class(section.__name__.replace("Config", "Settings"), _MEMBERS[section])
    for name, section in _sections().items()
}

if TYPE_CHECKING:
    # The tuples have the names and types of the schema, so a kernel's use of a setting is checked against it.
    Settings = NewType("Settings", Config)
else:
    Settings = _tuple_class("Settings", {**_SECTION_TUPLES, **_MEMBERS[Config]})


@lent
class SensorArrays(NamedTuple):
    """Parameters of the S sensors, in alphabetical order of their names (see `config.sensors`).

    Attributes:
        sigma_px: (S,) px.
        rho: (S, 2) fraction of width and height.
        rho_size: (S,) fraction of sqrt(w h).
        correlated_share: (S,) share of the centre's noise variance that is correlated in time.
        error: (S,) the sensor's error state, counted from 0; -1 where its errors are white.
        correlation_time_s: (B,) correlation time of each error state (s).
        size_var: (S, 2) variances of ln width, ln height.
        bias: (S, 4) centre x / width, centre y / height, ln width, ln height.
        bias_std: (S,) standard deviation of ln width and ln height beyond it; 0: there is none.
        p_detect: (S,) prior of a new track.
        clutter_per_scan: (S,) expected false boxes a scan.
        period_s: (S,) nominal time between scans (s).
        precision: (S,) overall.
        curve_score: (S, K) knots of the calibrated precision, padded with the last.
        curve_precision: (S, K) its values.
        fit_score: (S, K) knots of the probability that the box of a track with such a detection fits.
        fit_share: (S, K) its values; 1 where scores say nothing of it.
        noise_score: (S, K) knots of how exact a box of a score is.
        noise_factor: (S, K) its values: factors on standard deviations; 1 where scores say nothing of it.
        tempering: (S,) exponent on evidence.
        blind_speed: (S,) px/s.
        least_overlap: (S,) least IoU with a track that another sensor has seen; 0: any.
        disagreement: (S,) power of the share of its lasting tracks that others see; 0: always believed.
        prior_trust: (S,) trust in the sensor before anything is known of it.
    """

    sigma_px: FloatArray
    rho: FloatArray
    rho_size: FloatArray
    correlated_share: FloatArray
    error: IntArray
    correlation_time_s: FloatArray
    size_var: FloatArray
    bias: FloatArray
    bias_std: FloatArray
    p_detect: FloatArray
    clutter_per_scan: FloatArray
    period_s: FloatArray
    precision: FloatArray
    curve_score: FloatArray
    curve_precision: FloatArray
    fit_score: FloatArray
    fit_share: FloatArray
    noise_score: FloatArray
    noise_factor: FloatArray
    tempering: FloatArray
    blind_speed: FloatArray
    least_overlap: FloatArray
    disagreement: FloatArray
    prior_trust: FloatArray


@lent
class Model(NamedTuple):
    """All that a step of the tracker knows beforehand: its sensors and its settings.

    Attributes:
        sensors: parameters of the S sensors.
        settings: numbers and flags of the configuration, by section.
        priority: (S,) sensors in the order in which the sequential association serves them.
    """

    sensors: SensorArrays
    settings: Settings
    priority: IntArray


def kernel_model(config: Config) -> Model:
    """Return a configuration as compiled kernels take it."""
    return Model(sensor_arrays(config), kernel_settings(config), priority_order(config))


def error_states(sensors: Sequence[SensorConfig]) -> tuple[IntArray, FloatArray]:
    """Number the error states of the sensors whose errors are correlated in time, in their order.

    Args:
        sensors: S sensors.

    Returns:
        (S,) the error state of each, counted from 0, or -1; (B,) correlation time of each error state (s).
    """
    lasting = np.array([s.correlated_share > 0.0 for s in sensors])
    return np.where(lasting, np.cumsum(lasting) - 1, -1), np.array([s.memory_s for s in sensors])[lasting]


def sensor_arrays(config: Config) -> SensorArrays:
    """Collect the parameters of the sensors into arrays, in the order of `config.sensor_names`."""
    sensors = [config.sensors[name] for name in config.sensor_names]
    score, precision = _padded([s.score_precision for s in sensors])
    fit_score, fit_share = _padded([s.score_fit or _ALWAYS_ONE for s in sensors])
    noise_score, noise_factor = _padded([s.score_noise or _ALWAYS_ONE for s in sensors])
    error, correlation_time_s = error_states(sensors)
    same = {
        name: np.array([getattr(s, name) for s in sensors], dtype=np.float64)
        for name in _MEMBERS[SensorConfig]
        if name in SensorArrays._fields
    }
    lifecycle = config.lifecycle
    power = np.array([lifecycle.disagreement if s.disagreement is None else s.disagreement for s in sensors])
    return SensorArrays(
        **same,
        rho=np.array([[s.rho_x, s.rho_y] for s in sensors]),
        error=error,
        correlation_time_s=correlation_time_s,
        size_var=np.array([[s.sigma_log_width**2, s.sigma_log_height**2] for s in sensors]),
        bias=np.array([s.bias for s in sensors]),
        period_s=np.array([1.0 / s.rate_hz for s in sensors]),
        curve_score=score,
        curve_precision=precision,
        fit_score=fit_score,
        fit_share=fit_share,
        noise_score=noise_score,
        noise_factor=noise_factor,
        disagreement=power,
        prior_trust=lifecycle.agreement_prior**power,
    )


def _padded(curves: Sequence[Sequence[tuple[float, float]]]) -> tuple[FloatArray, FloatArray]:
    """Knots (S, K) and values (S, K) of curves, each padded with its last value.

    Knots at one place would make the interpolation ambiguous; the padding lies beyond every score.
    """
    knots = max(len(curve) for curve in curves)
    score, value = np.empty((2, len(curves), knots))
    for s, curve in enumerate(curves):
        for k in range(knots):
            score[s, k] = curve[k][0] if k < len(curve) else 2.0 + k
            value[s, k] = curve[min(k, len(curve) - 1)][1]
    return score, value


def kernel_settings(config: Config) -> Settings:
    """Return the numbers and flags of a configuration as nested named tuples.

    Each has the type that the schema declares, whatever it was set with: kernels are compiled for types.
    """

    def values(source: Any) -> dict[str, Any]:
        return {name: kind(getattr(source, name)) for name, kind in _MEMBERS[type(source)].items()}

    sections = {name: made(**values(getattr(config, name))) for name, made in _SECTION_TUPLES.items()}
    make: Any = Settings
    return typing.cast(Settings, make(**sections, **values(config)))


def priority_order(config: Config) -> IntArray:
    """Sensors in the order in which the sequential association serves them (S,)."""
    names = config.sensor_names
    first = list(config.association.priority)
    rest = [name for name in names if name not in first]
    return np.array([names.index(name) for name in first + rest], dtype=np.int64)
