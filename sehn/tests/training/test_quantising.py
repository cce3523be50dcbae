"""A network of 8-bit numbers says nearly what the network said, and takes events as bytes."""

from __future__ import annotations

import json
from functools import cache, partial

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")
pytest.importorskip("onnxruntime", reason="the extra `onnxruntime` is not installed")
onnx = pytest.importorskip("onnx", reason="training needs onnx, the extra `train`")

from jeat_graph.cli.main import main  # noqa: E402
from jeat_graph.data.errors import DataError  # noqa: E402
from jeat_graph.detection.models.engine import open_engine  # noqa: E402
from jeat_graph.detection.models.onnx_head import read_onnx_head  # noqa: E402
from jeat_graph_sehn.training.export import write_onnx  # noqa: E402
from jeat_graph_sehn.training.network import DetectionNet  # noqa: E402
from jeat_graph_sehn.training.quantising import write_int8  # noqa: E402
from jeat_graph_sehn.training.resizing import resized  # noqa: E402
from jeat_graph_sehn.training.settings import NetSettings  # noqa: E402

SIDE = (64, 32)


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    """Write a network of a kind, once: tests read it only."""
    return cache(partial(written, tmp_path_factory.mktemp("networks")))


def written(folder, kind, twice=False):
    """A network that has seen something: its layers are not of one scale."""
    torch.manual_seed(4)
    settings = NetSettings(**settings_of_kind(kind))
    net = DetectionNet(settings)
    passed = (1, torch.tensor([0.02, 0.05])) if kind == "time" else ()
    state = net.empty_state(2, SIDE)
    for _ in range(3):
        _, state = net(torch.rand(2, settings.channels, SIDE[1], SIDE[0]), state, *passed)
        state = tuple(one.detach() for one in state)
    card = {"net": settings_of_kind(kind), "side": list(SIDE), "tested": {}}
    path = folder / f"{kind}-{twice}.onnx"
    write_onnx(net.eval(), SIDE, card, path, second_look=twice)
    return path


def settings_of_kind(kind):
    """Settings of a network; `time` is of events, with a memory that goes by time."""
    by_kind = {"kind": "events", "memory": "time"} if kind == "time" else {"kind": kind}
    return {"width": 6, "spreads": True, **by_kind}


@pytest.mark.parametrize("twice", [False, True])
@pytest.mark.parametrize("kind", ["frames", "events", "time"])
def test_it_says_nearly_what_the_network_said(kind, twice, network, small_set, tmp_path, capsys):
    source, out = network(kind, twice), tmp_path / "small.onnx"
    sensor = settings_of_kind(kind)["kind"]
    assert main(["train", sensor, str(small_set), "--int8", str(source), "--out", str(out)]) == 0
    assert "wrote" in capsys.readouterr().out
    heads = [read_onnx_head(path) for path in (source, out)]
    assert [port.name for port in heads[1].inputs] == [port.name for port in heads[0].inputs]
    assert heads[1].inputs[0].kind == ("uint8" if sensor == "events" else "float32")
    engines = [
        open_engine(path, head, "onnxruntime", 1) for path, head in zip((source, out), heads, strict=True)
    ]
    rng = np.random.default_rng(1)
    shape = heads[0].inputs[0].shape
    # Sparse counts, as of events, or light that changes slowly, as in pictures.
    shown = rng.poisson(0.1, shape) if sensor == "events" else rng.random(shape)
    states = {p.name: np.zeros(p.shape, dtype=np.float32) for p in heads[0].inputs[1:]}
    if "elapsed" in states:
        states["elapsed"] += 0.05
    whole, small = (
        engine.run({head.inputs[0].name: shown.astype(head.inputs[0].kind), **states})["boxes"]
        for engine, head in zip(engines, heads, strict=True)
    )
    # 8 bits a layer leave a few per cent of what a layer's features spread over.
    assert np.abs(whole[:, :4] - small[:, :4]).mean() < 0.1 * whole[:, :4].std()
    assert np.abs(whole[:, 4] - small[:, 4]).max() < 0.05
    # The last layers, two for each of three strides and look, stay as they are: boxes to fractions of px.
    graph = onnx.load(str(out)).graph
    scaled = {name for node in graph.node if node.op_type == "DequantizeLinear" for name in node.output}
    layers = [node for node in graph.node if node.op_type == "Conv"]
    assert sum(node.input[1] not in scaled for node in layers) == 2 * 3 * (1 + twice) < len(layers)
    assert all(node.input[1] not in scaled for node in layers[-1:])
    card = json.loads(heads[1].notes["card"])
    assert card["net"] == settings_of_kind(kind)
    assert card["int8"]["looks"] > 0
    assert card["int8"]["data"][0]["name"] == small_set.name


def test_what_lasts_and_what_is_counted_is_not_rounded(network, small_set, tmp_path):
    """Of a state in steps of 8 bits nothing would be lost at a window. Counts are at most 128 and fit."""
    out = tmp_path / "small.onnx"
    assert main(["train", "events", str(small_set), "--int8", str(network("time")), "--out", str(out)]) == 0
    graph = onnx.load(str(out)).graph
    values = {one.name: onnx.numpy_helper.to_array(one) for one in graph.initializer}
    made = {name: node for node in graph.node for name in node.output}
    (sums,) = (node for node in graph.node if node.op_type == "Conv" and "/sums/" in node.name)
    (rounded,) = (node for node in graph.node if sums.output[0] in node.input)
    assert rounded.op_type == "QuantizeLinear"
    assert (values[rounded.input[1]], values[rounded.input[2]]) == (1.0, 0)
    states = [port.name for port in graph.output if port.name not in ("boxes", "spreads")]
    assert len(states) == 3
    for name in states:
        assert made[name].op_type == "Add"
        assert "DequantizeLinear" not in [made[one].op_type for one in made[name].input]


@pytest.mark.parametrize("kind", ["frames", "events"])
def test_the_input_can_get_another_size(kind, network, small_set, tmp_path, capsys):
    source, out = network(kind), tmp_path / "small.onnx"
    command = ["train", kind, str(small_set), "--int8", str(source), "--out", str(out), "--size"]
    assert main([*command, "96x64"]) == 0
    head = read_onnx_head(out)
    assert head.inputs[0].shape[2:] == (64, 96)
    card = json.loads(head.notes["card"])
    assert (card["side"], card["judged_at"]) == ([96, 64], list(SIDE))
    assert main([*command, "90x64"]) == 2
    assert "--size: 90x64 must be whole multiples of 16 px" in capsys.readouterr().err


def test_a_second_look_is_refused_where_half_the_input_does_not_fit(network, small_set, tmp_path, capsys):
    """Said in one line, whether the size is asked for or is the network's own."""
    source, out = network("frames"), tmp_path / "small.onnx"
    command = ["train", "frames", str(small_set), "--int8", str(source), "--out", str(out)]
    sized = tmp_path / "sized.onnx"
    resized(source, (64, 48), sized)
    for more in (["--size", "64x48"], ["--int8", str(sized)]):
        assert main([*command, *more, "--set", "second_look=true"]) == 2
        assert "--size: 64x48 must be whole multiples of 32 px" in capsys.readouterr().err
    assert not out.exists()


def test_what_does_not_fit_is_refused(network, small_set, tmp_path, capsys):
    source, out = network("frames"), tmp_path / "small.onnx"
    assert main(["train", "events", str(small_set), "--int8", str(source), "--out", str(out)]) == 2
    assert "--int8: the network is of frames, not of events" in capsys.readouterr().err
    with pytest.raises(DataError, match="nothing to look at"):
        write_int8(source, [], [], out)
    assert not out.exists()
