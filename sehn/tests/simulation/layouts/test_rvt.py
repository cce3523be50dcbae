"""What RVT's published code asks of its files, and what its preprocessing would make of the same events."""

from __future__ import annotations

import math
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph_sehn.simulation.layouts.histograms import halved, stacked_histogram
from jeat_graph_sehn.simulation.layouts.rvt import windows_for, write_rvt
from jeat_graph_sehn.simulation.layouts.rvt_input import write_rvt_input
from jeat_graph_sehn.simulation.layouts.sets import open_set
from jeat_graph_sehn.simulation.layouts.writing import write_layout
from jeat_graph_sehn.simulation.world.vehicles import KIND_NAMES

EVENTS = "event_representations_v2/stacked_histogram_dt=50_nbins=10"
KINDS = KIND_NAMES.tolist()

some_events = st.lists(
    st.tuples(st.integers(0, 50_000), st.integers(0, 3), st.integers(0, 2), st.integers(0, 1)), max_size=60
)


def counted(rows: list[tuple[int, int, int, int]], bins: int, most: int) -> np.ndarray:
    """The histogram one event after the other: (polarity, bin, row, column), channels merged at the end."""
    counts = np.zeros((2, bins, 3, 4), dtype=int)
    for t, x, y, p in rows:
        span = np.float32(max(rows[-1][0] - rows[0][0], 1))
        share = np.float32(t - rows[0][0]) / span * np.float32(bins)
        counts[p, min(math.floor(share), bins - 1), y, x] += 1
    return np.minimum(counts, most).reshape(2 * bins, 3, 4)


@given(some_events, st.integers(1, 10), st.integers(1, 3))
def test_a_histogram_has_darker_before_brighter_and_bins_between_its_own_first_and_last_event(
    rows, bins, most
):
    rows = sorted(rows)
    columns = np.array(rows, dtype=np.int64).reshape(-1, 4)
    events = EventArray(
        columns[:, 0],
        columns[:, 1].astype(np.uint16),
        columns[:, 2].astype(np.uint16),
        columns[:, 3].astype(np.uint8),
    )
    found = stacked_histogram(events, (4, 3), bins, most)
    assert found.dtype == np.uint8
    np.testing.assert_array_equal(found, counted(rows, bins, most))


def test_the_half_has_the_pixels_nearest_to_the_middles_of_its_own():
    counts = np.arange(2 * 6 * 8, dtype=np.uint8).reshape(2, 6, 8)
    nearest = [[math.floor((k + 0.5) * 2.0) for k in range(n)] for n in (3, 4)]
    np.testing.assert_array_equal(halved(counts), counts[:, nearest[0]][:, :, nearest[1]])


@given(st.lists(st.integers(1, 300_000), min_size=1, max_size=12))
def test_each_frame_is_the_end_of_a_window_and_windows_follow_one_another(gaps):
    frames = np.cumsum(gaps)
    windows = windows_for(frames)
    np.testing.assert_array_equal(windows.ends_us[windows.labelled], frames)
    assert windows.ends_us[-1] == frames[-1]
    assert (np.diff(windows.ends_us) > 0).all()
    before = windows.ends_us[: windows.labelled[0]]
    assert (before >= 50_000).all()  # whole windows only
    assert (np.diff([*before, frames[0]]) == 50_000).all()
    # As evenly as they can be: half a window too long or too short at most, where a frame leaves a choice.
    wide = np.diff(frames) >= 50_000
    steps = np.diff(windows.labelled)
    assert (np.abs(np.diff(frames) - 50_000 * steps)[wide] <= 25_000).all()
    assert (steps[~wide] == 1).all()


def test_what_is_written_is_what_its_reader_asserts(rectangle_set: Path, tmp_path: Path):
    """Each of these is an assertion, an index or a key of RVT's `SequenceBase` and `ObjectLabelFactory`."""
    written = write_layout(rectangle_set, "rvt", tmp_path / "rvt")
    assert written == (3, 0)
    whole = open_set(rectangle_set)
    assert {s.split for s in whole.segments} == {"train", "val", "test"}
    for segment in whole.segments:
        folder = tmp_path / "rvt" / segment.split / segment.name
        stored = np.load(folder / "labels_v2" / "labels.npz")
        labels, first = stored["labels"], stored["objframe_idx_2_label_idx"]
        assert first.dtype == np.int64
        assert first.ndim == 1
        assert len(first) == len(np.unique(labels["t"]))
        assert (np.diff([*first, len(labels)]) > 0).all()
        for name in ("t", "x", "y", "w", "h", "class_id", "class_confidence"):
            assert labels[name].astype("float32").shape == (len(labels),)
        assert (labels["x"] >= 0).all()
        assert (labels["x"] + labels["w"] <= 63).all()
        np.testing.assert_array_equal(np.load(folder / "labels_v2/timestamps_us.npy"), labels["t"][first])
        frame_of = np.load(folder / EVENTS / "objframe_idx_2_repr_idx.npy")
        ends = np.load(folder / EVENTS / "timestamps_us.npy")
        np.testing.assert_array_equal(ends[frame_of], labels["t"][first])
        with h5py.File(folder / EVENTS / "event_representations.h5") as file:
            data = file["data"][:]
        assert data.shape == (len(ends), 20, 48, 64)
        assert data.dtype == np.uint8
        with EventFile(segment.events) as events:
            for end, counts in zip(ends.tolist(), data, strict=True):
                part = events.between(end - 50_000, end + 1)
                assert counts[:10].sum() == (part.polarity == 0).sum()
                assert counts[10:].sum() == (part.polarity == 1).sum()


def test_boxes_are_cut_to_the_picture_and_small_ones_go(one_segment, tmp_path: Path):
    boxes = [[-4.0, 5.0, 20.0, 10.0], [60.0, 5.0, 20.0, 10.0], [10.0, 5.0, 20.0, 4.0]]
    segment = one_segment((64, 48), [100_000] * 3, boxes=boxes)
    assert write_rvt(segment, (64, 48), tmp_path / "out")
    labels = np.load(tmp_path / "out/train/000000/labels_v2/labels.npz")["labels"]
    assert labels["track_id"].tolist() == [1]  # the second has 3 px left, the third is 4 px high
    assert [labels[name][0] for name in ("x", "y", "w", "h")] == [0.0, 5.0, 16.0, 10.0]


def test_a_segment_without_boxes_is_left_out(one_segment, tmp_path: Path):
    segment = one_segment((64, 48), [100_000], boxes=[[10.0, 10.0, 3.0, 3.0]])
    assert not write_rvt(segment, (64, 48), tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("kind", "number"), [("car", 2), ("truck", 2), ("bus", 2), ("motorcycle", 1)])
def test_the_large_size_is_written_as_its_half_with_labels_of_the_whole(kind, number, one_segment, tmp_path):
    segment = one_segment((1280, 720), [100_000], KINDS.index(kind))
    assert write_rvt(segment, (1280, 720), tmp_path / "out")
    folder = tmp_path / "out/train/000000"
    with h5py.File(folder / EVENTS / "event_representations_ds2_nearest.h5") as file:
        assert file["data"].shape[1:] == (20, 360, 640)
    labels = np.load(folder / "labels_v2/labels.npz")["labels"]
    assert (labels["class_id"][0], labels["x"][0], labels["w"][0]) == (number, 10.0, 30.0)


def test_the_input_of_its_preprocessing_has_its_names_sizes_and_classes(one_segment, tmp_path: Path):
    segment = one_segment((304, 240), [100_000, 150_000], KINDS.index("van"))
    assert write_rvt_input(segment, (304, 240), tmp_path / "out")
    (labels,) = (tmp_path / "out/train").glob("*.npy")
    events = labels.parent / (labels.stem.split("bbox")[0] + "td.dat.h5")
    with h5py.File(events) as file:
        assert file["events"]["height"][()].item() == 240
        assert file["events"]["width"][()].item() == 304
        assert (np.diff(file["events"]["t"][:].astype(np.int64)) >= 0).all()
    assert np.load(labels)["class_id"].tolist() == [0, 0]


def test_a_motorcycle_is_no_class_of_the_small_set(one_segment, tmp_path: Path):
    segment = one_segment((304, 240), [100_000], KINDS.index("motorcycle"))
    assert not write_rvt_input(segment, (304, 240), tmp_path / "out")


@pytest.mark.parametrize(
    ("size_px", "words"), [((640, 384), "takes 1280 x 720 and 304 x 240"), ((1280, 720), "boxes at 20 Hz")]
)
def test_what_its_preprocessing_would_stumble_over_is_refused(size_px, words, one_segment, tmp_path: Path):
    segment = one_segment(size_px, [100_000, 150_000, 200_000])
    with pytest.raises(DataError, match=words):
        write_rvt_input(segment, size_px, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_boxes_at_30_hz_are_taken(one_segment, tmp_path: Path):
    segment = one_segment((1280, 720), [100_000, 133_333, 166_667, 200_000])
    assert write_rvt_input(segment, (1280, 720), tmp_path / "out")
    assert (tmp_path / "out/train/000000_td.h5").is_file()
