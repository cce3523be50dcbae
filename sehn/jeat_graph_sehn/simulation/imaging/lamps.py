"""The vehicles' own lamps in the picture, and what hides them."""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.lighting import LAMP_HEIGHT_M, Lights, beam_candela
from jeat_graph_sehn.simulation.imaging.moments import (
    BRAKES,
    LAMP_FLUX,
    LAMP_PULSE,
    LAMP_REACH,
    LAMP_SEEN,
    LEFT_ON,
    PULSE,
    Look,
    Moments,
)
from jeat_graph_sehn.simulation.imaging.optics import Optics
from jeat_graph_sehn.simulation.imaging.tiles import View

LAMPS = 9
NONE, HEAD, TAIL, BRAKE, MARKER, INDICATOR = range(6)
STRENGTH = 3  # column of a lamp's strength, after across, height and kind
# Across (of the width), height (m), kind and strength of the lamps that every vehicle has.
COMMON_LAMPS = (
    (-0.39, LAMP_HEIGHT_M, HEAD, 1.0),
    (0.39, LAMP_HEIGHT_M, HEAD, 1.0),
    (-0.39, LAMP_HEIGHT_M + 0.2, TAIL, 1.0),
    (0.39, LAMP_HEIGHT_M + 0.2, TAIL, 1.0),
    *((0.0, 0.0, NONE, 0.0),) * 5,
)
_LAMP_SIGMA_M = 0.07
_MARKER_SHARE = 0.25  # of a tail lamp's intensity (UN R7: end-outline markers)
_HIDDEN_M = 0.2  # way through another vehicle after which a lamp is hidden
_FAINT = 0.002  # of the luminance there is: glow below it is left out
_INVERSE_POWER = 0.8  # 1 / 1.25, of the glow's power in the squared distance


@njit(cache=True, error_model="numpy")
def light_lamps(
    out: Moments, j: int, v: int, signal: FloatArray, look: Look, view: View, lights: Lights
) -> None:
    """Place the lamps of a vehicle, with its signals (4,), in the picture."""
    brake = signal[BRAKES]
    x, y, sin, cos = out.pose[j, v]
    length, wide = look.size[v, 0], look.size[v, 1]
    fx, fy, cx, cy = view.lens[0], view.lens[1], view.lens[2], view.lens[3]
    eye, rotation = view.eye, view.rotation
    for k in range(LAMPS):
        kind = int(look.lamps[v, k, 2])
        if kind == NONE:
            continue
        if not lights.on and kind in (HEAD, MARKER):
            continue
        ahead = 1.0 if kind == HEAD else -1.0
        if kind == INDICATOR:
            # It is one in front and one behind, of which the camera sees one.
            ahead = 1.0 if (eye[0] - x) * sin + (eye[1] - y) * cos > 0.0 else -1.0
        across = look.lamps[v, k, 0] * wide
        along = 0.5 * length * ahead
        z = look.lamps[v, k, 1]
        dx, dy = x + along * sin + across * cos - eye[0], y + along * cos - across * sin - eye[1]
        dz = z - eye[2]
        Z = rotation[2, 0] * dx + rotation[2, 1] * dy + rotation[2, 2] * dz
        # From the lamp to the eye, along the vehicle's axes.
        forward = -(dx * sin + dy * cos) * ahead
        if Z < 2.0 or forward <= 0.0:
            continue
        distance2 = dx * dx + dy * dy + dz * dz
        facing = forward / math.sqrt(distance2)
        pulse = 1.0
        if kind == INDICATOR:
            on = signal[LEFT_ON] if look.lamps[v, k, 0] < 0.0 else signal[LEFT_ON + 1]
            power = lights.indicator_candela * on * facing
        elif look.parked[v]:
            power = lights.parking_candela * facing if lights.on else 0.0
        elif kind == HEAD:
            right = -(dx * cos - dy * sin)
            power = 0.5 * beam_candela(forward, right, -dz, lights.beam_candela, lights.beam_stray)
        elif kind == TAIL:
            # A brake light is not dimmed.
            pulse = signal[PULSE] + (1.0 - signal[PULSE]) * brake
            steady = lights.tail_candela if lights.on else 0.0
            power = (steady + (lights.brake_candela - steady) * brake) * facing
        elif kind == BRAKE:
            power = lights.brake_candela * brake * facing
        else:
            power = _MARKER_SHARE * lights.tail_candela * facing
        if power <= 0.0:
            continue
        at = out.lamp[j, v, k]
        at[LAMP_PULSE] = pulse
        at[0] = fx * (rotation[0, 0] * dx + rotation[0, 1] * dy + rotation[0, 2] * dz) / Z + cx
        at[1] = fy * (rotation[1, 0] * dx + rotation[1, 1] * dy + rotation[1, 2] * dz) / Z + cy
        at[2] = Z
        at[3] = math.sqrt((_LAMP_SIGMA_M * fx / Z) ** 2 + 0.25)
        power *= look.lamps[v, k, STRENGTH] * math.exp(-lights.beta * Z)
        for c in range(3):
            tint = lights.head_tint[c] if kind == HEAD else lights.tail_tint[c]
            tint = lights.amber_tint[c] if kind == INDICATOR else tint
            at[LAMP_FLUX + c] = out.fade[j, v] * power * fx * fy / distance2 * tint
        box, reach = out.touch[j, v, 0], 4.0 * at[3]
        box[0], box[1] = min(box[0], at[0] - reach), min(box[1], at[1] - reach)
        box[2], box[3] = max(box[2], at[0] + reach), max(box[3], at[1] + reach)


@njit(cache=True, error_model="numpy")
def hide_lamps(
    out: Moments, j: int, look: Look, eye: FloatArray, lights: Lights, optics: Optics, every: IntArray
) -> None:
    """Dim the lamps that stand behind other vehicles, and say how far their glow reaches."""
    for v in range(len(look.kind)):
        if (j + 1) % every[v] != 0:
            continue
        box = out.touch[j, v, 1]
        box[0], box[1], box[2], box[3] = 1e9, 1e9, -1e9, -1e9
        for k in range(LAMPS):
            at = out.lamp[j, v, k]
            if at[LAMP_FLUX] <= 0.0:
                continue
            x, y, sin, cos = out.pose[j, v]
            front = look.lamps[v, k, 2] == HEAD
            if look.lamps[v, k, 2] == INDICATOR:
                front = (eye[0] - x) * sin + (eye[1] - y) * cos > 0.0
            along = (0.5 if front else -0.5) * look.size[v, 0]
            across = look.lamps[v, k, 0] * look.size[v, 1]
            px, py = x + along * sin + across * cos, y + along * cos - across * sin
            pz = look.lamps[v, k, 1]
            free = 1.0
            for w in range(len(look.kind)):
                if w != v and out.fade[j, w] > 0.0:
                    # Nearer vehicles only; a ray that passes through one is dimmed by its way inside it.
                    if out.pose[j, w, 1] > py + 10.0:
                        continue
                    inside = chord(px, py, pz, eye[0], eye[1], eye[2], out.pose[j, w], look.size[w])
                    free *= 1.0 - min(1.0, inside / _HIDDEN_M)
            at[LAMP_SEEN] = free
            if free > 0.0:
                # Where glow falls below what can be distinguished from the picture it is left out.
                level = optics.scale * at[LAMP_FLUX] / (_FAINT * lights.floor)
                reach = optics.core_px * math.sqrt(max(level, 1.0) ** _INVERSE_POWER - 1.0)
                at[LAMP_REACH] = min(optics.reach_px, reach)
                reach = max(at[LAMP_REACH], 4.0 * at[3])
                box[0], box[1] = min(box[0], at[0] - reach), min(box[1], at[1] - reach)
                box[2], box[3] = max(box[2], at[0] + reach), max(box[3], at[1] + reach)


@njit(cache=True, error_model="numpy")
def chord(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float, pose: FloatArray, size: FloatArray
) -> float:
    """Length (m) of the part of the way from a to b that lies within a vehicle's box, a little shrunk."""
    sin, cos = pose[2], pose[3]
    ox, oy = ax - pose[0], ay - pose[1]
    dx, dy, dz = bx - ax, by - ay, bz - az
    low, high = 0.0, 1.0
    for axis in range(3):
        if axis == 0:
            start, step, most = ox * sin + oy * cos, dx * sin + dy * cos, 0.48 * size[0]
        elif axis == 1:
            start, step, most = ox * cos - oy * sin, dx * cos - dy * sin, 0.46 * size[1]
        else:
            start, step, most = az, dz, 0.92 * size[2]
        least = -most if axis < 2 else 0.0
        if abs(step) < 1e-12:
            if start < least or start > most:
                return 0.0
            continue
        first, second = (least - start) / step, (most - start) / step
        low, high = max(low, min(first, second)), min(high, max(first, second))
    if high <= low:
        return 0.0
    return (high - low) * math.sqrt(dx * dx + dy * dy + dz * dz)
