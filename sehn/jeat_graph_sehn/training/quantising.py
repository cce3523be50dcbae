"""Brings a trained network to whole numbers of 8 bits, which takes half of the time.

Weights and features of all layers become 8-bit numbers with a scale each, by the extremes that the layers
show on some data; the last layers, which say where a box is to a fraction of a pixel, stay as they are. What
comes out is for ONNX Runtime on processors with instructions for it (VNNI, from 2019 on; ARM from 2018 on).
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.events import EventArray
from jeat_graph.detection.models.event_places import EventPlaces, event_scale
from jeat_graph.detection.models.feeding import place, usual_feed
from jeat_graph.detection.models.layouts.record import SPREADS
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.onnx_head import CARD, OnnxHead, read_onnx_head
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph_sehn.training.data_sets import EventSegment, Picture
from jeat_graph_sehn.training.event_samples import windows_of
from jeat_graph_sehn.training.export import halve_weights, share_weights
from jeat_graph_sehn.training.judging import LAYOUT
from jeat_graph_sehn.training.lasting import ELAPSED_INPUT
from jeat_graph_sehn.training.making import settings_of
from jeat_graph_sehn.training.network import EVENTS_INPUT, PICTURE_INPUT
from jeat_graph_sehn.training.serving import BOXES
from jeat_graph_sehn.training.settings import EVENTS, FUSED, NetSettings

#: At most so many pictures, or windows of events, are looked at: extremes settle soon.
MOST_LOOKS = 64
#: Of a recording, so many windows are run, and each so many-th is looked at, so that the memory is full.
_WINDOWS, _EACH = 12, 4
#: What becomes 8-bit numbers. The last convolutions and what is behind them are no part of it.
_LAYERS = ["Conv", "Relu", "Add", "Concat", "Resize"]
#: In the names of the layers that add up the counts of cells, and those of 2 x 2 pixels for a second look.
_SUMS, _HALVES = "/sums/", "/halves/"
_US = 1e6
_Feed = dict[str, npt.NDArray[Any]]


def write_int8(source: Path, members: Sequence[Picture | EventSegment], about: object, out: Path) -> int:
    """Write a network with 8-bit numbers.

    Args:
        source: a network of pictures or of events that `train` made.
        members: what it looks at, evenly chosen: of the kind that it will see.
        about: of the data, for its card.
        out: the file.

    Returns:
        How many pictures or windows it has looked at.

    Raises:
        ConfigError: `onnx` or `onnxruntime` are not installed, or the network is of both sensors.
        DataError: no file that `train` made, or data that cannot be read.
    """
    try:
        import onnx
        from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static
        from onnxruntime.quantization.shape_inference import quant_pre_process
    except ImportError:
        raise ConfigError("--int8 needs pip install onnx onnxruntime") from None
    settings = settings_of(source)
    if settings.kind == FUSED:
        raise ConfigError("--int8 is for networks of one sensor")
    head = read_onnx_head(source)
    model = onnx.load(str(source))
    _widen(model)
    looks = 0

    class Reader(CalibrationDataReader):  # type: ignore[misc]
        """Gives one input after the other."""

        def __init__(self, feeds: Iterator[_Feed]) -> None:
            self._feeds = feeds

        def get_next(self) -> _Feed | None:
            nonlocal looks
            feed = next(self._feeds, None)
            looks += feed is not None
            return feed

    with tempfile.TemporaryDirectory() as folder:
        wide, whole, small = (Path(folder) / f"{name}.onnx" for name in ("wide", "whole", "small"))
        onnx.save(model, str(wide))
        quant_pre_process(str(wide), str(whole), skip_symbolic_shape=True)
        model = onnx.load(str(whole))
        quantize_static(
            str(whole),
            str(small),
            Reader(_feeds(whole, head, settings, members)),
            quant_format=QuantFormat.QDQ,
            op_types_to_quantize=_LAYERS,
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            nodes_to_exclude=[*_behind_rows(model), *(_of_states(model) if settings.by_time else ())],
            extra_options=_counts_as_they_are(model) if settings.kind == EVENTS else {},
        )
        model = onnx.load(str(small))
    if settings.by_time:
        _sum_unrounded(model)
    if settings.kind == EVENTS:
        _take_counts(model)
    share_weights(model)
    halve_weights(model, only_exact=True)  # the places of cells
    card = json.loads(head.notes[CARD])
    note = "judged and tested are of the network before it was brought to 8 bits"
    card["int8"] = {"data": about, "looks": looks, "note": note}
    del model.metadata_props[:]
    onnx.helper.set_model_props(model, {**head.notes, CARD: json.dumps(card, sort_keys=True)})
    with atomic_path(out) as temporary:
        temporary.write_bytes(model.SerializeToString(deterministic=True))
    return looks


def _feeds(
    network: Path, head: OnnxHead, settings: NetSettings, members: Sequence[Picture | EventSegment]
) -> Iterator[_Feed]:
    """Yield what the network is shown."""
    shape = head.inputs[0].shape
    side = (shape[3] or 0, shape[2] or 0)
    if settings.kind == EVENTS:
        recordings = [m for m in members if isinstance(m, EventSegment)]
        for recording in _evenly(recordings, MOST_LOOKS * _EACH // _WINDOWS):
            yield from _windows(network, head, settings, recording, side)
        return
    feed = usual_feed(LAYOUT, ModelSettings())
    for picture in _evenly([m for m in members if isinstance(m, Picture)], MOST_LOOKS):
        yield {PICTURE_INPUT: place(picture.load(), side, feed)[0]}


def _windows(
    network: Path, head: OnnxHead, settings: NetSettings, recording: EventSegment, side: tuple[int, int]
) -> Iterator[_Feed]:
    """Yield windows that follow one another, with the memory of those before."""
    import onnxruntime

    session = onnxruntime.InferenceSession(str(network), providers=["CPUExecutionProvider"])
    names = [port.name for port in session.get_outputs()]
    later = [name for name in names if name not in (BOXES, SPREADS)]
    beside = [ELAPSED_INPUT] if settings.by_time else []
    states = [port for port in head.inputs[1:] if port.name not in beside]
    state = {p.name: np.zeros([s or 1 for s in p.shape], dtype=np.float32) for p in states}
    length_us = settings.bins * round(settings.bin_s * _US)
    with recording.open() as file:
        first_us = int(recording.truth.times[0] * _US) // length_us * length_us
        events = file.between(first_us, first_us + _WINDOWS * length_us)
        size_px = file.size_px or side
    places = EventPlaces(size_px, event_scale(size_px, side))
    own = places.moved(EventArray.trusted(events.t_us - first_us, events.x, events.y, events.polarity))
    ends = [(k + 1) * length_us for k in range(_WINDOWS)]
    for k, window in enumerate(windows_of(own, side, settings, ends)):
        passed = {name: np.full((1, 1), length_us / _US, dtype=np.float32) for name in beside}
        feed = {EVENTS_INPUT: window[None].astype(np.float32), **passed, **state}
        found = dict(zip(names, session.run(names, feed), strict=True))
        state = {one: found[name] for one, name in zip(state, later, strict=True)}
        if k % _EACH == _EACH - 1:
            yield feed


def _evenly(members: Sequence[Any], most: int) -> list[Any]:
    if not members:
        raise DataError("nothing to look at in the data: --int8 needs some of what the network is for")
    chosen = np.unique(np.linspace(0, len(members) - 1, min(most, len(members))).round().astype(int))
    return [members[k] for k in chosen.tolist()]


def _widen(model: Any) -> None:
    """Store weights in single precision again, without the casts before their first use."""
    from onnx import numpy_helper

    graph = model.graph
    halved = {one.name: one for one in graph.initializer}
    nodes, made = [], []
    for node in graph.node:
        if node.op_type == "Cast" and node.input[0] in halved:
            values = numpy_helper.to_array(halved[node.input[0]]).astype(np.float32)
            made.append(numpy_helper.from_array(values, node.output[0]))
        else:
            nodes.append(node)
    used = {name for node in nodes for name in node.input}
    kept = [one for one in graph.initializer if one.name in used]
    del graph.node[:], graph.initializer[:]
    graph.node.extend(nodes)
    graph.initializer.extend([*kept, *made])


def _behind_rows(model: Any) -> list[str]:
    """Return the names of the convolutions that no other comes after, and of all that comes after them."""
    nodes = list(model.graph.node)
    before_another = set[str]()
    for node in reversed(nodes):
        if node.op_type == "Conv" or any(one in before_another for one in node.output):
            before_another.update(node.input)
    names, tensors = [], set[str]()
    for node in nodes:
        last = node.op_type == "Conv" and not any(one in before_another for one in node.output)
        if last or any(one in tensors for one in node.input):
            names.append(node.name)
            tensors.update(node.output)
    return names


def _of_states(model: Any) -> list[str]:
    """Return the names of the sums that states come of, and of those that say what is noise.

    Rounded to 8 bits they would never be forgotten: what a number loses at a window is below half a step. And
    noise is far less than what the nearest vehicle makes.
    """
    scopes = ("backbone", "traces", "memory")
    sums = [node.name for node in model.graph.node if node.op_type in ("Add", "Concat")]
    return [name for name in sums if name.split("/")[-2].startswith(scopes)]


def _sum_unrounded(model: Any) -> None:
    """Let states be given, and summed, as they are: not as the layers beside their sums have rounded them."""
    graph = model.graph
    made = {name: node for node in graph.node for name in node.output}

    def whole(name: str) -> str | None:
        """Return what a rounded number was before; None of what is none, or comes of a layer of 8 bits."""
        back = made.get(name)
        if back is None or back.op_type != "DequantizeLinear" or back.input[0] not in made:
            return None
        before = str(made[back.input[0]].input[0])
        return before if before in made and before not in layers else None

    sums = set(_of_states(model))
    layers = {n.output[0] for n in graph.node if n.op_type in _LAYERS and n.name not in sums}
    for node in graph.node:
        if node.name in sums:
            node.input[:] = [whole(name) or name for name in node.input]
    renamed = dict[str, str]()
    for port in graph.output:
        if before := whole(port.name):
            renamed |= {before: port.name, port.name: f"{port.name}_rounded"}
    for node in graph.node:
        node.input[:] = [renamed.get(name, name) for name in node.input]
        node.output[:] = [renamed.get(name, name) for name in node.output]


def _cut_offs(model: Any) -> list[Any]:
    """Return the layers that cut off high counts, that of the first look first."""
    from_counts, found = {EVENTS_INPUT}, []
    for node in model.graph.node:
        adds = node.op_type != "Conv" or _HALVES in node.name
        if adds and node.input and node.input[0] in from_counts:
            from_counts.update(node.output)
            if node.op_type == "Clip":
                found.append(node)
    return found


def _counts_as_they_are(model: Any) -> dict[str, Any]:
    """Ask for counts, and their sums of a cell, as 8-bit numbers of scale 1: they are whole, and few.

    At most 8 events of each of 16 pixels make 128. Sums for a second look may be more than 255, and are 255
    then: they are cut off at 8 next.
    """
    unscaled = {"scale": np.array(1.0, dtype=np.float32), "zero_point": np.array(0, dtype=np.uint8)}
    sums = [n for n in model.graph.node if n.op_type == "Conv" and (_SUMS in n.name or _HALVES in n.name)]
    whole = [EVENTS_INPUT, *(node.output[0] for node in (*_cut_offs(model), *sums))]
    return {"TensorQuantOverrides": {name: [dict(unscaled)] for name in whole}}


def _take_counts(model: Any) -> None:
    """Let the network take counts of events as they are, bytes, and cut them off as bytes."""
    from onnx import TensorProto, numpy_helper

    graph, limits = model.graph, _cut_offs(model)
    made = {name: node for node in graph.node for name in node.output}
    most = next(numpy_helper.to_array(one) for one in graph.initializer if one.name == limits[0].input[2])
    graph.initializer.append(numpy_helper.from_array(most.astype(np.uint8), "most_count"))
    for limit in limits:
        limit.input[2] = "most_count"
        if limit.input[0] in made:  # of a second look: the sums of the counts
            limit.input[0] = made[limit.input[0]].input[0]
        _unrounded(graph, limit.output[0])
    _unrounded(graph, EVENTS_INPUT)
    del graph.value_info[:]
    graph.input[0].type.tensor_type.elem_type = TensorProto.UINT8


def _unrounded(graph: Any, name: str) -> None:
    """Let what is made of bytes take them, which were single precision, as they are, if anything does."""
    rounded = [n for n in graph.node if n.op_type == "QuantizeLinear" and n.input[0] == name]
    taken = {node.output[0]: name for node in rounded}
    for node in graph.node:
        node.input[:] = [taken.get(one, one) for one in node.input]
    for node in rounded:
        graph.node.remove(node)
