"""Data sets of events with arrays of boxes: their recordings, what is asked for, and that one learns."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph_sehn.training.data_sets import split_by_segment
from jeat_graph_sehn.training.label_times import UNKNOWN
from jeat_graph_sehn.training.labelled_sets import forget_converted, holds_labels, read_labelled_segments
from jeat_graph_sehn.training.settings import LabelSettings

from .labelled_fixtures import END_S, LABEL_S, SIZE, boxes, car_at, events, write_events, write_recording

GEN1 = LabelSettings(classes="gen1")


def read(root, settings=GEN1, cache=None):
    """The recordings of a folder."""
    return read_labelled_segments(root, settings, cache or root / "cache")


@pytest.mark.parametrize("ending", ["_td.dat", "_td.h5", ".h5", "_td.dat.h5", "_td.raw", ".raw"])
def test_any_stretch_of_any_file_of_events_is_what_was_written(tmp_path, ending):
    write_recording(tmp_path / "set", "one", ending)
    (segment,) = read(tmp_path / "set", cache=tmp_path / "cache")
    whole = events()
    with segment.open() as file:
        assert file.size_px == SIZE
        for start, end in (
            (0, 10_000),
            (500_000, 730_000),
            (1_234_567, 1_234_999),
            (-70_000, 4),
            (9e6, 9.1e6),
        ):
            found = file.between(int(start), int(end))
            inside = (whole.t_us >= start) & (whole.t_us < end)
            np.testing.assert_array_equal(found.t_us, whole.t_us[inside])
            for name in ("x", "y", "polarity"):
                # RAW sorts events of one microsecond anew.
                assert sorted(getattr(found, name)) == sorted(getattr(whole, name)[inside])
    assert (tmp_path / "cache").exists() == ending.endswith(".raw")


def test_boxes_hold_at_their_own_times_alone(tmp_path):
    write_recording(tmp_path, "one")
    (segment,) = read(tmp_path)
    truth = segment.truth
    assert truth.times.tolist() == pytest.approx(np.arange(LABEL_S, END_S, LABEL_S))
    left, top, width, height = car_at(0.5)
    np.testing.assert_allclose(truth.at(0.5).corners, [[left, top, left + width, top + height]], rtol=1e-6)
    assert truth.at(0.5 + 0.002).corners.shape == (1, 4)
    for t in (0.51, 0.6, 0.74):  # in between a moving box would be elsewhere
        assert truth.at(t) is UNKNOWN


def test_sequences_end_at_labels_and_know_nothing_before(tmp_path):
    torch = pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")
    from jeat_graph_sehn.training.batches import Batches
    from jeat_graph_sehn.training.event_samples import drawn_events
    from jeat_graph_sehn.training.settings import NetSettings, TrainSettings

    write_recording(tmp_path, "one")
    (segment,) = read(tmp_path)
    net, settings = NetSettings(kind="events", width=2), TrainSettings(crop_px=(64, 48), batch=2, steps=3)
    for seed in range(20):
        plan, _, _ = drawn_events(segment, np.random.default_rng(seed), net, settings)
        end_s = plan.file_s(plan.ends_us(net)[-1])
        assert np.abs(segment.truth.times - end_s).min() < 1e-6
    batches = Batches([segment], net, settings)
    shown = batches.get(0)
    batches.close()
    for target in shown.targets[-1]:
        assert len(target.boxes) + len(target.ignored) == 1
    unknown = torch.tensor([[0.0, 0.0, *settings.crop_px]])
    first = [target for step in shown.targets[:-1] for target in step if not len(target.boxes)]
    assert any(torch.equal(target.ignored, unknown) for target in first)


def test_classes_are_those_of_the_set(tmp_path):
    """Of 1 Megapixel: a car is asked for, a two-wheeler may be a motorcycle, a pedestrian is none."""
    for car, walker, name in ((2, 0, "car"), (1, 0, "two"), (0, 6, "none")):
        write_recording(tmp_path / name, "one", car=car, walker=walker)
    found = {
        name: read(tmp_path / name, LabelSettings(classes="1mpx"))[0].truth for name in ("car", "two", "none")
    }
    assert [found[name].at(0.5).ignored.tolist() for name in ("car", "two", "none")] == [[False], [True], []]
    assert len(found["none"].times) == len(found["car"].times)  # what is seen there is no vehicle
    write_recording(tmp_path / "etram", "one", car=4, walker=7)
    assert read(tmp_path / "etram", LabelSettings(classes="etram"))[0].truth.at(0.5).ignored.tolist() == [
        False
    ]


def test_a_label_map_names_the_classes(tmp_path):
    write_recording(tmp_path / "set" / "train", "one", car=9, walker=3)
    with pytest.raises(ConfigError, match=r"--set labels.classes=1mpx, etram or gen1"):
        read(tmp_path / "set", LabelSettings())
    names = {"9": "truck", "3": "pedestrian"}
    (tmp_path / "set" / "label_map_dictionary.json").write_text(json.dumps(names), encoding="utf-8")
    (segment,) = read(tmp_path / "set", LabelSettings())
    assert segment.truth.at(0.5).ignored.tolist() == [False]
    with pytest.raises(DataError, match="class 3, which has no name"):
        read(tmp_path / "set", GEN1)


def test_gen1_is_known_by_its_picture_and_its_older_arrays_are_read(tmp_path):
    write_events(tmp_path / "one_td.dat", events(), (304, 240))
    np.save(tmp_path / "one_bbox.npy", boxes(old=True))
    (segment,) = read(tmp_path, LabelSettings())
    assert segment.truth.at(0.5).ignored.tolist() == [False]


def test_the_sets_own_filter_is_an_option(tmp_path):
    """The car's diagonal, 22.8 px, is below the least of Gen1, 30 px; the first half second is left out."""
    write_recording(tmp_path, "one")
    (plain,), (usual,) = read(tmp_path), read(tmp_path, LabelSettings("gen1", usual_filter=True))
    assert plain.truth.times[0] == LABEL_S
    assert usual.truth.times[0] == 0.75
    assert (plain.truth.at(1.0).ignored.tolist(), usual.truth.at(1.0).ignored.tolist()) == ([False], [True])
    large = boxes()
    large["w"], large["h"] = 28.0, 12.0
    np.save(tmp_path / "one_bbox.npy", large)
    (usual,) = read(tmp_path, LabelSettings("gen1", usual_filter=True))
    assert usual.truth.at(1.0).ignored.tolist() == [False]  # its diagonal is 30.5 px


def test_who_stands_is_left_out_where_the_camera_stands(tmp_path):
    still = boxes(every_s=0.05)
    still["x"][still["class_id"] == 0] = 20.0
    write_recording(tmp_path, "one")
    np.save(tmp_path / "one_bbox.npy", still)
    for moving_only in (False, True):
        (segment,) = read(tmp_path, LabelSettings("gen1", moving_only=moving_only))
        assert segment.truth.asked(0.8, 1.0, 1.0).ignored.tolist() == [moving_only]
    np.save(tmp_path / "one_bbox.npy", boxes(every_s=0.5))
    with pytest.raises(DataError, match="too rare to tell who moves"):
        read(tmp_path, LabelSettings("gen1", moving_only=True))


def test_boxes_are_cut_at_the_picture(tmp_path):
    wide = boxes()
    wide["x"] = -5.0
    write_recording(tmp_path, "one")
    np.save(tmp_path / "one_bbox.npy", wide)
    (segment,) = read(tmp_path)
    assert segment.truth.at(0.5).corners[0].tolist() == [0.0, 14.0, 13.0, 28.0]


def test_folders_part_what_is_learned_from_what_is_judged(tmp_path):
    for part in ("train", "val", "test"):
        write_recording(tmp_path / part, f"{part}-a", "_td.h5" if part == "train" else "_td.dat")
    write_recording(tmp_path / "train_h5_2", "train-b")
    split = split_by_segment(read(tmp_path), [tmp_path])
    names = [sorted(one.path.name for one in members) for members in (split.learned, split.judged)]
    assert names == [["train-a_td.h5", "train-b_td.dat"], ["val-a_td.dat"]]
    assert "own `val`" in split.note


def test_labels_and_events_may_lie_in_folders_of_their_own(tmp_path):
    write_recording(tmp_path / "labels", "one")
    (tmp_path / "recordings").mkdir()
    (tmp_path / "labels" / "one_td.dat").rename(tmp_path / "recordings" / "one_td.dat")
    assert len(read(tmp_path)) == 1
    (tmp_path / "recordings" / "one_td.dat").unlink()
    assert not holds_labels(tmp_path)  # labels alone are nothing to learn from


def test_times_that_run_backwards_by_a_little_are_held(tmp_path):
    found = events()
    t_us = found.t_us.copy()
    t_us[1000], before = t_us[999] - 3, t_us[999]
    jumbled = type(found).trusted(t_us, found.x, found.y, found.polarity)
    write_recording(tmp_path, "one", "_td.h5")
    write_events(tmp_path / "one_td.h5", jumbled)
    (segment,) = read(tmp_path)
    with segment.open() as file:
        read_back = file.between(0, 2_000_000).t_us
    assert len(read_back) == len(t_us)
    assert read_back[1000] == before


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda folder: np.save(folder / "one_bbox.npy", np.zeros(3)), "is not a box array"),
        (lambda folder: (folder / "one_td.dat").write_bytes(b"% Version 2\n"), "ends in its header"),
        (lambda folder: np.save(folder / "one_bbox.npy", boxes()[:0]), "holds no labels at all"),
        (
            lambda folder: np.save(folder / "one_bbox.npy", boxes(end_s=9.0)[-4:]),
            "begins after the last event of one_td.dat",
        ),
    ],
)
def test_what_is_damaged_is_named(tmp_path, spoil, said):
    write_recording(tmp_path, "one")
    spoil(tmp_path)
    with pytest.raises(DataError, match=said):
        read(tmp_path)


def test_only_what_was_converted_is_removed(tmp_path):
    cache = tmp_path / "net.events"
    write_recording(tmp_path / "set", "one", ".raw")
    read(tmp_path / "set", cache=cache)
    (made,) = cache.iterdir()
    before = made.stat().st_mtime_ns
    read(tmp_path / "set", cache=cache)
    assert made.stat().st_mtime_ns == before  # a second time it is there
    (cache / "mine.h5").write_text("")
    forget_converted(cache)
    assert [path.name for path in cache.iterdir()] == ["mine.h5"]
    (cache / "mine.h5").unlink()
    forget_converted(cache)
    assert not cache.exists()


@pytest.mark.usefixtures("no_plot")
def test_a_network_learns_from_such_a_set_and_detects(tmp_path, capsys):
    """Some steps on a made set: the loss falls, and `detect` reads what was written."""
    pytest.importorskip("torch", reason="training needs PyTorch, the extra `train`")
    import pandas as pd

    from jeat_graph.cli.main import main

    write_recording(tmp_path / "gen1" / "train", "a", "_td.dat", 0)
    write_recording(tmp_path / "gen1" / "train", "b", ".raw", 1)
    write_recording(tmp_path / "gen1" / "val", "c", "_td.h5", 2)
    out = tmp_path / "net.onnx"
    words = ["--net", "tiny", "--crop", "64x48", "--batch", "4", "--epochs", "4", "--threads", "1"]
    quick = ["judge_every=0.25", "steps=3", "back=3", "judged=4", "most_step_bins=4", "labels.classes=gen1"]
    changes = [word for one in (*quick, "learning_rate=0.01", "average_steps=10") for word in ("--set", one)]
    assert main(["train", "events", str(tmp_path / "gen1"), "--out", str(out), *words, *changes]) == 0
    said = capsys.readouterr().err
    assert "2 recordings to learn from, 1 to judge by; 1 segments of the sets' own `val` are judged" in said
    assert "steps (4 epochs), 4 sequences of 3 windows of 64 x 48 px a step" in said
    log = pd.read_csv(tmp_path / "net.csv")
    assert log.ap50.iloc[-1] > 50.0
    assert log.loss.iloc[-1] < 0.7 * log.loss.iloc[0]
    assert not (tmp_path / "net.events").exists()  # what RAW was converted to is gone
    found = tmp_path / "found.csv"
    video = tmp_path / "gen1" / "val" / "c_td.h5"
    assert main(["detect", "--events", str(video), "--detector-events", str(out), "--out", str(found)]) == 0
    assert pd.read_csv(found).sensor.eq("evt").all()
