"""New networks: with random weights, or with those of networks that were trained before.

A network in an ONNX file has its normalisations multiplied into its convolutions. The layers come in the
order in which the network uses them, so they are put back one after the other: the convolution as it is in
the file, and a normalisation that only adds.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.detection.models.onnx_head import CARD, read_onnx_head
from jeat_graph_sehn.training.fused_network import FusedNet, GatedSum, silence
from jeat_graph_sehn.training.lasting import Lasting
from jeat_graph_sehn.training.network import DetectionNet, VehicleNet
from jeat_graph_sehn.training.settings import COARSEST, EVENTS, FRAMES, FUSED, NetSettings
from jeat_graph_sehn.training.widening import widen

#: The card's word for a second look.
SECOND_LOOK = "second_look"
#: The card's word for the time constants of its states' channels (s): the file has no weights of them.
LASTS_S = "lasts_s"
_NOT_OURS = "is no network that `train` made"
_SIDE = (COARSEST, COARSEST)
_SPREAD = "spread."
_TINY = 1e-12


class _Layer(NamedTuple):
    """A convolution as a file has it."""

    weight: Tensor
    bias: Tensor | None


def new_network(settings: NetSettings, start: Sequence[Path] = ()) -> VehicleNet:
    """Make a network.

    Args:
        settings: what it looks like.
        start: networks that `train` made, as wide as this one or a whole part of it; of both sensors one of
            each kind may be given, or one of both, or that and one of a sensor, from which its part is then
            taken.

    Raises:
        DataError: a file that `train` did not make, or of a network that looks otherwise.
    """
    net = _of_kind(settings)
    given: dict[str, VehicleNet] = {}
    for path in start:
        found = read_network(path)
        kind = found.settings.kind
        if not _fits(found.settings, settings) or kind in given:
            raise DataError(_unfit(found.settings, settings), path)
        given[kind] = _as_wide(found, settings.width)
    if settings.kind in given:
        _take(net, given[settings.kind])
    if isinstance(net, FusedNet):
        _take_parts(net, given)
    return net


def settings_of(path: Path) -> NetSettings:
    """Return what a network looks like, as its card says.

    Raises:
        DataError: not a file that `train` made.
    """
    try:
        # A card that does not mention spreads is of a network without.
        return NetSettings(**{"spreads": False, **card_of(path)["net"]})
    except (KeyError, TypeError, ValueError, ConfigError):
        raise DataError(_NOT_OURS, path) from None


def card_of(path: Path) -> dict[str, Any]:
    """Return what `train` has written into a file.

    Raises:
        DataError: not a file that `train` made.
    """
    try:
        return dict(json.loads(read_onnx_head(path).notes[CARD]))
    except (KeyError, TypeError, ValueError):
        raise DataError(_NOT_OURS, path) from None


def looks_twice(path: Path) -> bool:
    """Return whether a file that `train` made takes a second look at half the size.

    Raises:
        DataError: not a file that `train` made.
    """
    return bool(card_of(path).get(SECOND_LOOK, False))


def read_network(path: Path) -> VehicleNet:
    """Read a network that `train` wrote; it says what the file says, but for rounding.

    Raises:
        ConfigError: the package `onnx` is not installed.
        DataError: not a file that `train` made.
    """
    settings = settings_of(path)
    net = _of_kind(settings)
    calls = _calls(net)
    layers = list(_layers(path))
    if looks_twice(path):
        layers = layers[: len(layers) // 2]  # the other half are the same, looking again
    if len(layers) != len(calls):
        raise DataError(f"has {len(layers)} convolutions, and its card says {len(calls)}", path)
    first: dict[int, Tensor] = {}
    with torch.no_grad():
        for layer, (convolution, norm) in zip(layers, calls, strict=True):
            if layer.weight.shape != convolution.weight.shape:
                raise DataError("is not laid out as `train` writes networks", path)
            whole = first.setdefault(id(convolution), layer.weight)
            convolution.weight.copy_(whole)
            if norm is None:
                if layer.bias is not None and convolution.bias is not None:
                    convolution.bias.copy_(layer.bias)
                continue
            # One convolution may stand before several normalisations, each with a scale of its own.
            power = (whole * whole).sum(dim=(1, 2, 3)).clamp(min=_TINY)
            norm.weight.copy_((whole * layer.weight).sum(dim=(1, 2, 3)) / power)
            assert norm.running_mean is not None
            assert norm.running_var is not None
            norm.running_mean.zero_()
            norm.running_var.fill_(1.0 - norm.eps)
            if layer.bias is not None:
                norm.bias.copy_(layer.bias)
        _read_availability(path, net)
        _read_lasting(path, net)
    return net


def _of_kind(settings: NetSettings) -> VehicleNet:
    return FusedNet(settings) if settings.kind == FUSED else DetectionNet(settings)


def _as_wide(net: VehicleNet, width: int) -> VehicleNet:
    """Return a network that says the same and has a whole multiple of channels."""
    if net.settings.width == width:
        return net
    wide = _of_kind(replace(net.settings, width=width))
    widen(net, wide)
    return wide


def _take(net: nn.Module, given: nn.Module) -> None:
    """Take all weights of a network. One whose memory goes by windows has none for going by time.

    Nor have those of before for spreads; where spreads are not wanted, theirs are left.
    """
    lacking = net.load_state_dict(given.state_dict(), strict=False)
    new = ("lasting.", "traces.", _SPREAD)
    left = [name for name in lacking.unexpected_keys if _SPREAD not in name]
    if left or not all(any(f in name for f in new) for name in lacking.missing_keys):
        raise ValueError(f"weights do not fit: {lacking}")  # _fits() lets none through


def _take_parts(net: FusedNet, given: dict[str, VehicleNet]) -> None:
    """Take backbones from networks of one sensor, and the head from that of pictures if there is one."""
    frames, events = (given.get(kind) for kind in (FRAMES, EVENTS))
    if isinstance(events, DetectionNet):
        _take(net.events, events.backbone)
    if isinstance(frames, DetectionNet):
        net.pictures.load_state_dict(frames.backbone.state_dict())
    begins = FUSED not in given
    head = frames or (events if begins else None)
    if isinstance(head, DetectionNet):
        _take(net.head, head.head)
    if begins and frames is not None:
        for join in net.join:
            assert isinstance(join, GatedSum)
            # It begins as good as the pictures are; what events add is learned.
            silence(join.carry)


def _fits(found: NetSettings, wanted: NetSettings) -> bool:
    kinds = (FRAMES, EVENTS, FUSED) if wanted.kind == FUSED else (wanted.kind,)
    same = wanted.width % found.width == 0 and (found.kind == FRAMES or found.bins == wanted.bins)
    return found.kind in kinds and same and (wanted.by_time or not found.by_time)


def _unfit(found: NetSettings, wanted: NetSettings) -> str:
    if found.by_time and not wanted.by_time:
        return "has a memory that goes by time; train with --set net.memory=time"
    return (
        f"is of {found.kind} with {found.width} channels and {found.bins} bins; to train is one of "
        f"{wanted.kind} with {wanted.width} and {wanted.bins}: its start has as many channels, a half or "
        "another whole part, and is one file of each kind"
    )


def _calls(net: VehicleNet) -> list[tuple[nn.Conv2d, nn.BatchNorm2d | None]]:
    """Return the convolutions in the order of their use, each with the normalisation behind it."""
    found: list[tuple[nn.Conv2d, nn.BatchNorm2d | None]] = []

    def note(module: nn.Module, _: object, __: object) -> None:
        if isinstance(module, nn.Conv2d):
            found.append((module, None))
        elif isinstance(module, nn.BatchNorm2d):
            found[-1] = (found[-1][0], module)

    hooks = [
        m.register_forward_hook(note) for m in net.modules() if isinstance(m, nn.Conv2d | nn.BatchNorm2d)
    ]
    with torch.no_grad():
        net.eval().serve([*net.inputs(_SIDE).values(), *net.empty_state(1, _SIDE)])
    for hook in hooks:
        hook.remove()
    return found


def _layers(path: Path) -> Iterator[_Layer]:
    """Yield the convolutions of a file in the order of their use."""
    graph, values = _graph(path)
    for node in graph.node:
        if node.op_type == "Conv":
            tensors = [values.get(name) for name in node.input[1:]]
            if any(one is None for one in tensors):
                raise DataError("is not laid out as `train` writes networks", path)
            weight, bias = tensors[0], tensors[1] if len(tensors) > 1 else None
            assert weight is not None
            yield _Layer(weight, bias)


def _read_availability(path: Path, net: VehicleNet) -> None:
    """Read the layers of a network of both sensors that are no convolutions."""
    if not isinstance(net, FusedNet):
        return
    graph, values = _graph(path)
    products = [node for node in graph.node if node.op_type in ("MatMul", "Gemm")]
    for join, node in zip(net.join, products[: len(net.join)], strict=True):
        assert isinstance(join, GatedSum)
        weight = values[node.input[1]]
        own = join.availability.weight
        own.copy_(weight.reshape(own.shape) if node.op_type == "Gemm" else weight.T)


def lasting_of(net: VehicleNet) -> list[list[float]]:
    """Return the time constants (s) of the channels of each state that lasts by time."""
    found = [layer.log_hz for layer in net.modules() if isinstance(layer, Lasting)]
    return [torch.exp(-one.detach().double()).tolist() for one in found]


def _read_lasting(path: Path, net: VehicleNet) -> None:
    layers = [layer for layer in net.modules() if isinstance(layer, Lasting)]
    try:
        for layer, times_s in zip(layers, card_of(path)[LASTS_S] if layers else [], strict=True):
            layer.log_hz.copy_(-torch.log(torch.tensor(times_s, dtype=torch.float64)))
    except (KeyError, TypeError, ValueError, RuntimeError):
        raise DataError(_NOT_OURS, path) from None


def _graph(path: Path) -> tuple[Any, dict[str, Tensor]]:
    """Return a file's graph and its tensors by name, those that are cast before their use too."""
    try:
        import onnx
        from onnx import numpy_helper
    except ImportError:
        raise ConfigError("reading weights needs pip install './sehn[train]' in a checkout") from None
    graph = onnx.load(str(path)).graph
    values = {one.name: torch.from_numpy(numpy_helper.to_array(one).copy()) for one in graph.initializer}
    values = {name: one.float() if one.is_floating_point() else one for name, one in values.items()}
    for node in graph.node:
        if node.op_type in ("Cast", "Identity") and node.input[0] in values:
            values[node.output[0]] = values[node.input[0]]
    return graph, values
