"""Names of networks: those that come with the package, and everything else is a file."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.models.engine import open_engine
from jeat_graph.detection.models.events import ModelEventDetector
from jeat_graph.detection.models.fused import FusedDetector
from jeat_graph.detection.models.onnx_head import read_onnx_head
from jeat_graph.detection.models.pictures import ModelPictureDetector
from jeat_graph.detection.named import network_file, networks

SHIPPED = [(kind, name) for kind in ("frames", "events", "fused") for name in networks(kind)]


def test_files_are_files(tmp_path):
    assert network_file("mine.onnx", "frames").name == "mine.onnx"
    assert network_file("nets/mine", "events").parts == ("nets", "mine")


def test_a_name_that_is_not_known_is_told_what_is():
    with pytest.raises(ConfigError, match=r"'sehm' is no detector of frames: it is one of auto, motion"):
        network_file("sehm", "frames")


@pytest.mark.parametrize(("kind", "name"), SHIPPED)
def test_shipped_networks_load_and_say_where_they_come_from(kind, name):
    path = network_file(name, kind)
    card = json.loads(read_onnx_head(path).notes["card"])
    assert card["kind"] == kind
    assert card["data"]
    assert all(one["AP50"] is not None for one in card["tested"].values())
    assert path.stat().st_size < 1_500_000
    size_px = tuple(card["side"])
    if kind == "frames":
        detector = ModelPictureDetector(path)
    else:
        detector = {"events": ModelEventDetector, "fused": FusedDetector}[kind](path, size_px)
    assert "layout yolov8" in detector.description


@pytest.mark.parametrize(("kind", "name"), SHIPPED)
def test_shipped_networks_run_with_the_base_install(kind, name):
    """OpenCV alone runs them; where nothing is rounded to 8 bit, ONNX Runtime says the same."""
    path = network_file(name, kind)
    head = read_onnx_head(path)
    rng = np.random.default_rng(3)
    given = {port.name: rng.integers(0, 2, port.shape).astype(port.kind) for port in head.inputs}
    found = open_engine(path, head, "opencv", 1).run(given)
    for port in head.outputs:
        assert found[port.name].shape == port.shape
        assert np.isfinite(found[port.name]).all()
    if name == "sehn":
        pytest.importorskip("onnxruntime", reason="the extra `onnxruntime` is not installed")
        for output, value in open_engine(path, head, "onnxruntime", 1).run(given).items():
            np.testing.assert_allclose(found[output], value, rtol=1e-3, atol=1e-2)
