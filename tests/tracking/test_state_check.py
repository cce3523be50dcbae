"""A state that is read back may be damaged, or somebody else's: it is refused in one line, never believed."""

from __future__ import annotations

import json
import os
import zipfile

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.config.reading import load_config
from jeat_graph.data.errors import DataError, JeatGraphError
from jeat_graph.io.files.state_file import digest, read_state_file
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.checkpoint import save_state
from jeat_graph.tracking.tracker import Tracker


@pytest.fixture(scope="module")
def tracker() -> Tracker:
    """A tracker of three vehicles, in a scene that it knows for four seconds."""
    tracker = Tracker(load_config("default"))
    for k in range(40):
        boxes = [[100.0 + 4 * k, 100.0 + 150 * i, 60.0, 40.0] for i in range(3)]
        for name in ("rgb", "evt"):
            tracker.step([(0.1 * k + 0.001 * len(name), name, boxes, [0.9] * 3)])
    return tracker


@pytest.fixture
def saved(tracker, tmp_path):
    path = tmp_path / "state.npz"
    tracker.save(path)
    return path


def members(path) -> dict[str, np.ndarray]:
    with np.load(path) as file:
        return dict(file)


def test_what_was_saved_is_taken(saved, tracker):
    np.testing.assert_array_equal(Tracker.load(saved).causal().boxes, tracker.causal().boxes)


@pytest.mark.parametrize("name", ["text", "block", "sha256"])
def test_one_changed_byte_is_damage_though_the_archive_is_whole(saved, name):
    arrays = members(saved)
    arrays[name] = arrays[name].copy()
    arrays[name][len(arrays[name]) // 2] ^= 1
    np.savez(saved, **arrays)
    with pytest.raises(DataError, match=r"state\.npz: is damaged"):
        Tracker.load(saved)


@pytest.mark.parametrize("name", ["text", "block", "sha256"])
@pytest.mark.parametrize(
    "value", [None, np.zeros(3), np.zeros((2, 2), np.uint8), np.zeros(3, "U4"), np.zeros(3, ">u8")]
)
def test_what_is_missing_or_of_another_kind_is_no_tracker(saved, name, value):
    arrays = members(saved)
    arrays = {key: array for key, array in arrays.items() if key != name}
    np.savez(saved, **(arrays if value is None else arrays | {name: value}))
    with pytest.raises(DataError, match=r"state\.npz: is no saved tracker"):
        Tracker.load(saved)


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_packed_members_are_refused_before_they_are_unpacked(saved, method):
    with zipfile.ZipFile(saved) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(saved, "w", method) as archive:
        for name, part in parts.items():
            archive.writestr(name, part)
    with pytest.raises(DataError, match="is no saved tracker"):
        Tracker.load(saved)


@pytest.mark.parametrize(("at", "value"), [(6, 0x1), (8, 99)])  # flags: encrypted; an unknown method
def test_an_archive_that_cannot_be_unpacked_is_refused(saved, at, value):
    data = bytearray(saved.read_bytes())
    for mark, shift in ((b"PK\x03\x04", 0), (b"PK\x01\x02", 2)):
        begin = data.find(mark)
        while begin >= 0:
            data[begin + at + shift] = value
            begin = data.find(mark, begin + 1)
    saved.write_bytes(data)
    with pytest.raises(DataError, match="is no saved tracker"):
        Tracker.load(saved)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"\x93NUMPY", b"[" * 100_000])
def test_what_is_empty_cut_or_garbage_is_no_tracker(tmp_path, content):
    path = tmp_path / "state.npz"
    path.write_bytes(content)
    with pytest.raises(DataError, match="is no saved tracker"):
        Tracker.load(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes of POSIX")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "state.npz")
    with pytest.raises(DataError, match="is a pipe"):
        Tracker.load(tmp_path / "state.npz")


@pytest.mark.parametrize(
    "key",
    [
        "model",
        "sensors",
        "classes",
        "appearance",
        "order",
        "boxes",
        "class_ids",
        "called",
        "finished",
        "diagnostics",
        "log",
    ],
)
def test_a_state_without_a_part_is_refused(tracker, tmp_path, key):
    state = {name: value for name, value in tracker.state().items() if name != key}
    save_state(tmp_path / "s.npz", tracker.config, state)
    with pytest.raises(DataError, match=r"s\.npz: is damaged"):
        Tracker.load(tmp_path / "s.npz")


@pytest.mark.parametrize("key", ["rewinding", "base", "newest", "lateness", "more"])
def test_a_live_state_without_a_part_is_refused(tmp_path, key):
    live, path = LiveTracker(Tracker(load_config("default")), "rewind"), tmp_path / "s.npz"
    live.save(path)
    described, block = read_state_file(path, "saved tracker")
    described = described.replace(f'"{key}"'.encode(), b'"other"')
    parts = {"text": described, "block": block, "sha256": digest(described, block)}
    np.savez(path, **{name: np.frombuffer(part, np.uint8) for name, part in parts.items()})
    with pytest.raises(DataError, match=r"s\.npz: is damaged"):
        LiveTracker.load(path)


@pytest.mark.parametrize(
    "text",
    [
        '{"kinds": [], "tree": {"same": [99999999999, 0]}}',
        '{"kinds": [], "tree": ' + "[" * 9999 + "]" * 9999 + "}",
        '{"kinds": ["<f8"], "tree": {"array": [0, [[[9999999999]]], [0, "<f8", 1, 9999999999]]}}',
        '{"kinds": [], "tree": {"object": ["Snapshot", [0], 0, 99999999999, []]}}',
        '{"kinds": 3}',
        "[]",
    ],
)
def test_a_short_text_does_not_stand_for_more_memory_than_there_is(saved, text):
    described, block = read_state_file(saved, "saved tracker")
    described = described.split(b"\n")[0] + b"\n" + text.encode()
    parts = {"text": described, "block": block, "sha256": digest(described, block)}
    np.savez(saved, **{name: np.frombuffer(part, np.uint8) for name, part in parts.items()})
    with pytest.raises(DataError, match=r"state\.npz: is damaged"):
        Tracker.load(saved)


@pytest.mark.parametrize("settings", [None, [], {"sensors": 3}, {"filter": {"x": 1}}])
def test_settings_that_are_none_are_refused_with_the_files_name(saved, settings):
    described, block = read_state_file(saved, "saved tracker")
    head, _, text = described.partition(b"\n")
    head = json.dumps(json.loads(head) | {"config": settings}).encode()
    described = head + b"\n" + text
    parts = {"text": described, "block": block, "sha256": digest(described, block)}
    np.savez(saved, **{name: np.frombuffer(part, np.uint8) for name, part in parts.items()})
    with pytest.raises(JeatGraphError, match=r"state\.npz"):
        Tracker.load(saved)


def test_stream_says_it_in_one_line(tmp_path, capsys):
    path = tmp_path / "state.npz"
    path.write_bytes(b"PK garbage")
    assert main(["stream", "--checkpoint", str(path), "--image", "640x480"]) == 2
    said = capsys.readouterr().err
    assert said == f"jeat-graph stream: {path}: is no saved tracker (BadZipFile)\n"


FORGED = {
    "tracks.hits": [-1e40, -1e-9, 1e40],
    "tracks.misses": [-1e40, -1.0],
    "tracks.stationary_hits": [1e9],
    "tracks.total_weight": [-1.0],
    "tracks.detections": [0.0, -1.0],
    "tracks.overlap": [-0.1, 2.0],
    "tracks.missed": [-1.0, np.nan],
    "tracks.found": [2],
    "tracks.owner": [-1, 99],
    "tracks.last_s": [np.nan, np.inf, 1e6],
    "tracks.born_s": [1e6, np.nan],
    "tracks.confirmed_s": [np.nan, 1e6],
    "tracks.last_box_s": [np.inf],
    "tracks.used": [-1, 1 << 40],
    "tracks.presence": [-0.1, 0.5, 2.0],
    "tracks.recent_misses": [-1.0],
    "tracks.real": [1.5, -0.5],
    "tracks.sees": [-0.5, 1.5],
    "tracks.awaited": [2],
    "tracks.covariance": [-1.0, 0.0, np.nan],
    "tracks.mean": [1e71, np.nan],
    "sensor0.leftovers": [-1.0],
    "sensor0.false_boxes": [-5.0],
    "sensor0.period_s": [-1.0, np.inf],
    "sensor0.last_scan_s": [1e9, np.inf],
    "sensor0.boxes": [-1.0],
    "sensor0.repeated": [1e9],
    "sensor0.boxes_at_edge": [-1.0],
    "process_noise.jerk": [1e3, -1e3],
    "camera.shift": [0.0, -1.0],
    "gaps.ended": [-1.0],
    "gaps.ended_well": [1e9],
    "belief.p_detect": [0.0, 1.0, -1.0],
    "belief.unseen": [0.0, 1.0],
    "belief.noise_share": [0.0, 1.0],
    "belief.prior_odds": [1e5],
    "offsets.weight": [-1.0],
    "accuracy.pairs": [-1.0],
    "accuracy.aspect": [np.inf],
    "accuracy.lasting": [-1.0, np.inf],
    "belief.score_weight": [-1.0, np.inf],
    "belief.stationary_prior": [-0.1, 1.5],
    "sensor0.given_lasting": [-1.0, 4.0],
    "sensor0.given_weight": [-1.0, np.inf],
    "sensor0.persistence.pairs": [-1.0, np.nan],
    "sensor0.recurrence.product": [np.inf],
    "sensor0.mean_spread": [-1.0, 0.0, np.inf],
    "tracks.apart": [1e9],
    "tracks.apart_s": [1e9],
    "log_side_variance": [1e4],
    "next_id": [0, 1 << 62 | 1],
    "learnt_s": [np.inf, 1e9],
    "t": [np.nan, np.inf, -1e6],
    "histories.t": [np.nan, -1e9, 1e9],
    "histories.dt": [-1.0, np.nan],
    "histories.real": [2.0],
    "histories.later": [2.0, np.nan],
    "histories.last_later": [2.0, np.nan],
    "histories.given": [0, -3],
    "histories.covariance": [-1.0],
    "histories.predicted_mean": [1e71],
    "histories.given_missed": [-2.0, np.nan],
    "histories.missed": [-1.0, np.nan],
}


@pytest.mark.parametrize("name", FORGED)
def test_a_state_that_no_step_leaves_behind_is_refused(tracker, name):
    """What a step divides by, takes the logarithm of, counts up from, or orders by."""
    model = tracker._model
    good = dict(model.state())
    model.set_state(good)
    place = {"histories.t": 1}.get(name, 0)
    for value in FORGED[name]:
        forged = good[name].copy()
        forged.reshape(-1)[place] = value
        with pytest.raises(ValueError, match=r"[a-z]"):
            model.set_state({**good, name: forged})
    assert {key: column.tobytes() for key, column in model.state().items()} == {
        key: column.tobytes() for key, column in good.items()
    }


def test_a_covariance_that_is_symmetric_but_not_positive_is_refused(tracker):
    good = dict(tracker._model.state())
    covariance = good["tracks.covariance"].copy()
    block = covariance.reshape(-1, 7, 7)[0]
    std = np.sqrt(np.diag(block))
    # Each pair could be: all three together cannot.
    for i, j, correlation in ((0, 1, 0.9), (1, 2, 0.9), (0, 2, -0.9)):
        block[i, j] = block[j, i] = correlation * std[i] * std[j]
    with pytest.raises(ValueError, match="no covariance"):
        tracker._model.set_state({**good, "tracks.covariance": covariance})
