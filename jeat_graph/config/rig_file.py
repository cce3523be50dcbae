"""`rig.yaml`: the picture and the clock of each sensor of a rig; `register` makes it.

```yaml
image: [1280, 720]            # the common picture, that of the tables
sensors:
  rgb: {image: [1280, 720], to_picture: none}
  evt:
    kind: event               # or camera, or other
    image: [640, 480]
    to_picture: [[1.9, 0.01, 8.2], [-0.01, 1.9, 60.5], [0, 0, 1]]   # or scale; 3 x 4 with parallax
    covariance: [...]         # of its numbers but the last of the 3 x 3, row by row; then of the lenses
    lens: [-0.21, -0.18]      # radial distortion k1 of its lens and of the common picture's, if they bend
    offset_s: 0.1502          # taken off its times
    offset_std_s: 0.0004
    drift_ppm: 12.0           # by how much its clock is too fast, from at_s on
    drift_std_ppm: 1.5
    at_s: 31.0
```
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from jeat_graph.config.sensors import KINDS, ClockConfig
from jeat_graph.config.yaml_text import load_yaml
from jeat_graph.data.errors import DataError
from jeat_graph.data.picture_map import PictureMap

#: Words for ways that need no numbers.
NONE, SCALE = "none", "scale"
_TOP = ("image", "sensors")
_CLOCK = tuple(one.name for one in dataclasses.fields(ClockConfig))
_SENSOR = ("kind", "image", "to_picture", "covariance", "lens", *_CLOCK)
_SHAPES = ((3, 3), (3, 4))
# Digits of what is written: boxes are good to a hundredth of a pixel, clocks to a microsecond.
_DIGITS, _TIME_PLACES, _DRIFT_PLACES = 9, 6, 3


def read_rig(path: str | Path) -> dict[str, Any]:
    """Read a rig as the part of a configuration that it is.

    Raises:
        DataError: it cannot be read, or does not say what a rig says; names the key.
    """
    file = Path(path)
    try:
        tree = load_yaml(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror}", file) from None
    except UnicodeDecodeError:
        raise DataError("is not text in UTF-8", file) from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = None if mark is None else mark.line + 1
        raise DataError(
            f"is not valid YAML: {getattr(error, 'problem', None) or error}", file, line
        ) from None
    _check_keys(tree, _TOP, "", file)
    sensors = tree.get("sensors")
    if not isinstance(sensors, Mapping) or not sensors:
        raise DataError("sensors: must name at least one sensor", file)
    out: dict[str, Any] = {"sensors": {}}
    common = None
    if "image" in tree:
        common = _size(tree["image"], "image", file)
        out["image"] = {"width": common[0], "height": common[1]}
    for name, one in sensors.items():
        out["sensors"][str(name)] = _sensor(one, f"sensors.{name}", common, file)
    return out


def rig_text(image: tuple[int, int], sensors: Mapping[str, Mapping[str, Any]], notes: list[str]) -> str:
    """Return a rig as text; `notes` become comments at its head."""
    tree = {"image": list(image), "sensors": {name: dict(one) for name, one in sensors.items()}}
    head = "".join(f"# {line}\n" for line in notes)
    return head + yaml.safe_dump(tree, sort_keys=False, default_flow_style=None, width=110)


def sensor_entry(way: PictureMap, clock: ClockConfig | None, size: tuple[int, int]) -> dict[str, Any]:
    """Return what a rig says of a sensor.

    Args:
        way: from its picture to the common one.
        clock: None where its times are the common ones, or nothing is known of it.
        size: width and height of its picture (px).
    """
    columns = 4 if way.parallax else 3
    kept = [k for k in range(way.free) if columns == 4 or k not in (3, 7, 10)]
    out: dict[str, Any] = {
        "image": list(size),
        "to_picture": [[_short(v) for v in row[:columns]] for row in way.matrix],
        "covariance": [[_short(v) for v in row] for row in way.covariance[kept][:, kept]],
    }
    if way.lenses is not None:
        out["lens"] = [_short(lens.k1) for lens in way.lenses]
    if clock is not None:
        out |= {
            "offset_s": round(clock.offset_s, _TIME_PLACES),
            "offset_std_s": round(clock.offset_std_s, _TIME_PLACES),
            "drift_ppm": round(clock.drift_ppm, _DRIFT_PLACES),
            "drift_std_ppm": round(clock.drift_std_ppm, _DRIFT_PLACES),
            "at_s": round(clock.at_s, _TIME_PLACES),
        }
    return out


def _short(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


def _sensor(one: Any, where: str, common: tuple[float, float] | None, file: Path) -> dict[str, Any]:
    _check_keys(one, _SENSOR, where + ".", file)
    out: dict[str, Any] = {}
    if "kind" in one:
        if one["kind"] not in KINDS:
            raise DataError(f"{where}.kind: {str(one['kind'])[:40]!r} is not one of {', '.join(KINDS)}", file)
        out["kind"] = one["kind"]
    own = _size(one["image"], f"{where}.image", file) if "image" in one else None
    way = one.get("to_picture", NONE if own is None or own == common else SCALE)
    if way == NONE and own is not None and common is not None and own != common:
        raise DataError(
            f"{where}.to_picture: none, but its picture has {own[0]:g} x {own[1]:g} px and the common one "
            f"{common[0]:g} x {common[1]:g}",
            file,
        )
    if way not in (NONE, SCALE):
        if own is None:
            raise DataError(f"{where}: to_picture needs `image`, the size of the sensor's own picture", file)
        out["to_picture"] = _numbers(way, _SHAPES, f"{where}.to_picture", file)
        out |= _lens(one, f"{where}.lens", file)
        if "covariance" in one:
            free = len(out["to_picture"]) - 1 + len(out.get("lens", ()))
            out["to_picture_cov"] = _numbers(one["covariance"], ((free, free),), f"{where}.covariance", file)
    elif "lens" in one:
        raise DataError(f"{where}.lens: goes with a matrix, and to_picture has none", file)
    elif "covariance" in one:
        raise DataError(f"{where}.covariance: is of a matrix, and to_picture has none", file)
    if own is not None and way != NONE:
        out["image"] = list(own)
    clock = {name: one[name] for name in _CLOCK if name in one}
    if clock:
        out["clock"] = clock
    return out


def _lens(one: Mapping[str, Any], where: str, file: Path) -> dict[str, Any]:
    if "lens" not in one:
        return {}
    value = one["lens"]
    numbers = value if isinstance(value, list) else []
    if len(numbers) != 2 or not all(_is_number(v) and abs(v) <= 1.0 for v in numbers):
        raise DataError(f"{where}: must be two numbers from -1 to 1, not {str(value)[:40]!r}", file)
    return {"lens": [float(v) for v in value]}


def _check_keys(tree: Any, known: tuple[str, ...], where: str, file: Path) -> None:
    if not isinstance(tree, Mapping):
        raise DataError(f"{where.rstrip('.') or 'a rig'}: must hold `key: value` lines", file)
    strange = [str(key) for key in tree if key not in known]
    if strange:
        raise DataError(f"unknown key {where}{strange[0]}; known: {', '.join(known)}", file)


def _size(value: Any, where: str, file: Path) -> tuple[float, float]:
    good = isinstance(value, list) and len(value) == 2 and all(_is_number(v) and v >= 1 for v in value)
    if not good:
        raise DataError(f"{where}: must be [width, height] in px, not {str(value)[:40]!r}", file)
    return float(value[0]), float(value[1])


def _numbers(value: Any, shapes: tuple[tuple[int, int], ...], where: str, file: Path) -> list[float]:
    rows = value if isinstance(value, list) and all(isinstance(row, list) for row in value) else []
    found = (len(rows), len(rows[0]) if rows else 0)
    flat = [number for row in rows for number in row]
    if found not in shapes or len(flat) != found[0] * found[1] or not all(map(_is_number, flat)):
        wanted = " or ".join(f"{a} rows of {b}" for a, b in shapes)
        words = f"; or {NONE} or {SCALE}" if shapes is _SHAPES else ""
        raise DataError(f"{where}: must be {wanted} numbers{words}", file)
    return [float(number) for number in flat]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
