"""Numbers of a network that lie in other files: only beside it, and only in files."""

from __future__ import annotations

import os

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.onnx_head import read_onnx_head
from jeat_graph.detection.models.pictures import ModelPictureDetector

onnx = pytest.importorskip("onnx", reason="pip install onnx")
from onnx import TensorProto, helper, numpy_helper  # noqa: E402

ROWS = np.zeros((1, 8, 6), np.float32)
ROWS[0, 0] = [16, 24, 80, 56, 0.9, 0]
PICTURE = np.zeros((96, 128, 3), np.uint8)


def network(path, location, where="initializer"):
    """A network whose boxes lie at a place: as an initializer, or in an attribute of a node of a subgraph."""
    boxes = numpy_helper.from_array(ROWS, "boxes")
    boxes.ClearField("raw_data")
    boxes.data_location = TensorProto.EXTERNAL
    for key, value in (("location", location), ("offset", "0"), ("length", str(ROWS.nbytes))):
        boxes.external_data.add(key=key, value=value)
    given = helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, 96, 128])
    out = helper.make_tensor_value_info("output0", TensorProto.FLOAT, [1, 8, 6])
    values = [numpy_helper.from_array(np.zeros(1, np.float32), "zero")]
    nodes = [
        helper.make_node("ReduceMean", ["images"], ["mean"], keepdims=0),
        helper.make_node("Mul", ["mean", "zero"], ["nothing"]),
        helper.make_node("Add", ["boxes", "nothing"], ["output0"]),
    ]
    if where == "initializer":
        values.append(boxes)
    elif where == "node":
        nodes.insert(0, helper.make_node("Constant", [], ["boxes"], value=boxes))
    else:
        inner = helper.make_graph([helper.make_node("Constant", [], ["boxes"], value=boxes)], "inner", [], [])
        nodes.insert(0, helper.make_node("If", ["images"], ["boxes"], then_branch=inner, else_branch=inner))
    graph = helper.make_graph(nodes, "tiny", [given], [out], values)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    helper.set_model_props(model, {"names": "{0: 'car'}"})
    path.write_bytes(model.SerializeToString())
    return path


@pytest.mark.parametrize("where", ["initializer", "node", "subgraph"])
@pytest.mark.parametrize("location", ["../secret.bin", "/etc/hostname", "a/../../secret.bin", "link.bin"])
def test_what_lies_outside_the_folder_is_not_read(tmp_path, where, location):
    folder = tmp_path / "net"
    folder.mkdir()
    (tmp_path / "secret.bin").write_bytes(ROWS.tobytes())
    (folder / "link.bin").symlink_to(tmp_path / "secret.bin")
    path = network(folder / "net.onnx", location, where)
    with pytest.raises(DataError, match=r"net\.onnx: has numbers in .*, outside its own folder"):
        read_onnx_head(path)


@pytest.mark.parametrize("backend", ["opencv", "onnxruntime"])
@pytest.mark.parametrize("kind", ["pipe", "folder", "nothing", "address in memory"])
def test_what_is_no_file_is_refused_at_once(tmp_path, backend, kind):
    place = "*/_ORT_MEM_ADDR_/*" if kind == "address in memory" else "numbers"
    if kind == "pipe":
        os.mkfifo(tmp_path / "numbers")
    elif kind == "folder":
        (tmp_path / "numbers").mkdir()
    path = network(tmp_path / "net.onnx", place)
    with pytest.raises(DataError, match=r"has numbers in .*, which is no file beside it"):
        ModelPictureDetector(path, settings=ModelSettings(backend=backend))


def test_numbers_beside_the_network_are_read(tmp_path):
    pytest.importorskip("onnxruntime", reason="pip install onnxruntime")
    (tmp_path / "numbers.bin").write_bytes(ROWS.tobytes())
    path = network(tmp_path / "net.onnx", "numbers.bin")
    scan = ModelPictureDetector(path, settings=ModelSettings(backend="onnxruntime"))(PICTURE, 0.0)
    np.testing.assert_allclose(scan.boxes, [[16, 24, 64, 32]], atol=0.01)
