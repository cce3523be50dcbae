"""What a road's surroundings look like: barriers, walls, bridges, signs, trees, hills, sky and surfaces."""

from __future__ import annotations

from typing import NamedTuple


class Surroundings(NamedTuple):
    """The countryside of one segment; what is not said is as in the fixed world.

    Attributes:
        median: 0 nothing, 1 a concrete barrier, 2 steel rails, 3 a hedge.
        rail_left: whether there is a guard rail at the left edge.
        rail_right: the same at the right edge.
        noise_left_m: height of a noise wall on the left (m); 0 for none.
        noise_right_m: the same on the right.
        noise_colour: its albedo.
        gantries_m: places of sign gantries along the road (m).
        sign_colour: albedo of the signs, which are seen from behind or above the lanes that drive away.
        bridges_m: places of bridges across the road (m).
        bridge_wide_m: their width along the road (m).
        bridge_colour: their albedo.
        trees_m: distance of the trees from the pavement (m); 0 for none.
        trees_high_m: their height (m).
        trees_colour: their albedo.
        hills: height of hills at the horizon, as the tangent of their elevation.
        grade: slope of the road against the horizon; positive downhill, which lifts the horizon.
        clouds: contrast of the clouds.
        asphalt: albedo of the road.
        tint: of the road's albedo, red and blue over green.
        coarse: strength of large patches in it.
        fine: strength of its grain.
        tracks: how much the wheel tracks are darker (or lighter, negative).
        paint: albedo of the markings.
        wear: share of the markings that is worn away here and there.
        dash_m: length of a dash (m).
        gap_m: length of the gap after it (m).
        verge: albedo beside the road.
        ramp_m: from where to where there is a further lane on the right (m).
        salt: makes textures its own.
    """

    median: int = 1
    rail_left: bool = True
    rail_right: bool = True
    noise_left_m: float = 0.0
    noise_right_m: float = 0.0
    noise_colour: tuple[float, float, float] = (0.25, 0.25, 0.23)
    gantries_m: tuple[float, ...] = ()
    sign_colour: tuple[float, float, float] = (0.25, 0.26, 0.27)
    bridges_m: tuple[float, ...] = ()
    bridge_wide_m: float = 9.0
    bridge_colour: tuple[float, float, float] = (0.32, 0.31, 0.29)
    trees_m: float = 14.0
    trees_high_m: float = 7.0
    trees_colour: tuple[float, float, float] = (0.028, 0.04, 0.018)
    hills: float = 0.0
    grade: float = 0.0
    clouds: float = 0.25
    asphalt: float = 0.085
    tint: tuple[float, float] = (1.0, 0.97)
    coarse: float = 0.10
    fine: float = 0.16
    tracks: float = 0.06
    paint: float = 0.55
    wear: float = 0.15
    dash_m: float = 6.0
    gap_m: float = 12.0
    verge: tuple[float, float, float] = (0.0527, 0.085, 0.03)
    ramp_m: tuple[float, float] = (0.0, 0.0)
    salt: int = 0


FIXED = Surroundings()
