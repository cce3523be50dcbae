"""What files beside the networks tell the tracker of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.declared import declared_settings
from jeat_graph.detection.request import DetectRequest


@pytest.mark.parametrize("network", ["sehn", "sehn-int8"])
def test_networks_of_the_package_are_declared_as_their_preset_declares_them(network):
    said: list[str] = []
    asked = DetectRequest(frames="a", events="b", detector_frames=network, detector_events=network)
    found, preset = load_config("default", declared_settings(asked, said.append)), load_config("sehn")
    rgb = replace(preset.sensors["rgb"], disagreement=0.0)  # beside events
    assert found.sensors == {**preset.sensors, "rgb": rgb}
    assert found.lifecycle.least_move == 0.2
    assert found.smoother.max_gap_s == preset.smoother.max_gap_s == 0.3
    assert found.birth.max_overlap == preset.birth.max_overlap
    assert found.merge == preset.merge
    assert found.output.position_scale == preset.output.position_scale
    # Of two the more exact one counts.
    assert found.output.lasting_error == preset.output.lasting_error
    assert found.motion == load_config("default").motion
    assert [line.split(":")[0] for line in said[:2]] == ["sensor 'rgb'", "sensor 'evt'"]
    assert "no rows" in said[2]
    assert "--set smoother.max_gap_s=0" in said[2]


def test_of_the_fast_networks_larger_errors_and_more_misses_are_declared():
    def declared(network):
        asked = DetectRequest(frames="a", events="b", detector_frames=network, detector_events=network)
        return load_config("default", declared_settings(asked))

    fast, exact = declared("sehn-fast"), declared("sehn")
    assert list(fast.sensors) == list(exact.sensors)
    for name, sensor in fast.sensors.items():
        assert sensor.p_detect < exact.sensors[name].p_detect
        assert len(sensor.score_noise) == len(sensor.score_fit) == 12
    assert fast.sensors["rgb"].sigma_px > exact.sensors["rgb"].sigma_px
    assert (fast.birth, fast.merge, fast.output) == (exact.birth, exact.merge, exact.output)


def test_who_looks_at_nothing_or_has_no_weights_says_nothing():
    assert declared_settings(DetectRequest(frames="a", events="b")) == []
    only = declared_settings(DetectRequest(frames="a", events="b", detector_events="sehn"))
    assert {line.split(".")[1] for line in only if line.startswith("sensors")} == {"evt"}
    pictures = declared_settings(DetectRequest(frames="a", detector_frames="sehn"))
    assert not any("disagreement" in line or "least_move" in line for line in pictures)
    # Events do not see what stands: their gaps are bridged.
    assert "smoother.max_gap_s=0.3" in pictures
    assert not any("max_gap_s" in line for line in only)
    # What is known of the events' boxes was found, and pays, beside pictures.
    alone = declared_settings(DetectRequest(events="b", detector_events="sehn"))
    # But for what their scores say of boxes and tracks, which was measured of each sensor alone.
    names = ["sensors.evt.score_noise", "sensors.evt.score_fit", "merge.apart_overlap"]
    names += ["output.position_scale", "output.lasting_error"]
    assert [line.split("=")[0] for line in alone] == names


def test_a_network_of_ones_own(tmp_path):
    network = tmp_path / "mine.onnx"
    request = DetectRequest(frames="a", detector_frames=str(network))
    assert declared_settings(request) == []
    beside = tmp_path / "mine.tracking.yaml"
    beside.write_text("sensor: {p_detect: 0.7}\n", encoding="utf-8")
    assert declared_settings(request) == ["sensors.rgb.p_detect=0.7"]
    beside.write_text("sensor: {p_detect: 0.7, score_fit: [[0.1, 0.2], [0.9, 1]]}\nbeside: evt\n")
    assert declared_settings(request) == ["sensors.rgb.score_fit=[[0.1, 0.2], [0.9, 1]]"]
    beside.write_text("sensor: {p_detect: 0.7}\nbeside: evt\n")
    assert declared_settings(request) == []
    beside.write_text("together: {evt: {disagreement: 2}}\nlifecycle: {least_move: 0.5}\n")
    assert declared_settings(request) == ["lifecycle.least_move=0.5"]
    both = replace(request, events="b")
    assert declared_settings(both) == ["sensors.rgb.disagreement=2", "lifecycle.least_move=0.5"]
    for wrong in (
        "together: {lidar: {disagreement: 2}}",
        "together: {evt: {disagrement: 2}}",
        "lifecycle: {least_moves: 2}",
        "merge: {apart_overlap: 2}",
        "output: {position_scale: 0}",
        "sensor: {p_detekt: 0.7}",
        "sensors: {}",
        "sensor: 3",
        "sensor: {p_detect: 7}",
        "- 1",
    ):
        beside.write_text(wrong + "\n", encoding="utf-8")
        with pytest.raises(ConfigError) as error:
            declared_settings(request)
        assert "mine.tracking.yaml" in str(error.value), wrong


def test_a_network_of_both_sensors_is_declared_beside_what_any_sensor_is_taken_for(tmp_path):
    request = DetectRequest(frames="a", events="b", detector_fused=str(tmp_path / "mine.onnx"))
    (tmp_path / "mine.tracking.yaml").write_text(
        "sensor: {p_detect: 0.7, rho_size: 0.01}\noutput: {position_scale: 0.5}\n", encoding="utf-8"
    )
    config = load_config("default", declared_settings(request))
    any_other = config.input.undeclared_sensor()
    assert config.sensors["fused"] == replace(any_other, p_detect=0.7, rho_size=0.01)
    assert any_other.rho_size != 0.01
    assert config.output.position_scale == 0.5
    # What the user says of it counts more.
    settings = [*declared_settings(request), "sensors.fused.p_detect=0.6"]
    assert load_config("default", settings).sensors["fused"].p_detect == 0.6


def test_a_network_without_a_file_of_its_own_has_that_of_its_layout(tmp_path):
    """What was measured of YOLOX's boxes holds for every YOLOX; a file beside the network goes before it."""
    pytest.importorskip("onnx", reason="pip install onnx")
    from .models.tiny import constant_net

    def of(outputs):
        net = constant_net(tmp_path / "net.onnx", {"output": outputs}, (128, 96))
        return declared_settings(DetectRequest(frames="a", detector_frames=str(net)))

    cells = 16 * 12 + 8 * 6 + 4 * 3
    assert "sensors.rgb.rho_y=0.074" in of(np.ones((1, cells, 85)))
    assert of(np.ones((1, 84, cells))) == []
    (tmp_path / "net.tracking.yaml").write_text("sensor: {rho_y: 0.05}\n")
    assert of(np.ones((1, cells, 85))) == ["sensors.rgb.rho_y=0.05"]
