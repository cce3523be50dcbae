"""Old worlds that are rendered against forgetting can be learned from, and a part of them is held back."""

from __future__ import annotations

from jeat_graph_sehn.simulation.dataset.protocol import Protocol
from jeat_graph_sehn.teaching import old_worlds
from jeat_graph_sehn.training.data_sets import read_event_segments, split_by_segment


def test_they_are_learned_from_and_held_back(tmp_path, monkeypatch):
    for name, value in (("SCENARIOS", ("night",)), ("SEGMENTS", 2), ("_FRAMES", 2), ("_SIZE", (64, 48))):
        monkeypatch.setattr(old_worlds, name, value)
    done = []
    folders = old_worlds.render_old_worlds(tmp_path, events=True, seed=0, on_frames=done.append)
    assert sum(done) == old_worlds.old_frames() == 4
    assert folders == [tmp_path / "night"]
    members = read_event_segments(folders[0])
    split = split_by_segment(members, folders)
    assert (len(split.learned), len(split.judged)) == (1, 1)


def test_a_quarter_of_each_set_is_held_back():
    protocol = Protocol(old_worlds.SEGMENTS, old_worlds._SPLIT_SEED, old_worlds._SHARES)
    splits = [protocol.split_of(index) for index in range(old_worlds.SEGMENTS)]
    assert sorted(splits) == ["train", "train", "train", "val"]
