"""A network learns from labels: the loss on what is held back falls, and the share of old worlds is kept."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="teaching needs PyTorch, the extra `train`")

from jeat_graph.data.errors import ConfigError, DataError  # noqa: E402
from jeat_graph_sehn.teaching.dividing import Division, part  # noqa: E402
from jeat_graph_sehn.teaching.labels import TrackLabels  # noqa: E402
from jeat_graph_sehn.teaching.learning_from import (  # noqa: E402
    TeachRequest,
    check_teachable,
    mixed,
    settings_for,
    teach,
    write_taught,
)
from jeat_graph_sehn.teaching.lesson import Lesson  # noqa: E402
from jeat_graph_sehn.teaching.recordings import StoredPicture, open_recording  # noqa: E402
from jeat_graph_sehn.training.batches import Batches  # noqa: E402
from jeat_graph_sehn.training.data_sets import EventSegment, Picture  # noqa: E402
from jeat_graph_sehn.training.learning import cost_of  # noqa: E402
from jeat_graph_sehn.training.making import card_of, new_network, settings_of  # noqa: E402
from jeat_graph_sehn.training.network import cell_places  # noqa: E402
from jeat_graph_sehn.training.settings import NetSettings, TrainSettings  # noqa: E402
from jeat_graph_sehn.training.truth_at import TruthByTime  # noqa: E402

from .drawn_road import truth_of, write_events, write_pictures  # noqa: E402
from .networks import FAST, write_network  # noqa: E402

DIVISION = Division((0.2, 5.0), (6.0, 9.0))


@pytest.fixture
def lesson():
    """True boxes of a drawn road, as if a tracker had made them."""
    truth = truth_of(0.2, 9.0)
    labels = TrackLabels(truth, np.full(len(truth), 0.95))
    return Lesson(part(labels, labels, DIVISION), DIVISION, ("rgb",), ("rgb",), own_judge=False)


def loss_on(net, members, settings):
    """What mistakes of a network cost in the first batch of some members."""
    batches = Batches(members, net.settings, settings)
    batch = batches.get(0)
    batches.close()
    places, strides = cell_places(settings.crop_px)
    net.eval()
    with torch.no_grad():
        state = net.empty_state(settings.batch, settings.crop_px)
        rows, _ = net(torch.cat(batch.steps), state, len(batch.steps))
    targets = [one for step in batch.targets for one in step]
    return float(cost_of(rows, targets, places, strides, settings.box_weight).total)


def request_of(folder, lesson, kind, start):
    """What is taught to a small network by a drawn road's events or pictures."""
    overrides = {**FAST, "learning_rate": 0.01, "average_steps": 5.0}
    seen = {"video": folder / "road" / "frames"}
    if kind == "events":
        seen = {"events": open_recording(folder / "road" / "events.h5", folder / "cache")}
    return TeachRequest(
        lesson=lesson,
        start=start,
        out=folder / "out.onnx",
        cache=folder / "cache",
        overrides=overrides,
        steps=50,
        looks=2,
        **seen,
    )


def held_of(folder, lesson, kind):
    """Members of the held-back part, as a training has them."""
    truth = TruthByTime(lesson.parts.judged.truth)
    if kind == "events":
        return [EventSegment("held", "held", folder / "road" / "events.h5", truth)]
    places = [(k, 0.1 * (k + 1)) for k in range(59, 89)]
    frames = folder / "road" / "frames"
    return [Picture("held", "held", StoredPicture(frames / f"{k:06d}.png"), truth.at(t)) for k, t in places]


@pytest.mark.parametrize("kind", ["events", "frames"])
def test_the_loss_on_what_is_held_back_falls(tmp_path, lesson, kind):
    write_pictures(tmp_path / "road", 9.5)
    write_events(tmp_path / "road" / "events.h5", 9.5)
    start = write_network(tmp_path / "start.onnx", width=4, kind=kind)
    request = request_of(tmp_path, lesson, kind, start)
    taught = teach(request)
    settings = settings_for({}, request.overrides, 0)
    held = held_of(tmp_path, lesson, kind)
    before = loss_on(new_network(taught.net.settings, (start,)), held, settings)
    assert loss_on(taught.net, held, settings) < 0.8 * before
    assert taught.card["steps"] == 50
    assert not request.out.exists()
    write_taught(taught, request)
    assert settings_of(request.out) == taught.net.settings
    assert card_of(request.out)["outcome"]["after"] == round(taught.outcome.after, 2)


@pytest.mark.parametrize(("own", "old", "share"), [(1, 9, 0.3), (1, 9, 0.6), (1, 1, 0.5), (600, 180, 0.3)])
def test_old_worlds_are_drawn_in_the_share_asked_for(own, old, share):
    found = mixed(["own"] * own, ["old"] * old, share)
    assert found.count("old") / len(found) == pytest.approx(share, abs=0.08)


def test_without_old_worlds_the_own_road_alone_is_learned():
    assert mixed(["own"], [], 0.3) == ["own"]
    assert mixed(["own"], ["old"], 0.0) == ["own"]


def test_it_goes_on_as_it_was_trained_but_gently():
    trained = {"steps": 4, "minutes": 60.0, "learning_rate": 0.002, "events": {"zoom": 2.0}, "gone": 1}
    card = {"settings": trained}
    found = settings_for(card, {"events": {"drop_share": 0.1}, "clip": 5.0}, seed=4)
    assert (found.steps, found.minutes, found.learning_rate, found.seed) == (4, None, 3e-4, 4)
    assert (found.events.zoom, found.events.drop_share, found.clip) == (2.0, 0.1, 5.0)
    assert found.pictures == TrainSettings().pictures
    with pytest.raises(ConfigError, match="did you mean clip"):
        settings_for(card, {"clipp": 5.0}, 0)


def test_who_cannot_learn_is_told_so(tmp_path):
    events = write_network(tmp_path / "events.onnx", width=2)
    assert check_teachable(events, "events") == NetSettings(kind="events", width=2)
    with pytest.raises(ConfigError, match=r"events\.onnx is of events, and the recording is of frames"):
        check_teachable(events, "frames")
    halved = write_network(tmp_path / "int8.onnx", width=2, more={"int8": {}})
    with pytest.raises(ConfigError, match="8-bit numbers, which cannot learn"):
        check_teachable(halved, "events")
    (tmp_path / "none.onnx").write_bytes(b"")
    with pytest.raises(DataError):
        check_teachable(tmp_path / "none.onnx", "events")
