"""The kernels' form of a configuration: every number and flag of the schema under its own name."""

import dataclasses
import pickle

import numpy as np
import pytest
from scipy.stats import chi2

from jeat_graph.association.methods import JOINT, METHODS, SEQUENTIAL, SLOTS
from jeat_graph.config import kernel_form
from jeat_graph.config.kernel_form import kernel_model, kernel_settings, priority_order
from jeat_graph.config.reading import load_config, preset_names
from jeat_graph.config.schema import Config

OTHERS = ("sensors", "input", "smoother", "live")


@pytest.mark.parametrize("preset", preset_names())
def test_every_number_and_flag_of_the_schema_is_there_under_its_name(preset):
    config = load_config(preset)
    settings = kernel_settings(config)
    compared = 0
    for section in dataclasses.fields(Config):
        if section.name in OTHERS:
            assert not hasattr(settings, section.name)
            continue
        declared = getattr(config, section.name)
        for f in dataclasses.fields(declared):
            value = getattr(declared, f.name)
            if isinstance(value, bool | int | float):
                found = getattr(getattr(settings, section.name), f.name)
                assert found == value
                assert type(found) is type(f.default)
                compared += 1
    assert compared > 50


def test_a_whole_number_in_the_place_of_a_number_compiles_nothing_anew():
    config = load_config("highway")
    other = dataclasses.replace(config, motion=dataclasses.replace(config.motion, jerk_px=0))
    assert type(kernel_settings(other).motion.jerk_px) is float


@pytest.mark.parametrize("probability", [0.9, 0.99, 0.999999])
def test_probabilities_of_gates_become_bounds(probability):
    overrides = [f"association.gate_probability={probability}", f"merge.gate_probability={probability}"]
    settings = kernel_settings(load_config("highway", overrides))
    expected = pytest.approx(chi2.ppf(probability, 2), rel=1e-6)
    assert settings.association.gate_bound == expected
    assert settings.association.size_gate_bound == expected
    assert settings.merge.gate_bound == expected
    open_ = kernel_settings(load_config("highway", ["association.size_gate=false"]))
    assert open_.association.size_gate_bound == np.inf


@pytest.mark.parametrize(("name", "code"), [("slots", SLOTS), ("joint", JOINT), ("sequential", SEQUENTIAL)])
def test_names_of_methods_become_their_numbers(name, code):
    overrides = [f"association.method={name}", "association.second_pass=true"]
    settings = kernel_settings(load_config("highway", overrides))
    assert settings.association.method_code == code
    assert METHODS[code] == name
    assert settings.association.second_views == (name != "slots")


def test_false_boxes_spread_over_the_picture_and_the_range_of_sizes():
    overrides = ["image.width=100", "image.height=50", "association.log_size_range=2"]
    settings = kernel_settings(load_config("highway", overrides))
    assert settings.log_clutter_volume == pytest.approx(np.log(100 * 50 * 4))


def test_sensors_stand_in_alphabetical_order_and_their_columns_have_the_schema_s_names():
    config = load_config("highway")
    sensors = kernel_model(config).sensors
    columns = ("sigma_px", "correlated_share", "p_detect", "clutter_per_scan", "precision", "tempering")
    for k, name in enumerate(config.sensor_names):
        declared = config.sensors[name]
        for same in columns:
            assert getattr(sensors, same)[k] == getattr(declared, same)
        assert tuple(sensors.bias[k]) == declared.bias
        assert sensors.period_s[k] == 1.0 / declared.rate_hz
        assert sensors.correlation_time_s[sensors.error[k]] == declared.memory_s


def test_the_sequential_order_begins_with_the_priority():
    config = load_config("highway", ["association.priority=[rgb]"])
    assert [config.sensor_names[s] for s in priority_order(config)] == ["rgb", "evt"]
    assert priority_order(load_config("highway")).tolist() == [0, 1]


def test_the_tuples_are_found_again_by_name_as_the_cache_of_compiled_code_needs():
    settings = kernel_settings(load_config("highway"))
    assert pickle.loads(pickle.dumps(settings)) == settings
    assert getattr(kernel_form, type(settings.motion).__name__) is type(settings.motion)
