"""Scenario files: layering and refusals."""

from pathlib import Path

import pytest

from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.simulation.scenario import load_scenario, scenario_from_dict, scenario_to_yaml


def test_a_scenario_survives_writing_and_reading(tmp_path: Path) -> None:
    scenario = load_scenario("night-dense")
    path = tmp_path / "scenario.yaml"
    path.write_text(scenario_to_yaml(scenario), encoding="utf-8")
    assert load_scenario(path) == scenario


def test_a_file_lays_its_keys_over_its_base(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("base: night\nsensors: {evt: {timing: {rate_hz: 200}}}\n", encoding="utf-8")
    mine, night = load_scenario(path), load_scenario("night")
    assert mine.sensors["evt"].timing.rate_hz == 200.0
    assert mine.sensors["evt"].detect == night.sensors["evt"].detect
    assert mine.sensors["rgb"] == night.sensors["rgb"]


def test_density_can_be_overridden() -> None:
    assert load_scenario("day", "dense") == load_scenario("day-dense")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("base: day\ntrafic: {}\n", "did you mean traffic"),
        ("base: day\nsensors: {rgb: {detect: {p_mex: 1}}}\n", "did you mean sensors.rgb.detect.p_max"),
        ("base: day\nsensors: {rgb: {detect: {p_max: 2}}}\n", "sensors.rgb.detect.p_max: 2.0 is not in"),
        ("base: day\ntraffic: {density: medium}\n", "traffic.density: 'medium' is not one of"),
        ("base: day\ncamera: {width: wide}\n", "camera.width: must be a whole number"),
        ("base: day\ntruth_sensor: radar\n", "truth_sensor: 'radar'"),
        ("light: {}\n", "at least one sensor"),
        ("base: [\n", "not valid YAML"),
        ("just text\n", "key: value"),
    ],
)
def test_bad_files_are_refused_with_the_place_and_what_would_be_right(
    tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=message.replace("[", r"\[")):
        load_scenario(path)


def test_a_base_that_leads_back_to_itself_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "loop.yaml"
    path.write_text(f"base: {path}\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="leads back"):
        load_scenario(path)


def test_sections_left_out_take_their_defaults() -> None:
    assert scenario_from_dict({"sensors": {"rgb": None}}).traffic.density == "normal"
