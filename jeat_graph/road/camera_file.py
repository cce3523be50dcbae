"""`camera.yaml`: a calibrated camera with its covariance; also OpenCV's YAML, and the simulator's."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from jeat_graph.config.yaml_text import load_yaml
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.io.tables.csv_text import read_text
from jeat_graph.road.camera import PARAMETERS, Georeference, RoadCamera

_SIMPLE = ("fx", "fy", "cx", "cy")
# No place on Earth, in metres or pixels, and no variance of one is larger; no camera has a longer side (px).
_LARGEST, _LONGEST_SIDE = 1e15, 100_000
_SHOWN = 80  # characters of a message


def write_camera(camera: RoadCamera, path: str | Path, notes: Sequence[str] = ()) -> None:
    """Write a camera; `notes` become comments at the head of the file."""
    tree: dict[str, Any] = {
        "width": camera.width,
        "height": camera.height,
        **{name: float(getattr(camera, name)) for name in (*_SIMPLE, "k1", "k2")},
        "position_m": [float(v) for v in camera.position],
        "rotation_road_to_camera": [[float(v) for v in row] for row in camera.rotation],
        "axes": "road x right, y along the road, z up; camera X right, Y down, Z forward",
    }
    if camera.georeference is not None:
        g = camera.georeference
        tree["georeference"] = {
            "east": float(g.east),
            "north": float(g.north),
            "bearing_rad": float(g.bearing_rad),
            "zone": g.zone,
        }
    if camera.covariance.any():
        tree["covariance_of"] = list(PARAMETERS)
        tree["covariance"] = [[float(f"{v:.9g}") for v in row] for row in camera.covariance]
    with open_atomic(path) as file:
        file.writelines(f"# {line}\n" for line in notes)
        yaml.safe_dump(tree, file, sort_keys=False, default_flow_style=None, width=110)


def read_camera(path: str | Path) -> RoadCamera:
    """Read a camera from `camera.yaml`, from the simulator's `camera.yaml`, or from OpenCV's YAML.

    OpenCV's file needs `camera_matrix`, and for the pose over the road `rvec` and `tvec` (road to camera,
    metres), which its `solvePnP` gives; `distortion_coefficients` may hold k1 and k2, and tangential terms
    only as zero.

    Raises:
        DataError: names the file and what is missing or not valid.
    """
    text = read_text(path).decode("utf-8", errors="replace")
    text = re.sub(r"\A%YAML[: ]?1\.0\s*", "", text).replace("!!opencv-matrix", "")
    try:
        tree = load_yaml(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = None if mark is None else mark.line + 1
        problem = getattr(error, "problem", None) or error
        raise DataError(f"is not valid YAML: {problem}", path, line) from None
    if not isinstance(tree, Mapping):
        raise DataError("must hold keys and values, such as fx: 1100", path)
    try:
        return _from_opencv(tree, path) if "camera_matrix" in tree else _from_tree(tree, path)
    except DataError as error:
        raise error if error.path is not None else DataError(error.message, path) from None


def _from_tree(tree: Mapping[str, Any], path: str | Path) -> RoadCamera:
    turn = "rotation_road_to_camera" if "rotation_road_to_camera" in tree else "rotation_world_to_camera"
    rotation = _orthogonal(_array(tree, turn, (3, 3), path), path)
    covariance = np.zeros((len(PARAMETERS), len(PARAMETERS)))
    if "covariance" in tree:
        names = tree.get("covariance_of", list(PARAMETERS))
        if not isinstance(names, list) or not set(map(str, names)) <= set(PARAMETERS):
            raise DataError(f"covariance_of must name some of {', '.join(PARAMETERS)}", path)
        at = [PARAMETERS.index(str(name)) for name in names]
        given = _array(tree, "covariance", (len(at), len(at)), path)
        size = np.abs(given).max(initial=0.0)
        if not np.allclose(given, given.T, rtol=1e-6, atol=1e-12 * size):
            raise DataError("covariance must be symmetric", path)
        scale = np.sqrt(np.maximum(np.diag(given), np.finfo(float).tiny))
        if (np.diag(given) < 0).any() or np.linalg.eigvalsh(given / np.outer(scale, scale)).min() < -1e-6:
            raise DataError("covariance must have no negative eigenvalue", path)
        covariance[np.ix_(at, at)] = (given + given.T) / 2.0
    width, height = _size(tree, path)
    fx, fy, cx, cy = (_number(tree, name, path) for name in _SIMPLE)
    return RoadCamera(
        width,
        height,
        fx,
        fy,
        cx,
        cy,
        _number(tree, "k1", path, 0.0),
        _number(tree, "k2", path, 0.0),
        rotation=rotation,
        position=_array(tree, "position_m", (3,), path),
        covariance=covariance,
        georeference=_georeference(tree, path),
    )


def _from_opencv(tree: Mapping[str, Any], path: str | Path) -> RoadCamera:
    import cv2

    K = _matrix(tree, "camera_matrix", path).reshape(3, 3)
    if abs(K[0, 1]) > 1e-6 * K[0, 0]:
        raise DataError("camera_matrix has a skew, which no modern camera has", path)
    distortion = np.zeros(5)
    if "distortion_coefficients" in tree:
        given = _matrix(tree, "distortion_coefficients", path).ravel()
        distortion[: min(5, given.size)] = given[:5]
        if given[2:].any():
            raise DataError(
                "distortion_coefficients: only k1 and k2 are known here, the others must be 0", path
            )
    rotation = cv2.Rodrigues(_matrix(tree, "rvec", path).reshape(3))[0].astype(np.float64)
    shift = _matrix(tree, "tvec", path).reshape(3)
    names = {"width": tree.get("image_width"), "height": tree.get("image_height")}
    width, height = _size(names, path)
    return RoadCamera(
        width,
        height,
        float(K[0, 0]),
        float(K[1, 1]),
        float(K[0, 2]),
        float(K[1, 2]),
        float(distortion[0]),
        float(distortion[1]),
        rotation=rotation,
        position=-rotation.T @ shift,
    )


def _georeference(tree: Mapping[str, Any], path: str | Path) -> Georeference | None:
    given = tree.get("georeference")
    if given is None:
        return None
    if not isinstance(given, Mapping):
        raise DataError("georeference must hold east, north and bearing_rad", path)
    east, north, bearing = (_number(given, name, path) for name in ("east", "north", "bearing_rad"))
    return Georeference(east, north, bearing, str(given.get("zone", "")))


def _number(tree: Mapping[str, Any], name: str, path: str | Path, default: float | None = None) -> float:
    value = tree.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _LARGEST:
        fault = f"must be a finite number, got {value!r}"[:_SHOWN] if name in tree else "is missing"
        raise DataError(f"{name} {fault}", path)
    return float(value)


def _size(tree: Mapping[str, Any], path: str | Path) -> tuple[int, int]:
    size = [_number(tree, name, path) for name in ("width", "height")]
    if any(v < 1 or v > _LONGEST_SIDE or v != int(v) for v in size):
        raise DataError(
            f"width and height must be whole numbers of pixels, got {size[0]:g} x {size[1]:g}", path
        )
    return int(size[0]), int(size[1])


def _array(tree: Mapping[str, Any], name: str, shape: tuple[int, ...], path: str | Path) -> FloatArray:
    if name not in tree:
        raise DataError(f"{name} is missing", path)
    try:
        values = np.array(tree[name], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        values = np.zeros(0)
    if values.shape != shape or not (np.abs(values) <= _LARGEST).all():
        raise DataError(f"{name} must be {' x '.join(map(str, shape))} finite numbers", path)
    return values


def _matrix(tree: Mapping[str, Any], name: str, path: str | Path) -> FloatArray:
    given = tree.get(name)
    data = given.get("data") if isinstance(given, Mapping) else given
    try:
        values = np.array(data, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        values = np.zeros(0)
    wanted = {"camera_matrix": (9,), "rvec": (3,), "tvec": (3,)}.get(name)
    if not (np.abs(values) <= _LARGEST).all() or values.size == 0 or (wanted and values.size not in wanted):
        raise DataError(f"{name} is missing or not numbers", path)
    return values


def _orthogonal(rotation: FloatArray, path: str | Path) -> FloatArray:
    """Check a rotation, and give it back without the rounding of its digits."""
    u, s, v = np.linalg.svd(rotation)
    if np.abs(s - 1.0).max() > 1e-3 or np.linalg.det(rotation) <= 0:
        raise DataError("the rotation must be a rotation: rows of length 1, square to each other", path)
    return np.asarray(u @ v, dtype=np.float64)
