"""The trained network as an ONNX file, in a layout that `detect` and `track` recognise, with its card inside.

Output `boxes` (1, 5, N): middle and size in px of the input, and a score; output `spreads` (1, 4, N), of a
network that has them: standard deviations of left, top, right and bottom in px of the input. Input
`picture` (1, 3, H, W), red first, 0 to 1; or `events` (1, 2 x bins, H, W) counts and one state a level of the
memory, which come back as outputs of the same shapes. One whose memory goes by time also takes `elapsed`
(1, 1): how much has passed since the window before (s), or what the first window spans. A network of both
sensors takes `events`, `picture` and `given` (1, 3): whether there is a picture (1 or 0), how old it is (s),
and whether there are events (1 or 0).
"""

from __future__ import annotations

import io
import json
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch

from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.models.onnx_head import CARD
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph_sehn.training.making import LASTS_S, SECOND_LOOK, lasting_of
from jeat_graph_sehn.training.network import VehicleNet
from jeat_graph_sehn.training.serving import ServedNet

_OPSET = 17
#: Smaller tensors are not worth a cast.
_LEAST_HALVED = 64
#: From here on the hyperbolic tangent is ±1 in single precision.
_TANH_IS_ONE = 16.0
_CLASS = "vehicle"
#: Name of the note in which detectors have their classes.
NAMES = "names"


def write_onnx(
    net: VehicleNet, side: tuple[int, int], card: Mapping[str, Any], path: Path, *, second_look: bool = False
) -> None:
    """Write a network with its card.

    Args:
        net: trained.
        side: width and height of its input (px), whole multiples of 16; of 32 with a second look.
        card: what is to be known of it: data, settings, how good it is.
        path: the file.
        second_look: whether it looks at half the size, too (`serving`).

    Raises:
        ConfigError: the package `onnx` is not installed.
    """
    try:
        import onnx
    except ImportError:
        raise ConfigError("writing ONNX needs pip install './sehn[train]' in a checkout") from None
    served = ServedNet(net, side, second_look).to("cpu").eval()
    inputs, state = net.to("cpu").inputs(side), served.empty_state()
    states = range(len(state))
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # This exporter needs nothing but PyTorch; the newer one, which it announces, needs more packages.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            served,
            (*inputs.values(), *state),
            cast(Any, buffer),  # takes open files, too
            dynamo=False,
            opset_version=_OPSET,
            input_names=[*inputs, *(f"state_{k}" for k in states)],
            output_names=served.outputs,
        )
    model = onnx.load_from_string(buffer.getvalue())
    share_weights(model)
    spread_summands(model)
    bound_tanh(model)
    halve_weights(model)
    if second_look:
        card = {**card, SECOND_LOOK: True}
    if lasts := lasting_of(net):
        card = {**card, LASTS_S: lasts}
    onnx.helper.set_model_props(model, {NAMES: str({0: _CLASS}), CARD: json.dumps(card, sort_keys=True)})
    with atomic_path(path) as temporary:
        temporary.write_bytes(model.SerializeToString(deterministic=True))


def share_weights(model: Any) -> None:
    """Keep equal weights once, and none that nobody takes: a second look takes those of the first."""
    graph, kept, same = model.graph, dict[bytes, Any](), dict[str, str]()
    for tensor in graph.initializer:
        name = tensor.name
        tensor.name = ""
        first = kept.setdefault(tensor.SerializeToString(deterministic=True), tensor)
        tensor.name = name
        same[name] = first.name
    for node in graph.node:
        for k, name in enumerate(node.input):
            node.input[k] = same.get(name, name)
    taken = {name for node in graph.node for name in node.input}
    used = [tensor for tensor in graph.initializer if tensor.name in taken]
    del graph.initializer[:]
    graph.initializer.extend(used)


def spread_summands(model: Any) -> None:
    """Bring what is added to a convolution's output to its shape, where it has fewer cells.

    OpenCV 5 joins a convolution and a sum behind it into one layer, which cannot repeat the other summand.

    Args:
        model: as ONNX has it, its inputs of fixed shapes; changed.
    """
    from onnx import helper, numpy_helper, shape_inference

    inferred = shape_inference.infer_shapes(model, data_prop=True).graph
    shapes = {
        value.name: [one.dim_value for one in value.type.tensor_type.shape.dim]
        for value in (*inferred.input, *inferred.value_info, *inferred.output)
    }
    graph, nodes = model.graph, []
    convolved = {node.output[0] for node in graph.node if node.op_type == "Conv"}
    for node in graph.node:
        if node.op_type == "Add" and len(convolved.intersection(node.input)) == 1:
            at = int(node.input[0] in convolved)
            whole, part = shapes.get(node.input[1 - at], []), shapes.get(node.input[at], [])
            if any(few == 1 < many for few, many in zip(part, whole, strict=False)):
                shape, spread = f"{node.output[0]}_shape", f"{node.output[0]}_spread"
                graph.initializer.append(numpy_helper.from_array(np.array(whole, dtype=np.int64), shape))
                nodes.append(helper.make_node("Expand", [node.input[at], shape], [spread]))
                node.input[at] = spread
        nodes.append(node)
    del graph.node[:]
    graph.node.extend(nodes)


def bound_tanh(model: Any) -> None:
    """Clip what goes into a hyperbolic tangent to where it changes: OpenCV 5 gives NaN for more than 44.

    Args:
        model: as ONNX has it; changed. Its outputs stay as they are.
    """
    from onnx import helper, numpy_helper

    graph, nodes = model.graph, []
    bounds = {"tanh_low": -_TANH_IS_ONE, "tanh_high": _TANH_IS_ONE}
    for node in graph.node:
        if node.op_type == "Tanh":
            clipped = f"{node.output[0]}_clipped"
            nodes.append(helper.make_node("Clip", [node.input[0], *bounds], [clipped]))
            node.input[0] = clipped
        nodes.append(node)
    if len(nodes) > len(graph.node):
        graph.initializer.extend(
            numpy_helper.from_array(np.array(value, dtype=np.float32), name) for name, value in bounds.items()
        )
    del graph.node[:]
    graph.node.extend(nodes)


def halve_weights(model: Any, *, only_exact: bool = False) -> None:
    """Store weights in half precision, each with a cast before its first use: half the file.

    Whoever runs the network casts them once, when it is loaded; it calculates in single precision.

    Args:
        model: as ONNX has it; changed.
        only_exact: leave those as they are that half precision would change.
    """
    from onnx import TensorProto, helper, numpy_helper

    graph, kept, casts = model.graph, [], []
    for tensor in graph.initializer:
        if tensor.data_type != TensorProto.FLOAT or np.prod(tensor.dims) < _LEAST_HALVED:
            kept.append(tensor)
            continue
        values = numpy_helper.to_array(tensor)
        halved = values.astype(np.float16)
        if only_exact and not np.array_equal(halved.astype(np.float32), values):
            kept.append(tensor)
            continue
        name = f"{tensor.name}_half"
        kept.append(numpy_helper.from_array(halved, name))
        casts.append(helper.make_node("Cast", [name], [tensor.name], to=TensorProto.FLOAT))
    nodes = list(graph.node)
    del graph.initializer[:], graph.node[:]
    graph.initializer.extend(kept)
    graph.node.extend([*casts, *nodes])
