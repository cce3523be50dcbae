"""Networks that make a vector of a crop: how they are fed, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("onnx")

import onnx
from onnx import TensorProto, helper

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.detection.embedder_settings import EmbedderSettings
from jeat_graph.detection.embedding import open_embedder
from jeat_graph.detection.models.crop_network import NetworkEmbedder
from jeat_graph.detection.settings import load_settings

RNG = np.random.default_rng(3)
PICTURE = RNG.integers(0, 256, (60, 80, 3), dtype=np.uint8)
BOXES = np.array([[0.0, 0, 8, 8], [20, 10, 8, 8], [40, 20, 8, 8], [200, 0, 8, 8], [60, 30, 8, 8]])


def mean_net(path, shape, notes=None, last=False, outputs=1):
    """A network whose vector is the mean of each colour of its input, so that what it was fed shows."""
    axes = [1, 2] if last else [2, 3]
    nodes = [
        helper.make_node("ReduceMean", ["crop"], [f"look{k}"], keepdims=0, axes=axes) for k in range(outputs)
    ]
    ports = [
        helper.make_tensor_value_info(f"look{k}", TensorProto.FLOAT, [shape[0], 3]) for k in range(outputs)
    ]
    given = helper.make_tensor_value_info("crop", TensorProto.FLOAT, list(shape))
    graph = helper.make_graph(nodes, "looks", [given], ports)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    for key, value in (notes or {}).items():
        note = model.metadata_props.add()
        note.key, note.value = key, value
    onnx.save(model, str(path))
    return path


def expected(mean, std, rgb=True):
    """What the network must say of `BOXES`: mean colours, scaled, of unit length."""
    out = np.full((len(BOXES), 3), np.nan)
    for row, (x, y, w, h) in enumerate(BOXES.astype(int)):
        if x < 80:
            colour = PICTURE[y : y + h, x : x + w].reshape(-1, 3).mean(axis=0)
            out[row] = ((colour if rgb else colour[::-1]) - mean) / std
    return out / np.linalg.norm(out, axis=1, keepdims=True)


IMAGENET = 255.0 * np.array([0.485, 0.456, 0.406]), 255.0 * np.array([0.229, 0.224, 0.225])


@pytest.mark.parametrize("batch", [1, 2, 3])
def test_crops_are_fed_as_usual_in_batches_of_the_file(tmp_path, batch):
    net = NetworkEmbedder(
        mean_net(tmp_path / "net.onnx", (batch, 3, 8, 8)), EmbedderSettings(backend="opencv")
    )
    np.testing.assert_allclose(net(PICTURE, BOXES), expected(*IMAGENET), atol=1e-5)
    assert "8 x 8 px (RGB" in net.description
    assert not net.note()


def test_notes_say_colours_size_and_normalisation(tmp_path):
    notes = {"color": "bgr", "mean": "[10, 20, 30]", "std": "[2, 4, 8]", "imgsz": "[8, 8]"}
    path = mean_net(tmp_path / "net.onnx", (1, 3, "h", "w"), notes)
    said = expected(np.array([10.0, 20, 30]), np.array([2.0, 4, 8]), rgb=False)
    np.testing.assert_allclose(NetworkEmbedder(path)(PICTURE, BOXES), said, atol=1e-5)
    # Settings come before notes.
    own = EmbedderSettings(color="rgb", mean=(1.0, 1.0, 1.0), std=(3.0, 3.0, 3.0))
    np.testing.assert_allclose(
        NetworkEmbedder(path, own)(PICTURE, BOXES), expected(np.ones(3), 3.0 * np.ones(3)), atol=1e-5
    )


def test_colours_may_be_the_last_side(tmp_path):
    path = mean_net(tmp_path / "net.onnx", (1, 8, 8, 3), last=True)
    np.testing.assert_allclose(NetworkEmbedder(path)(PICTURE, BOXES), expected(*IMAGENET), atol=1e-5)


def test_an_open_size_must_be_said(tmp_path):
    path = mean_net(tmp_path / "net.onnx", (1, 3, "h", "w"))
    with pytest.raises(DataError, match=r"embedder.width=… --detection-set embedder.height"):
        NetworkEmbedder(path)
    settings = load_settings(None, ["embedder.width=8", "embedder.height=8"]).embedder
    np.testing.assert_allclose(
        NetworkEmbedder(path, settings)(PICTURE, BOXES), expected(*IMAGENET), atol=1e-5
    )


@pytest.mark.parametrize(
    ("shape", "notes", "outputs", "message"),
    [
        ((1, 4, 8, 8), None, 1, "takes crop"),
        ((1, 3, 8, 8), {"mean": "[1, 2]"}, 1, "note `mean`"),
        ((1, 3, 8, 8), {"std": "[0, 1, 1]"}, 1, "not positive"),
        ((1, 3, 8, 8), {"color": "yuv"}, 1, "neither rgb nor bgr"),
        ((1, 3, 8, 8), None, 2, "one vector of a crop"),
    ],
)
def test_other_networks_are_refused(tmp_path, shape, notes, outputs, message):
    path = mean_net(tmp_path / "net.onnx", shape, notes, outputs=outputs)
    with pytest.raises(DataError, match=message):
        NetworkEmbedder(path)


def test_vectors_of_nothing_are_refused(tmp_path):
    net = NetworkEmbedder(
        mean_net(tmp_path / "net.onnx", (1, 3, 8, 8), {"mean": "[9, 9, 9]", "std": "[1, 1, 1]"})
    )
    flat = np.full((60, 80, 3), 9, dtype=np.uint8)
    with pytest.raises(DataError, match="all zero"):
        net(flat, BOXES)


def test_other_names_are_refused():
    with pytest.raises(ConfigError, match=r"colour or FILE\.onnx"):
        open_embedder("resnet", EmbedderSettings())
    with pytest.raises(ConfigError, match="both"):
        EmbedderSettings(width=8)
