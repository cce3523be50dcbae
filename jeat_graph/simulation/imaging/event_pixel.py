"""The pixel of the physical event camera.

ESIM's rule on linear radiance: between two samples the logarithm of the photocurrent is a straight line, and
an event falls where it has gone a threshold away from where it was at the event before. What a real pixel
adds, after v2e: a photoreceptor whose bandwidth falls with light, thresholds that differ between pixels, a
dead time, leak, and shot noise.

An event is *by motion* if the noise-free signal (the photoreceptor's output, without leak and noise) has
itself gone at least half a threshold in the event's direction since the pixel's last reset, which is the end
of its last event's dead time; else noise had the larger share in it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.simulation.imaging.config import EventCameraConfig
from jeat_graph.simulation.imaging.event_sink import Sink, put
from jeat_graph.simulation.imaging.pixel_random import exponential, seeds, uniform

_LEAST_THRESHOLD = 0.01
_ARRIVED = 1e-6  # a photoreceptor this near to its input (ln) is taken to be there


class PixelModel(NamedTuple):
    """Constants of all pixels; times in µs.

    Attributes:
        on: (N,) threshold of brighter events (ln).
        off: (N,) threshold of darker events (ln).
        leak: (N,) drift of the reference (ln/µs).
        shot: (N,) rate of shot noise in the dark (1/µs).
        shot_bright: factor on it in bright light.
        shot_half: luminance at which half of the fall is done (cd/m²).
        refractory: dead time (µs).
        dark: luminance of the dark current (cd/m²).
        cutoff_max: highest bandwidth (1/µs, as 2 π f); 0 for no limit.
        cutoff_slope: bandwidth per luminance.
        cutoff_min: lowest bandwidth.
    """

    on: FloatArray
    off: FloatArray
    leak: FloatArray
    shot: FloatArray
    shot_bright: float
    shot_half: float
    refractory: float
    dark: float
    cutoff_max: float
    cutoff_slope: float
    cutoff_min: float


class PixelState(NamedTuple):
    """What all pixels remember, each (N,).

    Attributes:
        luminance: what was seen at the last sample (cd/m²).
        signal: logarithm of the photocurrent then.
        output: the photoreceptor's output at the last sample.
        reference: output at the last event, less what has leaked since.
        at_reset: output, noise-free, when the pixel was last reset.
        blind_until: end of the dead time (µs).
        next_shot: next candidate of shot noise (µs).
        random: states of the pixels' random numbers.
    """

    luminance: FloatArray
    signal: FloatArray
    output: FloatArray
    reference: FloatArray
    at_reset: FloatArray
    blind_until: FloatArray
    next_shot: FloatArray
    random: npt.NDArray[np.uint64]


def make_model(config: EventCameraConfig, rng: np.random.Generator, count: int) -> PixelModel:
    """Draw the pixels of one camera: its mismatch is the same in every segment."""
    draw = rng.standard_normal((4, count))
    on = np.maximum(config.threshold_on + config.threshold_sigma * draw[0], _LEAST_THRESHOLD)
    off = np.maximum(config.threshold_off + config.threshold_sigma * draw[1], _LEAST_THRESHOLD)
    spread = 10.0 ** (config.rate_spread_decades * draw[2:])
    angular = 2.0 * math.pi * 1e-6
    return PixelModel(
        on=on,
        off=off,
        leak=1e-6 * config.leak_rate_hz * spread[0] * on,
        shot=1e-6 * config.shot_rate_hz * spread[1],
        shot_bright=config.shot_bright_factor,
        shot_half=config.shot_half_luminance,
        refractory=1e6 * config.refractory_s,
        dark=config.dark_luminance,
        cutoff_max=angular * config.cutoff_max_hz,
        cutoff_slope=angular * config.cutoff_hz_per_cd_m2,
        cutoff_min=angular * min(config.cutoff_min_hz, config.cutoff_max_hz),
    )


def make_state(model: PixelModel, luminance: FloatArray, rng: np.random.Generator) -> PixelState:
    """Start all pixels at a picture (N,), settled; leaking ones anywhere between two leak events.

    The logarithm needs a luminance or a dark current above 0.
    """
    signal = np.log(luminance + model.dark)
    count = len(signal)
    phase = np.where(model.leak > 0.0, rng.random(count), 0.0)
    random = seeds(rng, count)
    return PixelState(
        luminance=np.array(luminance, dtype=np.float64),
        signal=signal,
        output=signal.copy(),
        reference=signal - phase * model.on,
        at_reset=signal.copy(),
        blind_until=np.full(count, -np.inf),
        next_shot=_first_shots(random, model.shot),
        random=random,
    )


@njit(cache=True)
def _first_shots(random: npt.NDArray[np.uint64], rate: FloatArray) -> FloatArray:
    out = np.empty(len(rate))
    for i in range(len(rate)):
        out[i] = exponential(random, i, rate[i])
    return out


@njit(cache=True)
def photoreceptor(
    output: float, before: float, after: float, duration: float, luminance: float, model: PixelModel
) -> float:
    """Output of a first-order low pass after its input went from `before` to `after` in a straight line.

    Its bandwidth is proportional to the luminance, between two limits (v2e; Graça et al. 2023).
    """
    if model.cutoff_max <= 0.0:
        return after
    bandwidth = min(max(model.cutoff_slope * luminance, model.cutoff_min), model.cutoff_max)
    k = duration * bandwidth
    if k < 1e-9:
        return output
    lag = (after - before) / k
    return after - lag + (output - before + lag) * math.exp(-k)


@njit(cache=True)
def advance(
    pixels: IntArray, luminance: FloatArray, start: float, end: float, settled: bool, model: PixelModel,
    state: PixelState, sink: Sink,
) -> None:  # fmt: skip
    """Take pixels from time `start` to `end`, and put their events.

    Args:
        pixels: (P,) which.
        luminance: (P,) what they see at `end` (cd/m²).
        start: µs.
        end: µs.
        settled: the caller knows that neither luminance nor the photoreceptors' outputs change.
        model: constants of all pixels.
        state: of all pixels; changed.
        sink: where events go; it must have room.
    """
    duration = end - start
    for n in range(len(pixels)):
        i = pixels[n]
        first = state.output[i]
        last = first
        if not settled:
            before = state.signal[i]
            after = before
            # Most pixels of a tile see nothing new, and logarithms and exponentials are what costs.
            if luminance[n] != state.luminance[i]:
                after = math.log(luminance[n] + model.dark)
                state.luminance[i] = luminance[n]
                state.signal[i] = after
            if after != before or first != after:
                last = photoreceptor(first, before, after, duration, luminance[n], model)
                if after == before and abs(last - after) < _ARRIVED:
                    last = after
                state.output[i] = last
        # The leak of the reference is taken as a rise of the signal, and given back at the end.
        leak = model.leak[i]
        true_slope = (last - first) / duration
        slope = true_slope + leak
        reference = state.reference[i]
        on, off = model.on[i], model.off[i]
        blind = state.blind_until[i]
        top = first + slope * duration - reference
        if state.next_shot[i] > end and -off < top < on and blind <= start:
            state.reference[i] = reference - leak * duration
            continue
        now = start
        while True:
            if blind > now:
                # In the dead time the pixel's amplifier is held at its input; shot noise is lost.
                while state.next_shot[i] < blind:
                    state.next_shot[i] += exponential(state.random, i, model.shot[i])
                if blind > end:
                    break
                now = blind
                reference = first + slope * (now - start)
                state.at_reset[i] = first + true_slope * (now - start)
            crossing = math.inf
            if slope > 0.0:
                crossing = start + (reference + on - first) / slope
            elif slope < 0.0:
                crossing = start + (reference - off - first) / slope
            crossing = max(crossing, now)
            shot = state.next_shot[i]
            if crossing <= end and crossing <= shot:
                now = crossing
                brighter = slope > 0.0
                reference += on if brighter else -off
                true = first + true_slope * (now - start)
                change = true - state.at_reset[i]
                by_motion = change >= 0.5 * on if brighter else -change >= 0.5 * off
            elif shot <= end:
                now = max(shot, now)
                state.next_shot[i] = shot + exponential(state.random, i, model.shot[i])
                dimming = luminance[n] / (luminance[n] + model.shot_half)
                if uniform(state.random, i) >= 1.0 - (1.0 - model.shot_bright) * dimming:
                    continue
                brighter = uniform(state.random, i) < 0.5
                true = first + true_slope * (now - start)
                reference = first + slope * (now - start)
                by_motion = False
            else:
                break
            put(sink, now, i, brighter, by_motion)
            state.at_reset[i] = true
            if model.refractory > 0.0:
                blind = now + model.refractory
        state.blind_until[i] = blind
        state.reference[i] = reference - leak * duration


@njit(cache=True)
def unsettled(pixels: IntArray, luminance: FloatArray, model: PixelModel, state: PixelState) -> float:
    """Greatest distance (ln) of the pixels' outputs from what they see."""
    most = 0.0
    for n in range(len(pixels)):
        i = pixels[n]
        most = max(most, abs(math.log(luminance[n] + model.dark) - state.output[i]))
    return most
