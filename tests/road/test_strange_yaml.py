"""Cameras and lines from anybody: whatever the YAML holds, one line says what is wrong with it."""

from __future__ import annotations

import pytest
import yaml

from jeat_graph.data.errors import DataError
from jeat_graph.road.camera_file import read_camera
from jeat_graph.road.inputs import read_marks

CAMERA = {
    "width": 1280,
    "height": 720,
    "fx": 1100.0,
    "fy": 1100.0,
    "cx": 640.0,
    "cy": 360.0,
    "rotation_road_to_camera": [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
    "position_m": [0.0, 0.0, 8.0],
    "covariance_of": ["log_f"],
    "covariance": [[1.0]],
}
MARKS = {"lines": {"a": [1, 2, 3, 4]}, "lanes": {"l": [0, 3]}}
HUGE = 10**400
DOUBLING = "a0: &a0 [x, x]\n" + "".join(f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}]\n" for k in range(1, 40))
TEXTS = {
    "nested": "[" * 5000,
    "nested mappings": "{a: " * 2000,
    "a date that is none": "a: 2026-99-99",
    "a tag of what it is not": "a: !!timestamp x",
    "a number that is none": "a: !!int x",
    "digits without end": "a: " + "9" * 5000,
    "an object": "!!python/object/apply:os.system [true]",
    "itself": "a: &a [*a]",
    "doubling": DOUBLING,
    "not closed": "a: [",
    "a list": "- 1",
    "NUL": "a: \0",
}


@pytest.mark.parametrize("read", [read_camera, read_marks])
@pytest.mark.parametrize("name", TEXTS)
def test_a_text_that_is_none_is_refused_in_one_line(tmp_path, read, name):
    path = tmp_path / "file.yaml"
    path.write_text(TEXTS[name])
    with pytest.raises(DataError, match=r"file\.yaml") as error:
        read(path)
    assert "\n" not in str(error.value)


def test_the_camera_and_the_marks_themselves_are_read(tmp_path):
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(CAMERA))
    (tmp_path / "lines.yaml").write_text(yaml.safe_dump(MARKS))
    assert read_camera(tmp_path / "camera.yaml").fx == 1100.0
    assert read_marks(tmp_path / "lines.yaml").lines == {"a": (1.0, 2.0, 3.0, 4.0)}


@pytest.mark.parametrize("key", ["width", "height", "fx", "fy", "cx", "cy", "k1"])
@pytest.mark.parametrize("value", [None, True, "x", [], {}, HUGE, -HUGE, 1e308, float("nan"), float("inf")])
def test_a_number_of_a_camera_that_none_has_is_refused(tmp_path, key, value):
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump(CAMERA | {key: value}))
    with pytest.raises(DataError, match=rf"camera\.yaml: .*{key}") as error:
        read_camera(path)
    assert len(str(error.value)) < len(str(path)) + 200


@pytest.mark.parametrize("key", ["rotation_road_to_camera", "position_m", "covariance"])
@pytest.mark.parametrize(
    "value", [None, 3, "x", [[HUGE]], [HUGE] * 3, [[0.0] * 3] * 3, [[-1.0]], [float("nan")] * 3]
)
def test_an_array_of_a_camera_that_none_has_is_refused(tmp_path, key, value):
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump(CAMERA | {key: value}))
    with pytest.raises(DataError, match=r"camera\.yaml: "):
        read_camera(path)


@pytest.mark.parametrize("key", ["lines", "lanes"])
@pytest.mark.parametrize(
    "value", [3, [1], {"a": 3}, {"a": [1, HUGE]}, {"a": [1, 2, 3, float("nan")]}, {"a": [1, 1]}]
)
def test_a_line_that_is_none_is_refused(tmp_path, key, value):
    path = tmp_path / "lines.yaml"
    path.write_text(yaml.safe_dump(MARKS | {key: value}))
    with pytest.raises(DataError, match=rf"lines\.yaml: {key}"):
        read_marks(path)
