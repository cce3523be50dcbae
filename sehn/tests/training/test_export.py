"""The ONNX file says what the network says, in both engines that run it, and is recognised without a word."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")

from jeat_graph.data.events import EventArray  # noqa: E402
from jeat_graph.detection.models.engine import open_engine  # noqa: E402
from jeat_graph.detection.models.events import ModelEventDetector  # noqa: E402
from jeat_graph.detection.models.model_settings import ModelSettings  # noqa: E402
from jeat_graph.detection.models.onnx_head import read_onnx_head  # noqa: E402
from jeat_graph.detection.models.pictures import ModelPictureDetector  # noqa: E402
from jeat_graph.detection.settings import EventSettings  # noqa: E402
from jeat_graph_sehn.training.export import bound_tanh, spread_summands, write_onnx  # noqa: E402
from jeat_graph_sehn.training.network import DetectionNet  # noqa: E402
from jeat_graph_sehn.training.serving import ServedNet  # noqa: E402
from jeat_graph_sehn.training.settings import NetSettings  # noqa: E402

SIDE = (64, 32)
ENGINES = ["opencv", "onnxruntime"]
#: Weights in half precision: each of some twenty layers adds at most 2^-11 of what it says.
RELATIVE, ABSOLUTE = 20 * 2.0**-11, 20 * 2.0**-11
#: What a memory is told beside windows.
PASSED = {"windows": [], "time": [torch.full((1, 1), 0.03)]}


@pytest.fixture(scope="module", params=["frames", "events", "frames twice", "events twice", "time twice"])
def pair(request, tmp_path_factory):
    """A network whose normalisations are not those of a fresh one, and its file."""
    torch.manual_seed(4)
    kind, twice = request.param.split()[0], request.param.endswith("twice")
    by_time = {"kind": "events", "memory": "time"}
    net = DetectionNet(NetSettings(width=6, **(by_time if kind == "time" else {"kind": kind})))
    passed = (1, torch.tensor([0.02, 0.05])) if kind == "time" else ()
    state = net.empty_state(2, SIDE)
    for _ in range(3):
        _, state = net(3.0 * torch.rand(2, net.settings.channels, SIDE[1], SIDE[0]), state, *passed)
        state = tuple(one.detach() for one in state)
    net.eval()
    path = tmp_path_factory.mktemp("onnx") / "net.onnx"
    write_onnx(net, SIDE, {"seed": 4}, path, second_look=twice)
    return ServedNet(net, SIDE, twice), path


@pytest.mark.parametrize("engine", ENGINES)
def test_both_engines_say_what_the_network_says(pair, engine):
    served, path = pair
    if engine == "onnxruntime":
        pytest.importorskip("onnxruntime", reason="the extra `onnxruntime` is not installed")
    head = read_onnx_head(path)
    run = open_engine(path, head, engine, 1)
    net, state = served.net, served.empty_state()
    generator = torch.Generator().manual_seed(5)
    for _ in range(3):  # the memory comes back and counts
        shown = 3.0 * torch.rand(1, net.settings.channels, SIDE[1], SIDE[0], generator=generator)
        given = [shown, *PASSED[net.settings.memory], *state]
        names = [port.name for port in head.inputs]
        found = run.run({name: value.numpy() for name, value in zip(names, given, strict=True)})
        with torch.no_grad():
            said = served(*given)
        state = said[len(said) - len(state) :]
        for port, value in zip(head.outputs, said, strict=True):
            np.testing.assert_allclose(found[port.name], value.numpy(), rtol=RELATIVE, atol=ABSOLUTE)


def test_the_memory_matters():
    torch.manual_seed(4)
    net = DetectionNet(NetSettings(kind="events", width=6)).eval()
    shown = torch.rand(1, 20, SIDE[1], SIDE[0])
    with torch.no_grad():
        first, state = net(shown, net.empty_state(1, SIDE))
        second, _ = net(shown, state)
    assert (first - second).abs().max() > 1e-4


@pytest.mark.parametrize("engine", ENGINES)
def test_the_file_is_recognised_and_runs(pair, engine):
    served, path = pair
    if engine == "onnxruntime":
        pytest.importorskip("onnxruntime", reason="the extra `onnxruntime` is not installed")
    settings = ModelSettings(backend=engine, score=0.0)
    rng = np.random.default_rng(0)
    if served.net.settings.kind == "frames":
        detector = ModelPictureDetector(path, settings=settings)
        scan = detector(rng.integers(0, 255, (SIDE[1], SIDE[0], 3)).astype(np.uint8), 1.0)
        assert "layout yolov8" in detector.description
    else:
        detector = ModelEventDetector(path, SIDE, times=EventSettings(rate_hz=50.0), settings=settings)
        t = np.sort(rng.integers(0, 100_000, 500))
        x, y = (rng.integers(0, side, 500).astype(np.uint16) for side in SIDE)
        scan = detector.push(EventArray(t, x, y, rng.integers(0, 2, 500).astype(np.uint8)))[0]
        assert (
            "layout yolov8, windows of 10 bins of 0.005 s by time in 64 x 32 px, "
            f"{len(served.empty_state())} states kept" in detector.description
        )
    assert "classes vehicle" in detector.description
    assert len(scan.boxes) > 0


def test_a_memory_by_time_is_told_how_much_has_passed(tmp_path, monkeypatch):
    """The window's length at first and after a leap of the clock, else the time since the window before."""
    write_onnx(
        DetectionNet(NetSettings(kind="events", width=2, memory="time")).eval(), SIDE, {}, tmp_path / "n.onnx"
    )
    detector = ModelEventDetector(tmp_path / "n.onnx", SIDE, times=EventSettings(rate_hz=50.0))
    told, run = [], detector._engine.run

    def noted(inputs):
        told.append(float(inputs["elapsed"][0, 0]))
        return run(inputs)

    monkeypatch.setattr(detector._engine, "run", noted)
    for begin_us in (0, 100_000_000):
        t = begin_us + np.arange(0, 106_000, 500)
        ones = np.ones(len(t), dtype=np.uint16)
        detector.push(EventArray(t, ones, ones, ones.astype(np.uint8)))
    assert told == pytest.approx([0.05, 0.02, 0.02] * 2, abs=1e-6)


def summed(summand_shape):
    """A convolution to which the same is added at each cell."""
    onnx = pytest.importorskip("onnx", reason="pip install onnx")
    helper, numpy_helper = onnx.helper, onnx.numpy_helper
    weights = np.random.default_rng(2).normal(size=(16, 16, 1, 1)).astype(np.float32)
    kind = onnx.TensorProto.FLOAT
    graph = helper.make_graph(
        [
            helper.make_node("Neg", ["minus_b"], ["b"]),
            helper.make_node("Conv", ["x", "w"], ["c"]),
            helper.make_node("Add", ["c", "b"], ["y"]),
        ],
        "net",
        [
            helper.make_tensor_value_info("x", kind, [1, 16, 6, 10]),
            helper.make_tensor_value_info("minus_b", kind, summand_shape),
        ],
        [helper.make_tensor_value_info("y", kind, [1, 16, 6, 10])],
        [numpy_helper.from_array(weights, "w")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return model, weights[:, :, 0, 0]


def test_opencv_adds_what_is_the_same_at_each_cell(tmp_path):
    model, weights = summed([1, 16, 1, 1])
    spread_summands(model)
    path = tmp_path / "net.onnx"
    path.write_bytes(model.SerializeToString())
    rng = np.random.default_rng(1)
    x, b = (rng.normal(size=shape).astype(np.float32) for shape in ((1, 16, 6, 10), (1, 16, 1, 1)))
    found = open_engine(path, read_onnx_head(path), "opencv", 1).run({"x": x, "minus_b": -b})["y"]
    np.testing.assert_allclose(found, np.einsum("oi,bihw->bohw", weights, x) + b, rtol=1e-5, atol=1e-5)


def test_summands_of_the_same_shape_stay_as_they_are():
    model, _ = summed([1, 16, 6, 10])
    before = model.SerializeToString(deterministic=True)
    spread_summands(model)
    assert model.SerializeToString(deterministic=True) == before


def test_opencv_takes_the_tangent_of_large_numbers(tmp_path):
    onnx = pytest.importorskip("onnx", reason="pip install onnx")
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    x = np.linspace(-200.0, 200.0, 801, dtype=np.float32).reshape(1, 1, 1, -1)
    ports = [helper.make_tensor_value_info(name, kind, x.shape) for name in "xy"]
    graph = helper.make_graph([helper.make_node("Tanh", ["x"], ["y"])], "net", ports[:1], ports[1:])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    bound_tanh(model)
    path = tmp_path / "net.onnx"
    path.write_bytes(model.SerializeToString())
    found = open_engine(path, read_onnx_head(path), "opencv", 1).run({"x": x})["y"]
    np.testing.assert_allclose(found, np.tanh(x), rtol=1e-5, atol=1e-6)
