"""What files beside the networks tell the tracker of them."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.declared import declared_settings, known_of
from jeat_graph.detection.models.onnx_head import CARD
from jeat_graph.detection.request import DetectRequest
from jeat_graph.detection.settings import load_settings


@pytest.mark.parametrize("network", ["sehn", "sehn-fast", "sehn-int8"])
def test_networks_of_the_package_say_what_their_scores_mean(network):
    said: list[str] = []
    asked = DetectRequest(frames="a", events="b", detector_frames=network, detector_events=network)
    sensors = load_config("default", declared_settings(asked, said.append)).sensors
    assert sensors.keys() == {"rgb", "evt"}
    assert all(0.2 < one.even_score < 0.6 for one in sensors.values())
    assert (sensors["rgb"].kind, sensors["evt"].kind) == ("camera", "event")
    assert [line.split(":")[0] for line in said] == ["sensor 'rgb'", "sensor 'evt'"]


def test_what_is_read_tells_what_a_sensor_is_whatever_finds_things_in_it():
    assert known_of(DetectRequest(frames="a")) == {}, "who finds what moves sees nothing that stands"
    assert known_of(DetectRequest(events="b")) == {"evt": {"kind": "event"}}
    only = known_of(DetectRequest(frames="a", events="b", detector_events="sehn"))
    assert (only.keys(), only["evt"]["kind"]) == ({"evt"}, "event")
    both = DetectRequest(frames="a", events="b", detector_fused="sehn")
    assert known_of(both)["fused"]["kind"] == "other"


def test_a_network_of_ones_own(tmp_path):
    network = tmp_path / "mine.onnx"
    request = DetectRequest(frames="a", detector_frames=str(network))
    assert known_of(request) == {"rgb": {"kind": "camera"}}
    beside = tmp_path / "mine.tracking.yaml"
    beside.write_text("sensor: {even_score: 0.7}\n", encoding="utf-8")
    told = load_config("default", declared_settings(request)).sensors["rgb"]
    assert (told.even_score, told.kind) == (0.7, "camera")
    beside.write_text("sensor: {kind: other}\n", encoding="utf-8")
    assert known_of(request) == {"rgb": {"kind": "other"}}, "who made the network knows better"
    for wrong in ("sensor: {even_skore: 0.7}", "sensors: {}", "sensor: 3", "sensor: {even_score: 7}", "- 1"):
        beside.write_text(wrong + "\n", encoding="utf-8")
        with pytest.raises(ConfigError) as error:
            declared_settings(request)
        assert "mine.tracking.yaml" in str(error.value), wrong


def test_what_the_user_says_of_a_network_of_both_sensors_counts_more(tmp_path):
    request = DetectRequest(frames="a", events="b", detector_fused=str(tmp_path / "mine.onnx"))
    (tmp_path / "mine.tracking.yaml").write_text("sensor: {even_score: 0.7, rate_hz: 30}\n", encoding="utf-8")
    settings = [*declared_settings(request), "sensors.fused.even_score=0.6"]
    fused = load_config("default", settings).sensors["fused"]
    assert (fused.even_score, fused.rate_hz) == (0.6, 30.0)


@pytest.mark.parametrize(
    ("outputs", "notes", "even"),
    [
        ({"output": np.zeros((1, 84, 85))}, None, 0.45),
        ({"logits": np.zeros((1, 9, 92)), "pred_boxes": np.zeros((1, 9, 4))}, None, 0.5),
        ({"output": np.zeros((1, 84, 85))}, {CARD: "{}"}, None),
        ({"odd": np.zeros((1, 7))}, None, None),
    ],
    ids=["yolox", "detr with nothing as a class", "one that `train` made", "of no layout"],
)
def test_the_layout_of_a_foreign_network_says_what_its_scores_mean(tmp_path, outputs, notes, even):
    pytest.importorskip("onnx", reason="pip install onnx")
    from .models.tiny import constant_net

    network = tmp_path / "other.onnx"
    constant_net(network, outputs, (64, 64), notes=notes)
    said: list[str] = []
    request = DetectRequest(frames="a", detector_frames=str(network))
    settings = declared_settings(request, said.append)
    if even is None:
        assert (settings, said) == (['sensors."rgb".kind="camera"'], [])
        return
    assert load_config("default", settings).sensors["rgb"].even_score == even
    assert f"score {even:g}" in said[0]
    (tmp_path / "other.tracking.yaml").write_text("sensor: {even_score: 0.7}\n", encoding="utf-8")
    assert load_config("default", declared_settings(request)).sensors["rgb"].even_score == 0.7


def test_a_layout_that_the_user_says_counts(tmp_path):
    pytest.importorskip("onnx", reason="pip install onnx")
    from .models.tiny import constant_net

    network = tmp_path / "other.onnx"
    logits, boxes = np.zeros((1, 9, 3), np.float32), np.zeros((1, 9, 4), np.float32)
    constant_net(network, {"logits": logits, "pred_boxes": boxes}, (64, 64))
    settings = load_settings(None, ["model_frames.layout=detr-softmax"])
    request = DetectRequest(frames="a", detector_frames=str(network), settings=settings)
    assert load_config("default", declared_settings(request)).sensors["rgb"].even_score == 0.5
