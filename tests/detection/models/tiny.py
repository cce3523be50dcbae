"""Tiny ONNX files: their answers are fixed, whatever they are shown, and may count windows."""

from __future__ import annotations

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper


def constant_net(path, outputs, side, channels=3, notes=None, batch=1):
    """A network whose outputs are arrays by name; they hang on the input by a factor of 0."""
    width, height = side
    nodes = [
        helper.make_node("ReduceMean", ["images"], ["mean"], keepdims=1, axes=[1, 2, 3]),
        helper.make_node("Mul", ["mean", "zero"], ["nothing4"]),
        helper.make_node("Reshape", ["nothing4", "one_side"], ["nothing"]),
    ]
    values = [
        numpy_helper.from_array(np.zeros((1, 1, 1, 1), np.float32), "zero"),
        numpy_helper.from_array(np.array([1], np.int64), "one_side"),
    ]
    ports = []
    for name, array in outputs.items():
        values.append(numpy_helper.from_array(array.astype(np.float32), f"{name}_value"))
        nodes.append(helper.make_node("Add", [f"{name}_value", "nothing"], [name]))
        ports.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, list(array.shape)))
    given = helper.make_tensor_value_info("images", TensorProto.FLOAT, [batch, channels, height, width])
    return _save(path, helper.make_graph(nodes, "tiny", [given], ports, values), notes)


def counting_net(path, side, channels, rows, per_event=0.0, seen=slice(None), notes=None):
    """A network with a state: each window, and each event seen, adds 8 px to the left of its boxes (K, 6)."""
    width, height = side
    shift = np.zeros((1, *rows.shape), np.float32)
    shift[..., [0, 2]] = 8.0
    weights = np.zeros((1, channels, 1, 1), np.float32)
    weights[:, seen] = 1.0
    nodes = [
        helper.make_node("Mul", ["events", "weights"], ["looked_at"]),
        helper.make_node("ReduceMean", ["looked_at"], ["mean"], keepdims=1, axes=[1, 2, 3]),
        helper.make_node("Mul", ["mean", "zero"], ["nothing4"]),
        helper.make_node("Add", ["state", "one"], ["counted"]),
        helper.make_node("Add", ["counted", "nothing4"], ["state_next"]),
        helper.make_node("Reshape", ["state_next", "one_side"], ["count"]),
        helper.make_node("Mul", ["count", "shift"], ["moved"]),
        helper.make_node("Add", ["rows", "moved"], ["found"]),
    ]
    values = [
        numpy_helper.from_array(
            np.full((1, 1, 1, 1), per_event * channels * width * height, np.float32), "zero"
        ),
        numpy_helper.from_array(weights, "weights"),
        numpy_helper.from_array(np.ones((1, 1, 1, 1), np.float32), "one"),
        numpy_helper.from_array(np.array([1, 1, 1], np.int64), "one_side"),
        numpy_helper.from_array(shift, "shift"),
        numpy_helper.from_array(rows[None].astype(np.float32), "rows"),
    ]
    inputs = [
        helper.make_tensor_value_info("events", TensorProto.FLOAT, [1, channels, height, width]),
        helper.make_tensor_value_info("state", TensorProto.FLOAT, [1, 1, 1, 1]),
    ]
    outputs = [
        helper.make_tensor_value_info("found", TensorProto.FLOAT, [1, *rows.shape]),
        helper.make_tensor_value_info("state_next", TensorProto.FLOAT, [1, 1, 1, 1]),
    ]
    return _save(path, helper.make_graph(nodes, "counting", inputs, outputs, values), notes)


def telling_net(path, side, channels, rows, notes=None):
    """A network of both sensors that tells what it is given by where its boxes (K, 6) are.

    Boxes lie 8 px to the right with a picture, 16 px with events, and down by 100 px a second of age and by
    what the picture's mean is (px).
    """
    width, height = side
    told = np.zeros((3, 6), np.float32)
    told[0, [0, 2]], told[2, [0, 2]], told[1, [1, 3]] = 8.0, 16.0, 100.0
    down = np.zeros((1, 1, 6), np.float32)
    down[..., [1, 3]] = 1.0
    nodes = [
        helper.make_node("ReduceMean", ["events"], ["seen"], keepdims=1, axes=[1, 2, 3]),
        helper.make_node("Mul", ["seen", "zero"], ["nothing4"]),
        helper.make_node("ReduceMean", ["picture"], ["light4"], keepdims=1, axes=[1, 2, 3]),
        helper.make_node("Add", ["nothing4", "light4"], ["both4"]),
        helper.make_node("Reshape", ["both4", "one_side"], ["light"]),
        helper.make_node("Mul", ["light", "down"], ["lower"]),
        helper.make_node("MatMul", ["given", "told"], ["shift"]),
        helper.make_node("Add", ["rows", "shift"], ["moved"]),
        helper.make_node("Add", ["moved", "lower"], ["found"]),
    ]
    values = [
        numpy_helper.from_array(np.zeros((1, 1, 1, 1), np.float32), "zero"),
        numpy_helper.from_array(np.array([1, 1, 1], np.int64), "one_side"),
        numpy_helper.from_array(told, "told"),
        numpy_helper.from_array(down, "down"),
        numpy_helper.from_array(rows[None].astype(np.float32), "rows"),
    ]
    shapes = {"events": [1, channels, height, width], "picture": [1, 3, height, width], "given": [1, 3]}
    inputs = [helper.make_tensor_value_info(k, TensorProto.FLOAT, shape) for k, shape in shapes.items()]
    outputs = [helper.make_tensor_value_info("found", TensorProto.FLOAT, [1, *rows.shape])]
    return _save(path, helper.make_graph(nodes, "telling", inputs, outputs, values), notes)


def _save(path, graph, notes):
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    if notes:
        helper.set_model_props(model, notes)
    onnx.save(model, str(path))
    return path
