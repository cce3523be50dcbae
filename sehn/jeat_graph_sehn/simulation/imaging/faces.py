"""Light on the vehicles' faces."""

from __future__ import annotations

from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.lamps import chord
from jeat_graph_sehn.simulation.imaging.lighting import (
    LAMP_HEIGHT_M,
    Headlamps,
    Lights,
    Surface,
    beam_lux,
    lamp_lux,
)
from jeat_graph_sehn.simulation.imaging.moments import Look, Moments

# A face is lit evenly; beams light it as at most this high, for most of their light falls on its lower part.
_LIT_HEIGHT_M = 0.9
_NEGLIGIBLE_LUX = 0.01
_BLOCKED_M = 0.5  # way through a vehicle after which a beam is blocked
_BACK_LUX = 0.3  # what the road before a vehicle gives back of its own beams to its front


@njit(cache=True, error_model="numpy")
def light_face(
    out: Moments, j: int, v: int, look: Look, at: Surface, lights: Lights, light: FloatArray
) -> None:
    """Illuminance of a face at its centre by sky, sun, lamps and the beams of other vehicles."""
    nx, ny, nz = at.nx, at.ny, at.nz
    sun = max(0.0, nx * lights.sun[0] + ny * lights.sun[1] + nz * lights.sun[2])
    sun *= lights.sun_lux / lights.sun[2]
    # A wall sees half the sky, and the road, which gives back a tenth of its light.
    sky = lights.sky_lux * (0.55 + 0.45 * nz) + 0.1 * lights.sun_lux * (0.5 - 0.5 * nz)
    lamp = lamp_lux(at, lights)
    if len(lights.lamps):
        lamp += 0.05 * lamp_lux(Surface(at.x, at.y, 0.0, 0.0, 0.0, 1.0), lights)
    beams = 0.0
    if lights.on:
        for w in range(len(look.kind)):
            if w == v or not look.beams[w] or out.fade[j, w] <= 0.0:
                continue
            ox, oy, sin, cos = out.pose[j, w]
            lamp_x, lamp_y = ox + 0.5 * look.size[w, 0] * sin, oy + 0.5 * look.size[w, 0] * cos
            low = Surface(at.x, at.y, min(at.z, _LIT_HEIGHT_M), nx, ny, nz)
            lux = beam_lux(low, Headlamps(lamp_x, lamp_y, sin, cos), lights)
            if lux > _NEGLIGIBLE_LUX:
                lux *= _free(out, j, v, w, look, low, lamp_x, lamp_y)
            beams += lux
        if ny * out.pose[j, v, 3] + nx * out.pose[j, v, 2] > 0.5 and look.beams[v]:
            beams += _BACK_LUX
    for c in range(3):
        light[c] = (
            sun * lights.sun_tint[c]
            + sky * lights.sky_tint[c]
            + lamp * lights.lamp_tint[c]
            + beams * lights.head_tint[c]
        )


@njit(cache=True, error_model="numpy")
def _free(
    out: Moments, j: int, v: int, w: int, look: Look, at: Surface, lamp_x: float, lamp_y: float
) -> float:
    """Part of the beams of vehicle `w` that others leave free on their way to a face of vehicle `v`."""
    free = 1.0
    for k in range(len(look.kind)):
        if k in (v, w) or out.fade[j, k] <= 0.0:
            continue
        ox, oy = out.pose[j, k, 0], out.pose[j, k, 1]
        half = 0.5 * (look.size[k, 0] + look.size[k, 1])
        apart = ox + half < min(lamp_x, at.x) or ox - half > max(lamp_x, at.x)
        apart |= oy + half < min(lamp_y, at.y) or oy - half > max(lamp_y, at.y)
        if not apart:
            inside = chord(lamp_x, lamp_y, LAMP_HEIGHT_M, at.x, at.y, at.z, out.pose[j, k], look.size[k])
            free *= 1.0 - min(1.0, inside / _BLOCKED_M)
    return free
