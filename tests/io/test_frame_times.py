"""Pictures have the times that their files have, not their number divided by a rate."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.io.media.frame_times import times_in_names, unit_of_whole
from jeat_graph.io.media.video import open_frames, peek
from tests.io.variable_rate import write_variable as video
from tests.io.variable_rate import write_video


def pictures(folder: Path, names: list[str]) -> Path:
    """Write one picture a name; its grey value is its place in `names`."""
    folder.mkdir(parents=True, exist_ok=True)
    for k, name in enumerate(names):
        cv2.imwrite(str(folder / name), np.full((16, 16, 3), k, dtype=np.uint8))
    return folder


def times(place: Path, rate_hz: float | None = None) -> list[float]:
    with open_frames(place, rate_hz) as frames:
        return frames.times_s.tolist()


VARIABLE = [0, 33, 67, 100, 167, 233, 300, 333]


def test_a_video_of_varying_rate_has_its_own_time_stamps(tmp_path: Path) -> None:
    place = video(tmp_path / "v.mp4", VARIABLE)
    assert times(place) == pytest.approx([t / 1000 for t in VARIABLE], abs=1e-9)
    with open_frames(place) as frames:
        assert "time stamps" in frames.clock
    assert times(place, 10) == pytest.approx(np.arange(8) / 10)


def test_stamps_that_round_a_steady_rate_are_that_rate(tmp_path: Path) -> None:
    """Matroska keeps milliseconds; a picture at 1/30 s is not at .033."""
    place = write_video(tmp_path / "v.mkv", 20)
    assert times(place) == pytest.approx(np.arange(20) / 30, abs=1e-12)


def test_a_table_of_another_video_is_refused(tmp_path: Path) -> None:
    place = video(tmp_path / "night.mp4", VARIABLE)
    (tmp_path / "frames.csv").write_text("index,t_us\n" + "".join(f"{k},{200_000 * k}\n" for k in range(8)))
    with pytest.raises(DataError, match=r"frames\.csv: lasts 1\.400 s, but .* 0\.333 s") as error:
        open_frames(place)
    # The advice, followed to the letter, works.
    assert "night.frames.csv" in str(error.value)
    (tmp_path / "frames.csv").rename(tmp_path / "night.frames.csv")
    assert times(place) == pytest.approx(0.2 * np.arange(8))


@pytest.mark.parametrize(
    ("text", "scale"), [("{:.4f}", 1.0), ("{:.0f}", 1e3), ("{:.0f}", 1e6), ("{:.0f}", 1e9)], ids=str
)
def test_a_list_of_times_beside_a_video_is_read(tmp_path: Path, text: str, scale: float) -> None:
    place = video(tmp_path / "v.mp4", VARIABLE)
    start = 1_600_000_000.25 if scale > 1.0 else 11.2
    rows = [text.format(scale * (start + t / 1000)) for t in VARIABLE]
    (tmp_path / "timestamps.txt").write_text("\n".join(rows) + "\n")
    assert times(place) == pytest.approx([start + t / 1000 for t in VARIABLE], abs=1e-3)


def test_whole_seconds_are_not_taken_for_milliseconds(tmp_path: Path) -> None:
    place = video(tmp_path / "v.mp4", VARIABLE)
    (tmp_path / "timestamps.txt").write_text("".join(f"{1_600_000_000 + k}\n" for k in range(8)))
    with pytest.raises(DataError, match=r"timestamps\.txt: one time a line, but in s, ms, us or ns"):
        open_frames(place)


def test_the_list_of_an_event_camera_data_set_is_read(tmp_path: Path) -> None:
    folder = pictures(tmp_path / "images", ["frame_00000000.png", "frame_00000001.png"])
    (tmp_path / "images.txt").write_text(
        "0.003811 images/frame_00000000.png\n0.047876 images/frame_00000001.png\n"
    )
    assert times(folder) == [0.003811, 0.047876]
    assert peek(folder)[1] == pytest.approx(1 / 0.044065)


def test_a_list_that_leaves_out_a_picture_is_refused(tmp_path: Path) -> None:
    folder = pictures(tmp_path / "images", ["a.png", "b.png"])
    (tmp_path / "images.txt").write_text("0.1 images/a.png\n")
    with pytest.raises(DataError, match=r"images\.txt: does not list b\.png"):
        open_frames(folder)


def test_a_list_of_something_else_is_no_list_of_times(tmp_path: Path) -> None:
    """COLMAP writes an images.txt too: poses, ten columns a line."""
    folder = pictures(tmp_path, ["a1.png", "a2.png"])
    (folder / "images.txt").write_text(
        "# poses\n1 .8 .4 .3 .2 0 0 1 1 a1.png\n\n2 .8 .4 .3 .2 0 0 1 1 a2.png\n"
    )
    assert times(folder, 10) == [0.0, 0.1]


@pytest.mark.parametrize(
    ("names", "right"),
    [
        (["1403636579763555584", "1403636579813555456"], [1403636579.763555584, 1403636579.813555456]),
        (["1504645177420000", "1504645177470000"], [1504645177.42, 1504645177.47]),
        (["1606500000123", "1606500000173"], [1606500000.123, 1606500000.173]),
        (["0", "50000", "100000"], [0.0, 0.05, 0.1]),
        (["left_000050000", "left_000100000"], [0.05, 0.1]),
        (["1305031102_175304000", "1305031102_211214000"], [1305031102.175304, 1305031102.211214]),
        (["1305031102_75304000", "1305031102_211214000"], [1305031102.075304, 1305031102.211214]),
        (["1305031102.175304", "1305031102.211214"], [1305031102.175304, 1305031102.211214]),
        (["12.25", "12.5"], [12.25, 12.5]),
    ],
)
def test_names_that_are_times(tmp_path: Path, names: list[str], right: list[float]) -> None:
    folder = pictures(tmp_path, [f"{name}.png" for name in names])
    assert times(folder) == pytest.approx(right, abs=1e-6)
    with open_frames(folder) as frames:
        assert [int(picture[0, 0, 0]) for _, picture in frames] == list(range(len(names)))


@pytest.mark.parametrize(
    "names",
    [
        ["000000", "000001"],
        ["0", "50", "100"],
        ["img_20201127_184726", "img_20201127_184727"],
        ["a", "b"],
        ["7"],
    ],
)
def test_names_that_are_none(tmp_path: Path, names: list[str]) -> None:
    assert times_in_names(names) is None
    with pytest.raises(DataError, match="give the frame rate with --rate"):
        open_frames(pictures(tmp_path, [f"{name}.png" for name in names]))


@given(
    unit=st.sampled_from([("ms", 3), ("us", 6), ("ns", 9)]),
    start=st.floats(2e8, 4e9),
    rate=st.floats(1.5, 900.0),
)
def test_times_since_1970_tell_their_unit(unit: tuple[str, int], start: float, rate: float) -> None:
    name, digits = unit
    whole = np.round((start + np.arange(5) / rate) * 10.0**digits)
    assert unit_of_whole(whole) == name
