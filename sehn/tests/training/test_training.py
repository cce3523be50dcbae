"""Training as a whole: it learns, it goes on after a kill, and what it writes is what it learned."""

from __future__ import annotations

import json

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")

from jeat_graph.data.errors import DataError, OtherRunError  # noqa: E402
from jeat_graph.detection.models.onnx_head import read_onnx_head  # noqa: E402
from jeat_graph_sehn.training.data_sets import Split, read_event_segments, read_pictures  # noqa: E402
from jeat_graph_sehn.training.judging import judge  # noqa: E402
from jeat_graph_sehn.training.procedure import TrainRequest, train  # noqa: E402
from jeat_graph_sehn.training.settings import EventChanges, NetSettings, PictureChanges, TrainSettings  # noqa: E402
from jeat_graph_sehn.training.trainer import Trainer, TrainingJob  # noqa: E402

from .small_sets import FRAMES, SIZE  # noqa: E402

UNCHANGED = PictureChanges(mirror_share=0.0, zoom=1.0, exposure=1.0, gamma=1.0, noise=0.0)
STILL = EventChanges(mirror_share=0.0, zoom=1.0, drop_share=0.0, time_scale=1.0, noise_hz_px=0.0)
BASE = {"crop_px": SIZE, "batch": 4, "average_steps": 10.0, "learning_rate": 1e-2, "judge_every": 1.0}


def trained(root, tmp_path, kind, settings):
    """A trainer that has come to its end, and what it learned from."""
    members = (read_pictures if kind == "frames" else read_event_segments)(root)
    net = NetSettings(kind=kind, width=6)
    trainer = Trainer(
        TrainingJob(net, settings, Split(members, members, ""), SIZE, "cpu", tmp_path / "c", "x")
    )
    trainer.run()
    return trainer, members


@pytest.mark.slow
def test_a_network_learns_pictures_by_heart(small_set, tmp_path):
    settings = TrainSettings(**BASE, epochs=10.0, pictures=UNCHANGED)
    trainer, members = trained(small_set, tmp_path, "frames", settings)
    assert judge(trainer.average, members, SIZE, settings, 99)["all"].ap50 > 90.0


@pytest.mark.slow
def test_a_network_learns_events_by_heart(small_set, tmp_path):
    settings = TrainSettings(**BASE, epochs=12.0, events=STILL, steps=4, back=2, most_step_bins=6)
    trainer, members = trained(small_set, tmp_path, "events", settings)
    assert judge(trainer.average, members, SIZE, settings, 99)["all"].ap50 > 90.0


slow = pytest.mark.slow


@pytest.mark.usefixtures("no_plot")
@pytest.mark.parametrize(
    "kind", ["frames", pytest.param("events", marks=slow), pytest.param("fused", marks=slow)]
)
def test_a_training_that_was_killed_writes_the_same_bytes(small_set, tmp_path, kind):
    settings = TrainSettings(
        crop_px=(32, 32), batch=2, epochs=1.0, judge_every=0.4, judged=2, steps=2, back=1, seed=3
    )

    def request(out):
        return TrainRequest((small_set,), out, NetSettings(kind=kind, width=2), settings, force=True)

    class KilledError(Exception):
        """The end of a process, after a checkpoint and two more steps."""

    def die(share, _):
        if share > 0.8:
            raise KilledError

    whole = train(request(tmp_path / "whole.onnx"))
    with pytest.raises(KilledError):
        train(request(tmp_path / "killed.onnx"), on_progress=die)
    assert (tmp_path / "killed.checkpoint").is_file()
    assert not (tmp_path / "killed.onnx").exists()
    said = []
    resumed = train(request(tmp_path / "killed.onnx"), say=said.append)
    assert any("goes on from step" in line for line in said)
    assert not (tmp_path / "killed.checkpoint").exists()
    for one, other in zip(whole.files, resumed.files, strict=True):
        assert one.read_bytes() == other.read_bytes(), one.name


def test_another_training_s_checkpoint_is_refused(small_set, tmp_path):
    members = read_pictures(small_set)
    settings = TrainSettings(crop_px=(32, 32), batch=2, epochs=0.1, judged=1)
    split = Split(members[:2], members[:2], "")
    job = TrainingJob(NetSettings(width=2), settings, split, SIZE, "cpu", tmp_path / "c", "one")
    Trainer(job).run()
    with pytest.raises(OtherRunError, match="other data or settings"):
        Trainer(TrainingJob(job.net, settings, split, SIZE, "cpu", tmp_path / "c", "another"))


@pytest.mark.usefixtures("no_plot")
def test_the_file_says_what_it_was_trained_on_and_how_good_it_is(small_set, tmp_path):
    settings = TrainSettings(crop_px=(32, 32), batch=2, epochs=0.5, judged=2, seed=5)
    done = train(TrainRequest((small_set,), tmp_path / "n.onnx", NetSettings(width=2), settings, force=True))
    notes = read_onnx_head(tmp_path / "n.onnx").notes
    card = json.loads(notes["card"])
    assert card == json.loads(json.dumps(done.card))
    assert card["settings"]["seed"] == 5
    assert card["data"][0]["name"] == "small"
    assert card["judged"]["all"]["boxes"] == 2 * FRAMES  # of one of the two segments
    assert np.isfinite(card["judged"]["all"]["AP50"])
    assert notes["names"] == "{0: 'vehicle'}"


@pytest.mark.usefixtures("no_plot")
def test_data_sets_are_told_apart_by_their_whole_names(small_set, tmp_path):
    lights = [tmp_path / "lux-0.5", tmp_path / "lux-0.7"]
    for link in lights:
        link.symlink_to(small_set)
    settings = TrainSettings(crop_px=(32, 32), batch=2, epochs=0.1, judged=1)
    small = NetSettings(width=2)
    done = train(TrainRequest(tuple(lights), tmp_path / "n.onnx", small, settings, force=True))
    assert [one["name"] for one in done.card["data"]] == ["lux-0.5", "lux-0.7"]
    twice = TrainRequest((small_set, small_set), tmp_path / "m.onnx", NetSettings(width=2), settings)
    with pytest.raises(DataError, match="2 data sets are called small"):
        train(twice)
    assert not (tmp_path / "m.onnx").exists()
