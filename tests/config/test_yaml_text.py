"""YAML from anybody: plain values, in time and memory that its length deserves."""

from __future__ import annotations

import time

import pytest
import yaml

from jeat_graph.config.reading import load_config
from jeat_graph.config.yaml_text import MOST_VALUES, load_yaml
from jeat_graph.data.errors import ConfigError

BOMB = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 10)}]\n"
    for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)


def test_plain_values_and_moderate_repetition_are_read():
    assert load_yaml("a: &a {x: 1}\nb: *a\nc: {<<: *a, y: 2.5}") == {
        "a": {"x": 1},
        "b": {"x": 1},
        "c": {"x": 1, "y": 2.5},
    }
    assert load_yaml("") is None


@pytest.mark.parametrize("text", ["a: 1\nb: 2\na: 3", "c: {a: 1, a: 1}", "- {x: 1}\n- {x: 1, y: 2, x: 3}"])
def test_a_key_that_comes_twice_is_refused(text):
    with pytest.raises(yaml.YAMLError, match="comes twice"):
        load_yaml(text)


@pytest.mark.parametrize(
    "text", [BOMB, f"base: {{{BOMB.splitlines()[0][3:]}: 1}}\n", "a: &a [*a]", "[" * 50_000]
)
def test_a_text_that_stands_for_too_much_is_refused_at_once(text):
    begin = time.process_time()
    with pytest.raises(yaml.YAMLError):
        load_yaml(text)
    assert time.process_time() - begin < 20.0


def test_a_text_as_long_as_the_bound_is_read():
    rows = MOST_VALUES // 4
    assert len(load_yaml("[" + "1," * rows + "]")) == rows


def test_no_tag_runs_anything(tmp_path):
    touched = tmp_path / "touched"
    with pytest.raises(yaml.YAMLError):
        load_yaml(
            f"!!python/object/apply:pathlib.Path.touch [!!python/object/apply:pathlib.Path [{touched}]]"
        )
    assert not touched.exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("base: [default]\n", "`base` must be the name"),
        (BOMB + "base: *i\n", "not valid YAML: stands for more than"),
        ("a: 2026-99-99\n", "not valid YAML"),
        ("[" * 600, "not valid YAML: is nested too deeply"),
    ],
)
def test_a_configuration_file_of_that_kind_is_one_short_line(tmp_path, text, words):
    path = tmp_path / "c.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert words in str(caught.value)
    assert len(str(caught.value)) < 300 + len(str(path))


def test_a_long_chain_of_bases_is_refused(tmp_path):
    for k in range(200):
        (tmp_path / f"{k}.yaml").write_text(f"base: {tmp_path / f'{k + 1}.yaml'}\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="more than 50 files"):
        load_config(tmp_path / "0.yaml")


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("paper.jerk_px=1e300", "not in"),
        ("image.width=1e-200", "closer to 0"),
        ("sensors.rgb.sigma_px=1e-160", "closer to 0"),
    ],
)
def test_settings_whose_squares_no_float_holds_are_refused(override, words):
    with pytest.raises(ConfigError, match=words):
        load_config("default", override)


@pytest.mark.parametrize("name", ["a\x1b[2J", "a\u202eb", "a\x00"])
def test_a_sensor_cannot_be_called_what_a_terminal_obeys(name):
    with pytest.raises(ConfigError, match="cannot be a name"):
        load_config("default", f'sensors={{"{name!r}": {{}}}}'.replace("'", ""))
