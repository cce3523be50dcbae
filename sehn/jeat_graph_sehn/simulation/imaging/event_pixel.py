"""The pixel of the physical event camera.

ESIM's rule on linear radiance: between two samples the logarithm of the photocurrent is a straight line, and
an event falls where it has gone a threshold away from where it was at the event before. What a real pixel
adds, after v2e: a photoreceptor whose bandwidth falls with light, thresholds that differ between pixels, a
dead time, leak that grows with light, shot noise that grows as light falls, and a few hot pixels.

An event is *by motion* if the noise-free signal (the photoreceptor's output, without leak and noise) has
itself gone at least half a threshold in the event's direction since the end of the dead time of the pixel's
last event by motion; else noise had the larger share in it. Events of noise in between change nothing in
that count, so that they neither take a vehicle's events for themselves nor hide behind them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.config import EventCameraConfig
from jeat_graph_sehn.simulation.imaging.event_sink import EventSink, put
from jeat_graph_sehn.simulation.imaging.pixel_random import exponential, seeds, uniform

_LEAST_THRESHOLD = 0.01
_ARRIVED = 1e-6  # a photoreceptor this near to its input (ln) is taken to be there
_HOT_ON = 0.9  # share of brighter events of hot pixels, whose leak is what makes them hot
_WARM_K = 8.0  # warming that doubles a junction's dark current
_ROOM_C = 25.0

# Columns of the pixels' constants and of their state.
ON, OFF, LEAK, SHOT, HOT = range(5)
LUMINANCE, SIGNAL, OUTPUT, REFERENCE, AT_RESET, BLIND_UNTIL, NEXT_SHOT, HELD = range(8)


class PixelModel(NamedTuple):
    """Constants of all pixels; times in µs.

    Attributes:
        table: (N, 5) thresholds of brighter and darker events (ln), leak in the dark (ln/µs), rates of shot
            noise in the dark and of a hot pixel's events (1/µs).
        leak_light: how much larger the leak is per luminance (1/(cd/m²)).
        shot_half: luminance at which shot noise has fallen to a half (cd/m²).
        shot_power: of its fall.
        shot_least: what it falls to, as a share of that in the dark.
        shot_on: share of brighter events in it.
        refractory: dead time (µs).
        dark: luminance of the dark current (cd/m²).
        cutoff_max: highest bandwidth (1/µs, as 2 π f); 0 for no limit.
        cutoff_slope: bandwidth per luminance.
        cutoff_min: lowest bandwidth.
    """

    table: FloatArray
    leak_light: float
    shot_half: float
    shot_power: float
    shot_least: float
    shot_on: float
    refractory: float
    dark: float
    cutoff_max: float
    cutoff_slope: float
    cutoff_min: float

    @property
    def on(self) -> FloatArray:
        """Thresholds of brighter events (N,)."""
        return self.table[:, ON]

    @property
    def off(self) -> FloatArray:
        """Thresholds of darker events (N,)."""
        return self.table[:, OFF]


class PixelState(NamedTuple):
    """What all pixels remember.

    Attributes:
        table: (N, 8) luminance at the last sample (cd/m²), logarithm of the photocurrent then, the
            photoreceptor's output, output at the last event less what has leaked since, noise-free output
            after the last event by motion, end of the dead time (µs), next candidate of noise (µs), and
            whether the dead time is that of an event by motion (1).
        random: (N,) states of the pixels' random numbers.
    """

    table: FloatArray
    random: npt.NDArray[np.uint64]


def make_model(config: EventCameraConfig, rng: np.random.Generator, count: int) -> PixelModel:
    """Draw the pixels of one camera: its mismatch is the same in every segment."""
    draw = rng.standard_normal((4, count))
    table = np.zeros((count, 5))
    table[:, ON] = np.maximum(config.threshold_on + config.threshold_sigma * draw[0], _LEAST_THRESHOLD)
    table[:, OFF] = np.maximum(config.threshold_off + config.threshold_sigma * draw[1], _LEAST_THRESHOLD)
    spread = 10.0 ** (config.rate_spread_decades * draw[2:])
    warm = 2.0 ** ((config.temperature_c - _ROOM_C) / _WARM_K)
    table[:, LEAK] = 1e-6 * config.leak_rate_hz * warm * spread[0] * table[:, ON]
    table[:, SHOT] = 1e-6 * config.shot_rate_hz * spread[1]
    hot = rng.random(count) < config.hot_share
    low, high = config.hot_rate_hz
    # Many are barely hot and few are very hot: rates are even in their logarithm.
    rates = np.exp(rng.uniform(math.log(low), math.log(high), count))
    table[:, HOT] = np.where(hot, 1e-6 * rates, 0.0)
    angular = 2.0 * math.pi * 1e-6
    return PixelModel(
        table=table,
        leak_light=config.leak_per_cd_m2 / warm,
        shot_half=config.shot_half_luminance,
        shot_power=config.shot_power,
        shot_least=config.shot_bright_factor,
        shot_on=config.shot_on_share,
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
    phase = np.where(model.table[:, LEAK] > 0.0, rng.random(count), 0.0)
    random = seeds(rng, count)
    table = np.zeros((count, 8))
    table[:, LUMINANCE] = luminance
    table[:, SIGNAL] = table[:, OUTPUT] = table[:, AT_RESET] = signal
    table[:, REFERENCE] = signal - phase * model.on
    table[:, BLIND_UNTIL] = -np.inf
    table[:, NEXT_SHOT] = _first_shots(random, model.table[:, SHOT] + model.table[:, HOT])
    return PixelState(table, random)


@njit(cache=True, error_model="numpy")
def _first_shots(random: npt.NDArray[np.uint64], rate: FloatArray) -> FloatArray:
    out = np.empty(len(rate))
    for i in range(len(rate)):
        out[i] = exponential(random, i, rate[i])
    return out


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def shot_share(luminance: float, model: PixelModel) -> float:
    """Rate of shot noise at a luminance (cd/m²), as a share of that in the dark."""
    falling = 1.0 / (1.0 + (luminance / model.shot_half) ** model.shot_power)
    out: float = model.shot_least + (1.0 - model.shot_least) * falling
    return out


@njit(cache=True, error_model="numpy")
def most_share(luminance: float, model: PixelModel) -> float:
    """What `shot_share` is at most: beyond a half a power above 1 falls faster than the power 1."""
    if model.shot_power < 1.0 or luminance <= model.shot_half:
        return 1.0
    out: float = model.shot_least + (1.0 - model.shot_least) * (model.shot_half / luminance)
    return out


@njit(cache=True, error_model="numpy")
def advance(
    pixels: IntArray, luminance: FloatArray, since: FloatArray, end: float, settled: bool, model: PixelModel,
    state: PixelState, sink: EventSink,
) -> None:  # fmt: skip
    """Take pixels from times of their own to `end`, and put their events.

    Args:
        pixels: (P,) which.
        luminance: (P,) what they see at `end` (cd/m²).
        since: (P,) from when on (µs).
        end: µs.
        settled: the caller knows that neither luminance nor the photoreceptors' outputs change.
        model: constants of all pixels.
        state: of all pixels; changed.
        sink: where events go; it must have room.
    """
    constants, memory, random = model.table, state.table, state.random
    for n in range(len(pixels)):
        i, start = pixels[n], since[n]
        duration = end - start
        first = memory[i, OUTPUT]
        last = first
        if not settled:
            before = memory[i, SIGNAL]
            after = before
            # Most pixels of a tile see nothing new, and logarithms and exponentials are what costs.
            if luminance[n] != memory[i, LUMINANCE]:
                after = math.log(luminance[n] + model.dark)
                memory[i, LUMINANCE] = luminance[n]
                memory[i, SIGNAL] = after
            if after != before or first != after:
                last = photoreceptor(first, before, after, duration, luminance[n], model)
                if after == before and abs(last - after) < _ARRIVED:
                    last = after
                memory[i, OUTPUT] = last
        # The leak of the reference is taken as a rise of the signal, and given back at the end.
        leak = constants[i, LEAK] * (1.0 + model.leak_light * luminance[n])
        rise = last - first + leak * duration
        reference = memory[i, REFERENCE]
        on, off = constants[i, ON], constants[i, OFF]
        blind = memory[i, BLIND_UNTIL]
        if memory[i, NEXT_SHOT] > end and -off < first + rise - reference < on and blind <= start:
            memory[i, REFERENCE] = reference - leak * duration
            continue
        true_slope = (last - first) / duration
        slope = true_slope + leak
        shot_rate, hot_rate = constants[i, SHOT], constants[i, HOT]
        now = start
        while True:
            if blind > now:
                # In the dead time the pixel's amplifier is held at its input; shot noise is lost.
                while memory[i, NEXT_SHOT] < blind:
                    memory[i, NEXT_SHOT] += exponential(random, i, shot_rate + hot_rate)
                if blind > end:
                    break
                now = blind
                reference = first + slope * (now - start)
                if memory[i, HELD] > 0.0:
                    memory[i, AT_RESET] = first + true_slope * (now - start)
                    memory[i, HELD] = 0.0
            crossing = math.inf
            if slope > 0.0:
                crossing = start + (reference + on - first) / slope
            elif slope < 0.0:
                crossing = start + (reference - off - first) / slope
            crossing = max(crossing, now)
            shot = memory[i, NEXT_SHOT]
            true = 0.0
            if crossing <= end and crossing <= shot:
                now = crossing
                brighter = slope > 0.0
                reference += on if brighter else -off
                true = first + true_slope * (now - start)
                change = true - memory[i, AT_RESET]
                by_motion = change >= 0.5 * on if brighter else -change >= 0.5 * off
            elif shot <= end:
                now = max(shot, now)
                memory[i, NEXT_SHOT] = shot + exponential(random, i, shot_rate + hot_rate)
                pick = uniform(random, i) * (shot_rate + hot_rate)
                # In good light nearly all candidates fall, and a power for each is what noise costs.
                if pick >= hot_rate + shot_rate * most_share(luminance[n], model):
                    continue
                if pick >= hot_rate + shot_rate * shot_share(luminance[n], model):
                    continue
                brighter = uniform(random, i) < (_HOT_ON if pick < hot_rate else model.shot_on)
                reference = first + slope * (now - start)
                by_motion = False
            else:
                break
            put(sink, now, i, brighter, by_motion)
            if by_motion:
                memory[i, AT_RESET] = true
                memory[i, HELD] = 1.0
            if model.refractory > 0.0:
                blind = now + model.refractory
        memory[i, BLIND_UNTIL] = blind
        memory[i, REFERENCE] = reference - leak * duration


@njit(cache=True, error_model="numpy")
def unsettled(pixels: IntArray, luminance: FloatArray, model: PixelModel, state: PixelState) -> float:
    """Greatest distance (ln) of the pixels' outputs from what they see."""
    most = 0.0
    for n in range(len(pixels)):
        most = max(most, abs(math.log(luminance[n] + model.dark) - state.table[pixels[n], OUTPUT]))
    return most
