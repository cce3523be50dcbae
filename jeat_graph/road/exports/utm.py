"""From UTM coordinates to longitude and latitude on WGS84.

Source: Karney, "Transverse Mercator with an accuracy of a few nanometers", Journal of Geodesy 85, 2011
(Krüger's series to the fourth order, good to less than a millimetre within a zone).
"""

from __future__ import annotations

import re

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError

_A, _F = 6378137.0, 1.0 / 298.257223563  # WGS84: equatorial radius (m), flattening
_SCALE, _EAST, _SOUTH = 0.9996, 500_000.0, 10_000_000.0
_N = _F / (2.0 - _F)
_RADIUS = _A / (1.0 + _N) * (1.0 + _N**2 / 4.0 + _N**4 / 64.0)
_BETA = (
    _N / 2.0 - 2.0 * _N**2 / 3.0 + 37.0 * _N**3 / 96.0 - _N**4 / 360.0,
    _N**2 / 48.0 + _N**3 / 15.0 - 437.0 * _N**4 / 1440.0,
    17.0 * _N**3 / 480.0 - 37.0 * _N**4 / 840.0,
    4397.0 * _N**4 / 161280.0,
)
_ECCENTRICITY = float(np.sqrt(_F * (2.0 - _F)))
_NEWTON_STEPS = 5


def to_wgs84(east_north: FloatArray, zone: str) -> FloatArray:
    """Longitudes and latitudes (N, 2) in degrees of eastings and northings (N, 2) in m.

    Args:
        east_north: UTM coordinates.
        zone: number and hemisphere, such as `33N` or `56S`.

    Raises:
        DataError: no such zone.
    """
    match = re.fullmatch(r"\s*(\d{1,2})\s*([NS])\s*", zone.upper())
    if match is None or not 1 <= int(match[1]) <= 60:
        raise DataError(f"UTM zone must be 1 to 60 with N or S, such as 33N, got {zone!r}")
    south = match[2] == "S"
    xi = (east_north[..., 1] - (_SOUTH if south else 0.0)) / (_SCALE * _RADIUS)
    eta = (east_north[..., 0] - _EAST) / (_SCALE * _RADIUS)
    xi0, eta0 = xi.copy(), eta.copy()
    for j, beta in enumerate(_BETA, start=1):
        xi0 -= beta * np.sin(2 * j * xi) * np.cosh(2 * j * eta)
        eta0 -= beta * np.cos(2 * j * xi) * np.sinh(2 * j * eta)
    conformal = np.sin(xi0) / np.hypot(np.sinh(eta0), np.cos(xi0))
    tangent = conformal.copy()
    e2 = _ECCENTRICITY**2
    for _ in range(_NEWTON_STEPS):
        root = np.sqrt(1.0 + tangent**2)
        sigma = np.sinh(_ECCENTRICITY * np.arctanh(_ECCENTRICITY * tangent / root))
        found = tangent * np.sqrt(1.0 + sigma**2) - sigma * root
        slope = (1.0 + (1.0 - e2) * tangent**2) / ((1.0 - e2) * np.sqrt(1.0 + found**2) * root)
        tangent = tangent + (conformal - found) * slope
    longitude = 6.0 * int(match[1]) - 183.0 + np.degrees(np.arctan2(np.sinh(eta0), np.cos(xi0)))
    return np.stack([longitude, np.degrees(np.arctan(tangent))], axis=-1)
