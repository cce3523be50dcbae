"""The pixel of CARLA's DVS sensor: ESIM's rule on the logarithm of an 8-bit picture, tick by tick.

The sensor has no noise model but thresholds redrawn from a normal distribution; what it shows in the dark
comes from the picture, where one step of the 8 bits is a large change of ln(ε + I/255). A game engine's
picture of a dark, static scene does flicker by such steps: its anti-aliasing moves the sampling points from
tick to tick and mixes the results over time, it adds film grain, and it rounds. We take all that as normal
noise added before the rounding.

An event is *by motion* if the same logarithm of the picture before noise and rounding has itself gone at
least half of the nominal threshold in the event's direction since the sensor last moved the pixel's
reference.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.config import CarlaEventConfig
from jeat_graph_sehn.simulation.imaging.event_sink import EventSink, put
from jeat_graph_sehn.simulation.imaging.pixel_random import normal, seeds

_LEAST_THRESHOLD = 0.01  # CARLA's floor of a redrawn threshold
_TOLERANCE = 1e-6  # changes below it count as none


class CarlaModel(NamedTuple):
    """Constants of all pixels: attributes of the sensor, and scale and gamma of its picture."""

    positive: float
    negative: float
    sigma: float
    refractory_us: float
    epsilon: float
    noise_dn: float
    scale: float
    gamma: float


class CarlaState(NamedTuple):
    """What all pixels remember, each (N,): see the fields of CARLA's sensor.

    Attributes:
        previous: logarithm at the last tick.
        reference: level of the last crossing.
        stamp: time of the last event (µs); below 0 for none.
        clean: logarithm of the picture before noise and rounding, at the last tick.
        at_reference: the same when the reference was last moved.
        random: states of the pixels' random numbers.
    """

    previous: FloatArray
    reference: FloatArray
    stamp: FloatArray
    clean: FloatArray
    at_reference: FloatArray
    random: npt.NDArray[np.uint64]


def make_carla_model(config: CarlaEventConfig, scale: float, gamma: float) -> CarlaModel:
    """Collect the constants; `scale` takes luminance to the linear level of the picture, 1 for white."""
    return CarlaModel(
        positive=config.positive_threshold,
        negative=config.negative_threshold,
        sigma=config.sigma_threshold,
        refractory_us=1e-3 * config.refractory_period_ns,
        epsilon=config.log_eps,
        noise_dn=config.render_noise_dn,
        scale=scale,
        gamma=gamma,
    )


def make_carla_state(model: CarlaModel, luminance: FloatArray, rng: np.random.Generator) -> CarlaState:
    """Start all pixels at a picture (N,), which is the first that the sensor sees."""
    random = seeds(rng, len(luminance))
    clean, noisy = _first_look(luminance, model, random)
    return CarlaState(noisy, noisy.copy(), np.full(len(luminance), -1.0), clean, clean.copy(), random)


@njit(cache=True, error_model="numpy")
def _first_look(
    luminance: FloatArray, model: CarlaModel, random: npt.NDArray[np.uint64]
) -> tuple[FloatArray, FloatArray]:
    clean, noisy = np.empty(len(luminance)), np.empty(len(luminance))
    for i in range(len(luminance)):
        clean[i], noisy[i] = look_at(i, luminance[i], model, random)
    return clean, noisy


@njit(cache=True, error_model="numpy")
def look_at(
    i: int, luminance: float, model: CarlaModel, random: npt.NDArray[np.uint64]
) -> tuple[float, float]:
    """Logarithm of a pixel of the picture: before noise and rounding, and as the sensor gets it."""
    level = 255.0 * min(max(luminance * model.scale, 0.0), 1.0) ** (1.0 / model.gamma)
    grain = model.noise_dn * normal(random, i) if model.noise_dn > 0.0 else 0.0
    rounded = math.floor(min(max(level + grain, 0.0), 255.0) + 0.5)
    return math.log(model.epsilon + level / 255.0), math.log(model.epsilon + rounded / 255.0)


@njit(cache=True, error_model="numpy")
def carla_advance(
    pixels: IntArray, luminance: FloatArray, start: float, end: float, model: CarlaModel, state: CarlaState,
    sink: EventSink,
) -> None:  # fmt: skip
    """Take pixels from the tick at `start` to that at `end`, and put their events.

    Args:
        pixels: (P,) which.
        luminance: (P,) what they see at `end` (cd/m²).
        start: µs.
        end: µs.
        model: constants of all pixels.
        state: of all pixels; changed.
        sink: where events go; it must have room.
    """
    for n in range(len(pixels)):
        i = int(pixels[n])
        clean, now = look_at(i, luminance[n], model, state.random)
        before, clean_before = state.previous[i], state.clean[i]
        state.previous[i], state.clean[i] = now, clean
        if abs(now - before) <= _TOLERANCE:
            continue
        brighter = now >= before
        sign = 1.0 if brighter else -1.0
        nominal = model.positive if brighter else model.negative
        threshold = nominal
        if model.sigma > 0.0:
            threshold = max(_LEAST_THRESHOLD, nominal + model.sigma * normal(state.random, i))
        level = state.reference[i] + sign * threshold
        # As in CARLA, a level that the signal has already passed before this tick ends the search.
        while (before < level <= now) if brighter else (now <= level < before):
            share = (level - before) / (now - before)
            t = start + share * (end - start)
            true = clean_before + share * (clean - clean_before)
            if state.stamp[i] < 0.0 or t - state.stamp[i] >= model.refractory_us:
                by_motion = sign * (true - state.at_reference[i]) >= 0.5 * nominal
                put(sink, t, i, brighter, by_motion)
                state.stamp[i] = t
            state.reference[i] = level
            state.at_reference[i] = true
            level += sign * threshold
