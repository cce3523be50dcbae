"""Settings of real event cameras: what of their noise has been measured, and by whom.

Rates were measured on still scenes. Illuminance becomes luminance by a grey of 18 %: 161 lux are 9 cd/m².
Where a sensor was measured in one light only, shot noise is taken to change with light as that of `iebcs`.

- `v2e` (the default): thresholds of v2e, which are those of a camera set to be more sensitive, with the noise
  of `davis346`.
- `davis346`: in the sun 0.0016 to 0.0041 Hz a pixel, 99 % of it brighter, no pixel above 5 Hz (counted in a
  recording of a real one); thresholds as that recording has them, net events of its pixels against the change
  of the logarithm of their grey values; mismatch, dead time and bandwidth as v2e has them.
- `imx636`: indoors 0.002 Hz a pixel, mostly darker, the hottest pixel 10 Hz (likewise).
- `iebcs`: 0.13 Hz a pixel at 3 klux, 0.075 at 161 lux, 11.8 at 0.1 lux (6.8 brighter, 5.0 darker), from the
  noise histograms published with the IEBCS simulator; some of its pixels are hot, with 10 to 300 Hz.
- `ideal`: no noise, no mismatch, no dead time, unlimited bandwidth.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

#: What differs from the settings' defaults, which are those of `v2e`.
SENSORS: dict[str, dict[str, Any]] = {
    "v2e": {},
    "davis346": {"threshold_on": 0.36, "threshold_off": 0.42},
    "imx636": {
        "leak_rate_hz": 0.0002,
        "leak_per_cd_m2": 0.0,
        "shot_half_luminance": 0.0143,
        "shot_on_share": 0.2,
        "hot_share": 2e-5,
        "hot_rate_hz": (1.0, 10.0),
    },
    "iebcs": {
        "leak_rate_hz": 0.06,
        "leak_per_cd_m2": 0.0063,
        "shot_rate_hz": 13.0,
        "shot_on_share": 0.57,
        "hot_share": 2e-5,
    },
    "ideal": {
        "leak_rate_hz": 0.0,
        "shot_rate_hz": 0.0,
        "threshold_sigma": 0.0,
        "refractory_s": 0.0,
        "cutoff_max_hz": 0.0,
        "dark_luminance": 1e-6,
    },
}


def with_sensor(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of the event camera with those of its `sensor` under the ones that are given."""
    name = tree.get("sensor")
    return {**SENSORS.get(name, {}), **tree} if isinstance(name, str) else dict(tree)
