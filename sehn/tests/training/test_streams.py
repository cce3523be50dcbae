"""Sequences that go on from step to step, and what is drawn beside vehicles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")

from jeat_graph.data.errors import ConfigError  # noqa: E402
from jeat_graph_sehn.training.batches import Batches, stream_begin  # noqa: E402
from jeat_graph_sehn.training.data_sets import Split, read_event_segments  # noqa: E402
from jeat_graph_sehn.training.disturbances import draw_disturbances  # noqa: E402
from jeat_graph_sehn.training.event_samples import draw_stream  # noqa: E402
from jeat_graph_sehn.training.export import write_onnx  # noqa: E402
from jeat_graph_sehn.training.network import DetectionNet  # noqa: E402
from jeat_graph_sehn.training.procedure import TrainRequest, train  # noqa: E402
from jeat_graph_sehn.training.settings import EventChanges, NetSettings, TrainSettings  # noqa: E402
from jeat_graph_sehn.training.trainer import Trainer, TrainingJob  # noqa: E402

from .small_sets import SIZE  # noqa: E402

NET = NetSettings(kind="events", width=2, bins=2, memory="time")
STREAMED = TrainSettings(
    crop_px=(32, 32),
    batch=2,
    epochs=1.0,
    judge_every=0.4,
    judged=2,
    steps=2,
    back=1,
    most_step_bins=3,
    stream_share=0.5,
    stream_steps=3,
)


@pytest.mark.parametrize("seed", range(3))
def test_parts_of_a_stream_are_one_long_sequence(small_set, seed):
    segment = read_event_segments(small_set)[0]
    stream = draw_stream(segment, np.random.default_rng(seed), NET, STREAMED, times=3)
    whole = stream.part(0, 6, NET)
    parts = [stream.part(first, 2, NET) for first in (0, 2, 4)]
    np.testing.assert_array_equal(np.concatenate([one.windows for one in parts]), whole.windows)
    assert [passed for one in parts for passed in one.elapsed_s] == whole.elapsed_s
    for k, part in enumerate(parts):
        for mine, its in zip(part.corners, whole.corners[2 * k :], strict=False):
            np.testing.assert_array_equal(mine, its)
    assert whole.windows.any()


def test_asked_for_is_who_has_moved_since_a_stream_began(small_set):
    """End by end, as if each were asked for alone."""
    truth = read_event_segments(small_set)[0].truth
    start = float(truth.times[0])
    ends = np.linspace(start, truth.times[-1], 7)[1:].tolist()
    for found, end in zip(truth.asked_since(start, ends, 1.0), ends, strict=True):
        alone = truth.asked(start, end, 1.0)
        np.testing.assert_array_equal(found.corners, alone.corners)
        np.testing.assert_array_equal(found.ignored, alone.ignored)


def test_streams_begin_one_after_the_other_and_each_goes_on():
    settings = TrainSettings(batch=6, stream_share=0.5, stream_steps=6)
    begins = np.array([[stream_begin(step, k, settings) for k in range(6)] for step in range(30)])
    assert (begins[:, 3:] == np.arange(30)[:, None]).all(), "the others start over"
    ages = np.arange(30)[:, None] - begins[:, :3]
    assert ages.min() == 0
    assert ages.max() == 5
    assert ((np.diff(ages, axis=0) == 1) | (ages[1:] == 0)).all()
    assert all(len(set(row)) == 3 for row in ages[6:].tolist()), "some are young and some are old"


def test_what_is_remembered_goes_on_with_a_stream_alone(small_set, tmp_path):
    members = read_event_segments(small_set)
    job = TrainingJob(NET, STREAMED, Split(members, members, ""), SIZE, "cpu", tmp_path / "c", "x")
    trainer = Trainer(job)
    batches = Batches(members, NET, STREAMED, SIZE)
    batch = batches.get(1)
    batches.close()
    assert batch.goes_on.tolist() == [True, False]
    ones = tuple(torch.ones_like(one) for one in trainer.net.empty_state(2, (32, 32)))
    trainer._remembered = ones
    for state in trainer._state_before(batch):
        assert (state[0] == 1.0).all()
        assert (state[1] == 0.0).all()


@pytest.mark.usefixtures("no_plot")
def test_a_training_on_streams_that_was_killed_writes_the_same_bytes(small_set, tmp_path):
    def request(out):
        return TrainRequest((small_set,), out, NET, STREAMED)

    class KilledError(Exception):
        """The end of a process, after a checkpoint and two more steps."""

    def die(share, _):
        if share > 0.6:
            raise KilledError

    whole = train(request(tmp_path / "whole.onnx"))
    with pytest.raises(KilledError):
        train(request(tmp_path / "killed.onnx"), on_progress=die)
    resumed = train(request(tmp_path / "killed.onnx"))
    for one, other in zip(whole.files, resumed.files, strict=True):
        assert one.read_bytes() == other.read_bytes(), one.name


def test_a_training_from_a_start_may_hold_its_first_layers(small_set, tmp_path):
    members = read_event_segments(small_set)
    settings = TrainSettings(crop_px=(32, 32), batch=2, steps=2, hold="first", epochs=0.5, judged=1)
    job = TrainingJob(NET, settings, Split(members, members, ""), SIZE, "cpu", tmp_path / "c", "x")
    trainer = Trainer(job)
    before = {name: value.clone() for name, value in trainer.net.state_dict().items()}
    trainer.run()
    changed = {name for name, value in trainer.net.named_parameters() if not value.equal(before[name])}
    assert changed
    assert not any(name.startswith(("backbone.stem", "backbone.to_4")) for name in changed)
    with pytest.raises(ConfigError, match="hold=first"):
        train(TrainRequest((small_set,), tmp_path / "n.onnx", NET, settings))


def test_a_training_may_learn_nothing_but_how_far_off_sides_are(small_set, tmp_path):
    """From a file of before, whose card knows of no spreads."""
    torch.manual_seed(2)
    old = DetectionNet(replace(NET, spreads=False)).eval()
    card = {"net": {name: value for name, value in vars(NET).items() if name != "spreads"}}
    write_onnx(old, SIZE, card, tmp_path / "old.onnx")
    members = read_event_segments(small_set)
    settings = TrainSettings(crop_px=(32, 32), batch=2, steps=2, hold="boxes", epochs=0.5, judged=1)
    start = (tmp_path / "old.onnx",)
    job = TrainingJob(NET, settings, Split(members, members, ""), SIZE, "cpu", tmp_path / "c", "x", start)
    trainer = Trainer(job)
    before = {name: value.clone() for name, value in trainer.net.state_dict().items()}
    trainer.run()
    now = trainer.net.state_dict().items()
    changed = {name for name, value in now if not value.equal(before[name])}
    assert changed == {"head.spread.weight", "head.spread.bias"}
    assert trainer.log[-1].loss_spreads != 0.0
    for wrong, words in ((NET, "hold=boxes: give"), (replace(NET, spreads=False), "nothing is left")):
        given = () if wrong is NET else start
        with pytest.raises(ConfigError, match=words):
            train(TrainRequest((small_set,), tmp_path / "n.onnx", wrong, settings, start=given))


def test_what_a_memory_lasts_moves_faster_than_weights(small_set, tmp_path):
    members = read_event_segments(small_set)
    settings = replace(
        STREAMED, epochs=0.5, judged=1, learning_rate=1e-3, memory_rate=50.0, warm_up_share=0.0
    )
    job = TrainingJob(NET, settings, Split(members, members, ""), SIZE, "cpu", tmp_path / "c", "x")
    trainer = Trainer(job)
    before = {name: value.clone() for name, value in trainer.net.named_parameters()}
    trainer.run()
    moved = {
        name: float((value - before[name]).abs().max().detach())
        for name, value in trainer.net.named_parameters()
    }
    lasts = [far for name, far in moved.items() if ".lasting." in name]
    others = [far for name, far in moved.items() if ".lasting." not in name]
    # AdamW moves by the rate in a step, at most some times as far as its second moment lags behind.
    assert max(lasts) > 5.0 * max(others) > 0.0


def test_pictures_have_no_streams(small_set, tmp_path):
    with pytest.raises(ConfigError, match="stream_share: only networks of events"):
        train(TrainRequest((small_set,), tmp_path / "n.onnx", NetSettings(width=2), STREAMED))


def test_lamps_flicker_twice_as_often_as_the_mains():
    changes = EventChanges(lamps=1)
    t, x, y, polarity = draw_one(changes)
    # Brighter, then darker, in each period: their difference has its frequency.
    wave = np.exp(-2j * np.pi * np.outer(np.arange(20, 200), t / 1e6))
    spectrum = np.abs((wave * (2.0 * polarity - 1.0)).sum(axis=1))
    assert 20 + spectrum.argmax() in (100, 120)
    assert np.ptp(x) <= 10
    assert np.ptp(y) <= 10
    assert set(polarity.tolist()) == {0, 1}


def draw_one(changes):
    """Events of the first seed that draws one, and not none."""
    drawn = (draw_disturbances(np.random.default_rng(k), SIZE, 1_000_000, changes) for k in range(99))
    return next(one for one in drawn if len(one[0]))


def test_a_hot_pixel_is_one_pixel():
    changes = EventChanges(hot_pixels=1)
    t, x, y, _ = draw_one(changes)
    assert len(t) >= 5
    assert np.ptp(x) == np.ptp(y) == 0


@pytest.mark.parametrize("swapped", [False, True])
def test_darker_and_brighter_may_be_exchanged(small_set, swapped):
    segment = read_event_segments(small_set)[0]
    plain = {"mirror_share": 0.0, "zoom": 1.0, "drop_share": 0.0, "time_scale": 1.0, "noise_hz_px": 0.0}

    def windows(share):
        settings = TrainSettings(crop_px=(32, 32), steps=2, events=EventChanges(**plain, swap_share=share))
        return draw_stream(segment, np.random.default_rng(4), NET, settings).part(0, 2, NET).windows

    before, after = windows(0.0), windows(1.0 if swapped else 0.0)
    order = [1, 0, 3, 2] if swapped else [0, 1, 2, 3]
    np.testing.assert_array_equal(after, before[:, order])
    assert before.any()
