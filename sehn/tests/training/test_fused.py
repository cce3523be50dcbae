"""The network of both sensors: what is missing says nothing, it begins as what it is made from, it learns."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")

from jeat_graph.data.errors import ConfigError, DataError  # noqa: E402
from jeat_graph.detection.models.engine import open_engine  # noqa: E402
from jeat_graph.detection.models.onnx_head import read_onnx_head  # noqa: E402
from jeat_graph_sehn.training.batches import Batches  # noqa: E402
from jeat_graph_sehn.training.data_sets import Split, read_fused_segments  # noqa: E402
from jeat_graph_sehn.training.export import write_onnx  # noqa: E402
from jeat_graph_sehn.training.fused_network import FusedNet, SeenPictures  # noqa: E402
from jeat_graph_sehn.training.judging import judge  # noqa: E402
from jeat_graph_sehn.training.making import new_network, read_network  # noqa: E402
from jeat_graph_sehn.training.network import DetectionNet  # noqa: E402
from jeat_graph_sehn.training.procedure import TrainRequest, train  # noqa: E402
from jeat_graph_sehn.training.serving import ServedNet  # noqa: E402
from jeat_graph_sehn.training.settings import (  # noqa: E402
    EventChanges,
    FusedChanges,
    NetSettings,
    PictureChanges,
    TrainSettings,
)
from jeat_graph_sehn.training.trainer import Trainer, TrainingJob  # noqa: E402

from .small_sets import SIZE  # noqa: E402

SIDE = (48, 32)
NET = NetSettings(kind="fused", width=4)
#: Weights in half precision: each of some twenty layers adds at most 2^-11 of what it says.
RELATIVE = ABSOLUTE = 20 * 2.0**-11
UNCHANGED = {
    "pictures": PictureChanges(
        mirror_share=0.0, zoom=1.0, exposure=1.0, gamma=1.0, noise=0.0, grey_share=0.0
    ),
    "events": EventChanges(mirror_share=0.0, zoom=1.0, drop_share=0.0, time_scale=1.0, noise_hz_px=0.0),
}


def used(seed: int, settings: NetSettings = NET):
    """A network whose gates and normalisations are not those of a fresh one, and generator for its inputs."""
    torch.manual_seed(seed)
    net = new_network(settings)
    with torch.no_grad():
        for value in net.parameters():
            value.add_(0.1 * torch.randn_like(value))
        for name, value in net.named_buffers():
            if name.endswith(("running_mean", "running_var")):
                value.add_(0.2 * torch.rand_like(value))
    return net.eval()


def moment(seed: int, given: tuple[float, float, float]):
    """Inputs of one moment, and states."""
    generator = torch.Generator().manual_seed(seed)
    window = torch.rand(1, NET.channels, SIDE[1], SIDE[0], generator=generator) * 3.0
    picture = torch.rand(1, 3, SIDE[1], SIDE[0], generator=generator)
    return [window, picture, torch.tensor([given]), *new_network(NET).empty_state(1, SIDE)]


def said(net, values):
    with torch.no_grad():
        return net.serve(values)[0]


def test_what_is_missing_says_nothing():
    net = used(1)
    for given, place in (((0.0, 0.0, 1.0), 1), ((1.0, 0.1, 0.0), 0)):
        one, other = moment(2, given), moment(2, given)
        other[place] = other[place] * 0.0
        torch.testing.assert_close(said(net, one), said(net, other), rtol=0.0, atol=0.0)
        there = moment(2, (1.0, 0.1, 1.0))
        assert not torch.allclose(said(net, one), said(net, there))


def test_an_old_picture_counts_otherwise_and_a_very_old_one_like_any_such():
    net = used(3)
    fresh, old, older = (said(net, moment(4, (1.0, age, 1.0))) for age in (0.0, 0.3, 5.0))
    assert not torch.allclose(fresh, old)
    torch.testing.assert_close(older, said(net, moment(4, (1.0, 50.0, 1.0))))


@pytest.mark.parametrize("keep", [0.0, 0.9])
def test_earlier_pictures_are_remembered_for_as_long_as_the_memory_keeps(keep):
    """Of two networks that see the same now, one saw another picture before; without events both times."""
    net = used(17, NetSettings(kind="fused", width=4, memory_keep=keep))
    rows = []
    for seed in (18, 19):
        earlier, now = moment(seed, (1.0, 0.0, 0.0)), moment(20, (1.0, 0.0, 0.0))
        with torch.no_grad():
            _, now[3:] = net.serve(earlier)
        rows.append(said(net, now))
    assert torch.equal(rows[0], rows[1]) == (keep == 0.0)


def test_windows_together_are_windows_one_after_the_other():
    """Two sequences of three windows, of which the second has one picture for all."""
    net, generator = used(5), torch.Generator().manual_seed(6)
    shown = 3.0 * torch.rand(3, 2, NET.channels, SIDE[1], SIDE[0], generator=generator)
    pictures = torch.rand(3, 3, SIDE[1], SIDE[0], generator=generator)
    which = torch.tensor([[0, 2], [1, 2], [1, 2]])
    given = torch.rand(3, 2, 3, generator=generator).round(decimals=1)
    with torch.no_grad():
        seen = SeenPictures(pictures, which.flatten(), given.flatten(0, 1))
        together, _ = net(shown.flatten(0, 1), net.empty_state(2, SIDE), 3, seen)
        for sequence in range(2):
            state = net.empty_state(1, SIDE)
            for k in range(3):
                picture = pictures[which[k, sequence]][None]
                rows, state = net.serve([shown[k, sequence][None], picture, given[k, sequence][None], *state])
                torch.testing.assert_close(rows[0], together[2 * k + sequence], atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("engine", ["opencv", "onnxruntime"])
def test_the_file_says_what_the_network_says(tmp_path, engine):
    if engine == "onnxruntime":
        pytest.importorskip("onnxruntime", reason="the extra `onnxruntime` is not installed")
    net, path = used(7), tmp_path / "net.onnx"
    write_onnx(net, SIDE, {"net": vars(NET)}, path)
    head = read_onnx_head(path)
    run, served = open_engine(path, head, engine, 1), ServedNet(net, SIDE)
    values = moment(8, (1.0, 0.04, 1.0))
    for _ in range(2):  # the memory comes back and counts
        names = [port.name for port in head.inputs]
        found = run.run({name: value.numpy() for name, value in zip(names, values, strict=True)})
        with torch.no_grad():
            outputs = served(*values)
        for port, value in zip(head.outputs, outputs, strict=True):
            np.testing.assert_allclose(found[port.name], value.numpy(), rtol=RELATIVE, atol=ABSOLUTE)
        values[3:] = outputs[2:]


@pytest.mark.parametrize("kind", ["frames", "events", "fused"])
def test_a_network_is_read_back_from_its_file(tmp_path, kind):
    settings = NetSettings(kind=kind, width=4)
    net, path = used(9, settings), tmp_path / "net.onnx"
    write_onnx(net, SIDE, {"net": vars(settings)}, path)
    again = read_network(path).eval()
    generator = torch.Generator().manual_seed(10)
    inputs = [torch.rand(one.shape, generator=generator) for one in net.inputs(SIDE).values()]
    values = [*inputs, *net.empty_state(1, SIDE)]
    torch.testing.assert_close(said(net, values), said(again, values), rtol=RELATIVE, atol=ABSOLUTE)


def test_it_begins_as_good_as_the_network_of_pictures(tmp_path):
    nets = {kind: used(11, NetSettings(kind=kind, width=4)) for kind in ("frames", "events")}
    paths = {kind: tmp_path / f"{kind}.onnx" for kind in nets}
    for kind, net in nets.items():
        write_onnx(net, SIDE, {"net": vars(net.settings)}, paths[kind])
    net = new_network(NET, tuple(paths.values())).eval()
    assert isinstance(net, FusedNet)
    values = moment(12, (1.0, 0.1, 1.0))
    frames = read_network(paths["frames"]).eval()
    torch.testing.assert_close(said(net, values), said(frames, [values[1]]), rtol=0.0, atol=0.0)
    events = read_network(paths["events"])
    assert isinstance(events, DetectionNet)
    for one, other in zip(net.events.parameters(), events.backbone.parameters(), strict=True):
        assert torch.equal(one, other)
    with pytest.raises(DataError, match="of frames with 4 channels"):
        new_network(NetSettings(kind="fused", width=6), (paths["frames"],))


def test_the_pictures_part_of_a_network_of_both_can_be_a_better_one(tmp_path):
    both, frames = used(15), used(16, NetSettings(kind="frames", width=4))
    paths = [tmp_path / "both.onnx", tmp_path / "frames.onnx"]
    for net, path in zip((both, frames), paths, strict=True):
        write_onnx(net, SIDE, {"net": vars(net.settings)}, path)
    net = new_network(NET, tuple(paths)).eval()
    first, second = (read_network(path) for path in paths)
    expected = first.state_dict() | {
        name.replace("backbone", "pictures"): value for name, value in second.state_dict().items()
    }
    for name, value in net.state_dict().items():
        assert torch.equal(value, expected[name]), name


@pytest.mark.parametrize("lack", ["nothing", "pictures", "events"])
def test_sequences_say_what_they_lack(small_set, lack):
    lacks = FusedChanges(
        no_picture_share=float(lack == "pictures"),
        no_events_share=float(lack == "events"),
        stale_share=1.0,
        stale_s=0.2,
    )
    settings = TrainSettings(crop_px=SIDE, batch=2, steps=3, most_step_bins=4, fused=lacks)
    members = read_fused_segments(small_set)
    batches = Batches(members, NET, settings)
    ages, there = [], []
    for step in range(8):
        shown = batches.get(step)
        assert shown.pictures is not None
        pictures, which, given = shown.pictures
        assert which.shape == (6,)
        assert int(which.max()) < len(pictures)
        assert (given[:, 2] == float(lack != "events")).all()
        assert any(window.any() for window in shown.steps) == (lack != "events")
        there += given[:, 0].tolist()
        ages += given[:, 1].tolist()
    batches.close()
    # Where a recording begins, a picture that comes late is not there yet.
    assert np.mean(there) > 0.5 if lack != "pictures" else not any(there)
    # Pictures come each 50 ms, and up to 200 ms late on a clock that is up to 1.4 times as fast.
    assert (max(ages) > 0.07) == (lack != "pictures")
    assert max(ages) <= 1.4 * 0.05 + 0.2 + 1e-6


@pytest.mark.slow
def test_a_network_learns_both_by_heart(small_set, tmp_path):
    settings = TrainSettings(
        crop_px=SIZE,
        batch=4,
        average_steps=10.0,
        learning_rate=1e-2,
        judge_every=1.0,
        epochs=10.0,
        steps=3,
        back=3,
        most_step_bins=6,
        fused=FusedChanges(no_picture_share=0.0, no_events_share=0.0),
        **UNCHANGED,
    )
    members = read_fused_segments(small_set)
    net = NetSettings(kind="fused", width=6)
    job = TrainingJob(net, settings, Split(members, members, ""), SIZE, "cpu", tmp_path / "c", "x")
    trainer = Trainer(job)
    trainer.run()
    assert judge(trainer.average, members, SIZE, settings, 99)["all"].ap50 > 90.0


@pytest.mark.slow
def test_a_training_can_start_from_its_own_result(small_set, tmp_path):
    settings = TrainSettings(
        crop_px=(32, 32), batch=2, epochs=0.1, judged=2, steps=2, back=1, learning_rate=1e-6
    )
    first = TrainRequest((small_set,), tmp_path / "first.onnx", NET, settings, force=True)
    done = train(first)
    request = TrainRequest(
        (small_set,), tmp_path / "again.onnx", NET, settings, start=done.files[:1], force=True
    )
    again = train(request)
    assert again.card["start"][0]["name"] == "first.onnx"
    values = moment(13, (1.0, 0.0, 1.0))
    one, other = (said(read_network(done.files[0]).eval(), values) for done in (done, again))
    torch.testing.assert_close(one, other, rtol=RELATIVE, atol=ABSOLUTE)


def test_what_pictures_taught_can_be_held(small_set, tmp_path):
    """Backbone and head of the pictures stay to the bit; what events add is learned."""
    frames = used(14, NetSettings(kind="frames", width=4))
    path = tmp_path / "frames.onnx"
    write_onnx(frames, SIDE, {"net": vars(frames.settings)}, path)
    settings = TrainSettings(
        crop_px=(32, 32),
        batch=2,
        epochs=0.5,
        judged=2,
        steps=2,
        back=2,
        learning_rate=1e-2,
        fused=FusedChanges(hold_pictures=True),
    )
    members = read_fused_segments(small_set)
    job = TrainingJob(NET, settings, Split(members, members, ""), SIZE, "cpu", tmp_path / "c", "x", (path,))
    trainer = Trainer(job)
    first = {name: value.clone() for name, value in trainer.net.state_dict().items()}
    trainer.run()
    now = trainer.net.state_dict().items()
    changed = {name for name, value in now if not torch.equal(value, first[name])}
    held = {name for name in changed if name.startswith(("pictures.", "head."))}
    assert held == {"head.spread.weight", "head.spread.bias"}  # the file before has none to hold
    for part in ("events.", "join."):
        assert any(name.startswith(part) for name in changed)
    request = TrainRequest((small_set,), tmp_path / "f.onnx", NET, settings, force=True)
    with pytest.raises(ConfigError, match="hold_pictures"):
        train(request)


def test_shapes_that_no_event_would_show_are_refused(small_set, tmp_path):
    settings = TrainSettings(pictures=PictureChanges(clutter_share=0.5))
    with pytest.raises(ConfigError, match="clutter_share"):
        train(TrainRequest((small_set,), tmp_path / "f.onnx", NET, settings))
