"""DSEC's pictures bring their times in a text file; event files say what they need to be read."""

from __future__ import annotations

import subprocess
import sys

import cv2
import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.dsec_writer import EventWriter
from jeat_graph.io.media.video import open_frames, peek

WITHOUT_PLUGIN = """
import sys
sys.modules["hdf5plugin"] = None
from jeat_graph.data.errors import DataError
from jeat_graph.io.events.dsec_hdf5 import EventFile
try:
    with EventFile(sys.argv[1]) as file:
        file.between(0, 10_000)
except DataError as error:
    print(error)
"""


@pytest.fixture
def pictures(tmp_path):
    """A folder as DSEC lays it out: pictures in `images/left/rectified`, `images/timestamps.txt`."""
    folder = tmp_path / "images" / "left" / "rectified"
    folder.mkdir(parents=True)
    for k in range(3):
        cv2.imwrite(str(folder / f"{k:06d}.png"), np.full((20, 30, 3), 40 * k, np.uint8))
    (tmp_path / "images" / "timestamps.txt").write_text("49599300523\n49599350523\n49599400523\n")
    return folder


def test_times_come_from_the_text_file_above(pictures):
    with open_frames(pictures) as frames:
        np.testing.assert_allclose(frames.times_s, [49599.300523, 49599.350523, 49599.400523], rtol=1e-15)
    assert peek(pictures)[0] == (30, 20)
    assert peek(pictures)[1] == pytest.approx(20.0)


def test_times_that_do_not_ascend_are_named_by_their_line(pictures):
    (pictures / "timestamps.txt").write_text("100\n200\n200\n")
    with pytest.raises(DataError, match=r"timestamps\.txt:3: times must ascend"):
        open_frames(pictures)


def test_another_number_of_times_is_refused(pictures):
    (pictures / "timestamps.txt").write_text("100\n200\n")
    with pytest.raises(DataError, match=r"has 3 frames, but .*timestamps\.txt has 2"):
        open_frames(pictures)


def test_a_blosc_file_without_its_filter_names_the_extra(tmp_path):
    pytest.importorskip("hdf5plugin")
    n = 4000
    events = EventArray(np.arange(n), np.zeros(n, np.uint16), np.zeros(n, np.uint16), np.ones(n, np.uint8))
    with EventWriter(tmp_path / "e.h5", (64, 48), compression="blosc") as file:
        file.append(events)
    command = [sys.executable, "-c", WITHOUT_PLUGIN, tmp_path / "e.h5"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "pip install 'hdf5plugin>=5'" in done.stdout
    assert done.stdout.count("\n") == 1
