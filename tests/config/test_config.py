"""Configurations: read, overridden, refused with a useful sentence, written back."""

import dataclasses
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.config.fields import LARGEST, SMALLEST, check
from jeat_graph.config.reading import config_from_dict, config_to_dict, load_config, preset_names
from jeat_graph.config.schema import Config, LiveConfig, PaperConfig, SensorConfig
from jeat_graph.config.sensors import ClockConfig
from jeat_graph.data.errors import ConfigError
from jeat_graph.io.files.config_io import save_config


def write(tmp_path, text, name="my.yaml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def refusal(*args, **kwargs):
    with pytest.raises(ConfigError) as info:
        load_config(*args, **kwargs)
    assert "\n" not in str(info.value), "a message is one line"
    return str(info.value)


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_loads_and_survives_a_round_trip(name, tmp_path):
    config = load_config(name)
    assert config_from_dict(config_to_dict(config)) == config
    save_config(config, tmp_path / "copy.yaml", comment="two\nlines")
    assert (tmp_path / "copy.yaml").read_text(encoding="utf-8").startswith("# two\n# lines\n")
    assert load_config(tmp_path / "copy.yaml") == config


def test_the_presets_of_the_contract_exist():
    assert {"default", "highway", "paper"} <= set(preset_names())


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("adaptation_rate", 0.1),
        ("scale_min", 0.5),
        ("scale_max", 5.0),
        ("score_floor", 0.1),
        ("confirm_age_s", 0.5),
        ("confirm_hits", 5),
        ("max_gap_confirmed_s", 0.5),
        ("max_gap_tentative_s", 0.2),
    ],
)
def test_the_paper_preset_has_the_papers_constants(name, value):
    config = load_config("paper")
    assert config.tracker.engine == "paper"
    assert getattr(config.paper, name) == value


def _leaves(section):
    """Settings of a section: a sensor counted once, a vector by its length."""
    count = 0
    for f in dataclasses.fields(section):
        value = getattr(section, f.name)
        if dataclasses.is_dataclass(value):
            count += _leaves(value)
        elif isinstance(value, dict):
            count += _leaves(SensorConfig(clock=ClockConfig()))
        else:
            count += max(len(value), 1) if isinstance(value, tuple) else 1
    return count


def test_there_are_at_most_sixty_settings():
    count = _leaves(load_config("default"))
    print(f"{count} settings")
    assert count <= 60


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("smoother.lag=1", ["smoother.lag", "smoother.lag_s"]),
        ("smoothr.lag_s=1", ["smoothr", "smoother"]),
        ("sensors.rgb.rate_hs=1", ["sensors.rgb.rate_hs", "sensors.rgb.rate_hz"]),
        ("sensors.rgb.clock.drift=1", ["sensors.rgb.clock.drift", "sensors.rgb.clock.drift_ppm"]),
        ("paper.jerk=1", ["paper.jerk", "paper.jerk_px"]),
    ],
)
def test_an_unknown_key_names_the_nearest_known_one(override, words):
    message = refusal("default", [override])
    assert all(word in message for word in words), message


def test_an_unknown_preset_names_the_nearest_one():
    assert "paper" in refusal("papr")
    assert "presets:" in refusal("qqqqqqqq")


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("paper.adaptation_rate=2", ["paper.adaptation_rate", "2", "[0.0, 1.0]"]),
        ("paper.scale_min=6", ["paper.scale_min", "scale_max"]),
        ("sensors.evt.even_score=1.5", ["sensors.evt.even_score", "1.5", "(0.0, 1.0]"]),
        ("sensors.evt.sigma_px=.nan", ["sensors.evt.sigma_px", "nan"]),
        ("sensors.evt.rate_hz=.inf", ["sensors.evt.rate_hz", "inf"]),
        ("sensors.evt.rate_hz=0", ["sensors.evt.rate_hz", "(0.0, 1e+16]", "(Hz)"]),
        ("smoother.lag_s=-1", ["smoother.lag_s", "-1.0", "(0.0, 1e+16]"]),
        ("smoother.lag_s=long", ["smoother.lag_s", "number", "long"]),
        ("smoother.lag_s=true", ["smoother.lag_s", "number"]),
        ("smoother.engine=kalman", ["smoother.engine", "kalman", "fixed-lag", "none"]),
        ("output.clip=2", ["output.clip", "true or false"]),
        ("output.clip=yes please", ["output.clip", "true or false"]),
        ("paper.confirm_hits=0", ["paper.confirm_hits", "0"]),
        ("paper.confirm_hits=2.5", ["paper.confirm_hits", "whole number"]),
        ("sensors.rgb.image=640", ["sensors.rgb.image", "list"]),
        ("sensors.rgb.image=[640]", ["sensors.rgb.image", "2 entries"]),
        ("smoother=3", ["smoother", "key: value"]),
        ("motion.jerk_px=3", ["motion", "no setting any more"]),
    ],
)
def test_a_bad_value_names_the_field_and_what_would_be_right(override, words):
    message = refusal("default", [override])
    assert all(word in message for word in words), message


@pytest.mark.parametrize("text", ["smoother.lag_s", "=3", "smoother.lag_s=[1", "smoother.lag_s.x=1"])
def test_an_override_that_cannot_be_read_is_refused(text):
    assert "--set" in refusal("default", [text])


def test_overrides_are_laid_over_the_preset_one_after_the_other():
    base = load_config("paper")
    config = load_config("paper", ["smoother.lag_s=7", "sensors.rgb.rate_hz=30", "smoother.lag_s=8"])
    assert config.smoother == dataclasses.replace(base.smoother, lag_s=8.0)
    assert config.sensors["rgb"] == dataclasses.replace(base.sensors["rgb"], rate_hz=30.0)
    assert config.sensors["evt"] == base.sensors["evt"]
    assert load_config("paper") == base, "an override must not reach the next load"


@pytest.mark.parametrize("text", ["2e-3", "2E-3", ".2e-2", "20e-4", "+2.e-3", "2.0e-3"])
def test_a_number_may_have_an_exponent_with_or_without_a_point(text):
    assert load_config("default", [f"sensors.evt.latency_s={text}"]).sensors["evt"].latency_s == 0.002


@pytest.mark.parametrize("text", ["e5", "1e", "1e5s", "1 e5", "'0x1e5'"])
def test_what_only_looks_like_an_exponent_is_no_number(text):
    assert "must be a number" in refusal("default", [f"sensors.evt.latency_s={text}"])


def test_a_section_that_the_preset_leaves_out_can_be_overridden(tmp_path):
    path = write(tmp_path, "sensors: {cam: {}}\n")
    assert load_config(path, ["live.late_s=3"]).live.late_s == 3.0


def test_a_file_lies_over_its_base(tmp_path):
    path = write(tmp_path, "base: paper\npaper: {scale_max: 4}\nsensors: {rgb: {sigma_px: 9}}\n")
    config, paper = load_config(path), load_config("paper")
    assert config.paper == dataclasses.replace(paper.paper, scale_max=4.0)
    assert config.sensors["rgb"] == dataclasses.replace(paper.sensors["rgb"], sigma_px=9.0)
    assert config.sensors["evt"] == paper.sensors["evt"]


def test_a_base_of_a_base_is_followed(tmp_path):
    first = write(tmp_path, "base: paper\npaper: {scale_max: 4}\n", "first.yaml")
    second = write(tmp_path, f"base: {first}\npaper: {{scale_min: 2}}\n", "second.yaml")
    found = load_config(second).paper
    assert (found.scale_min, found.scale_max, found.adaptation_rate) == (2.0, 4.0, 0.1)


def test_bases_in_a_circle_are_refused(tmp_path):
    one, two = tmp_path / "one.yaml", tmp_path / "two.yaml"
    one.write_text(f"base: {two}\n")
    two.write_text(f"base: {one}\n")
    assert "leads back to itself" in refusal(one)


def test_yaml_that_cannot_be_read_names_file_and_line(tmp_path):
    path = write(tmp_path, "sensors:\n  rgb: {rate_hz: 20\nmotion: 3\n")
    message = refusal(path)
    assert f"{path}:" in message
    assert "YAML" in message


@pytest.mark.parametrize("text", ["", "- a\n- b\n", "just text\n", "3\n"])
def test_a_file_without_keys_is_refused(tmp_path, text):
    assert "key: value" in refusal(write(tmp_path, text))


def test_a_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"\xff\xfe\x00\x81")
    assert str(path) in refusal(path)


@pytest.mark.parametrize("text", ["input: {undeclared: refuse}\n", "sensors: [rgb]\n"])
def test_a_configuration_without_sensors_is_refused(tmp_path, text):
    assert "sensor" in refusal(write(tmp_path, text))


@pytest.mark.parametrize("name", ["", "a|b", "a,b", " a", 'a"b'])
def test_a_sensor_name_that_would_break_a_table_is_refused(name):
    with pytest.raises(ConfigError, match="sensors"):
        Config(sensors={name: SensorConfig()})


def test_more_sensors_than_a_row_has_bits_are_refused():
    with pytest.raises(ConfigError, match="at most 63"):
        Config(sensors={f"s{k}": SensorConfig() for k in range(64)})


def test_sensors_stand_in_alphabetical_order_whatever_the_file_says():
    assert Config(sensors={"z": SensorConfig(), "a": SensorConfig()}).sensor_names == ("a", "z")


def test_a_configuration_is_frozen():
    config = load_config("default")
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.live = LiveConfig()
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.live.late_s = 3.0


def test_every_field_has_a_meaning_and_every_number_a_unit_and_bounds():
    sections = [type(getattr(load_config("default"), f.name)) for f in dataclasses.fields(Config)][1:]
    for section in [SensorConfig, *sections]:
        for f in dataclasses.fields(section):
            assert f.metadata.get("doc"), f"{section.__name__}.{f.name}"
            if isinstance(f.default, float):
                assert f.metadata.get("unit"), f"{section.__name__}.{f.name}"
                assert "low" in f.metadata


@given(rate=st.floats(), low=st.floats(), high=st.floats())
def test_a_section_is_accepted_exactly_if_each_value_is_within_its_bounds(rate, low, high):
    good = 0.0 <= rate <= 1.0 and SMALLEST <= low <= high <= LARGEST and not 0.0 < rate < SMALLEST
    try:
        found = PaperConfig(adaptation_rate=rate, scale_min=low, scale_max=high)
    except ConfigError:
        assert not good
    else:
        assert good
        check(found)


def test_a_size_of_the_picture_that_is_said_is_given():
    seen = load_config("default")
    assert seen.input.picture == "seen"
    assert config_from_dict(config_to_dict(seen)).input.picture == "seen"
    assert load_config("default", ["image.width=1920"]).input.picture == "given"


def test_a_setting_of_a_sensor_declares_it():
    config = load_config("default", ["sensors.cam.latency_s=0.1", "sensors.cam.clock.offset_s=2"])
    assert config.sensors["cam"] == SensorConfig(latency_s=0.1, clock=ClockConfig(offset_s=2.0))


def test_a_file_and_each_base_of_it_is_read_once(tmp_path, monkeypatch):
    write(tmp_path, "base: paper\nsensors: {radar: {rate_hz: 10}}\n", "middle.yaml")
    top = write(tmp_path, f"base: {tmp_path / 'middle.yaml'}\nimage: {{width: 640}}\n", "top.yaml")
    read = []
    read_text = Path.read_text

    def counted(path, *args, **kwargs):
        read.append(path.name)
        return read_text(path, *args, **kwargs)

    monkeypatch.setattr(Path, "read_text", counted)
    config = load_config(top)
    assert [name for name in read if name.endswith(".yaml") and name != "paper.yaml"] == [
        "top.yaml",
        "middle.yaml",
    ]
    assert config.image.width == 640
    assert {"rgb", "evt", "radar"} == set(config.sensors)
