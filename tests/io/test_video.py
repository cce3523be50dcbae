"""Frames: lossless where it says so, in the right order, by number, with their times."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.io.media.video import _spread, open_frames
from jeat_graph.io.media.video_writer import FrameWriter

SIZE = (64, 48)
RED = np.zeros((48, 64, 3), dtype=np.uint8) + np.array([250, 10, 20], dtype=np.uint8)


def pictures(count: int, seed: int = 0) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [rng.integers(0, 256, (48, 64, 3), dtype=np.uint8) for _ in range(count)]


def write(folder: Path, video: str, frames: list[np.ndarray], times: list[int] | None = None) -> Path:
    with FrameWriter(folder, video, SIZE, 20.0) as writer:
        for k, frame in enumerate(frames):
            writer.append(times[k] if times else 50_000 * k, frame)
    return folder


@pytest.mark.parametrize("video", ["lossless", "png"])
def test_lossless_frames_come_back_bit_for_bit(tmp_path: Path, video: str) -> None:
    frames = pictures(5)
    with open_frames(write(tmp_path, video, frames)) as source:
        assert len(source) == 5
        assert source.size_px == SIZE
        for k, frame in enumerate(frames):
            assert np.array_equal(source.frame(k), frame)


@pytest.mark.parametrize("video", ["mp4", "webm"])
def test_lossy_frames_come_back_in_their_colours(tmp_path: Path, video: str) -> None:
    with open_frames(write(tmp_path, video, [RED] * 3)) as source:
        assert len(source) == 3
        assert np.abs(source.frame(2).astype(int) - RED).mean() < 6


@pytest.mark.parametrize("video", ["mp4", "webm", "lossless", "png"])
def test_the_same_frames_give_the_same_bytes(tmp_path: Path, video: str) -> None:
    folders = [write(tmp_path / name, video, pictures(3)) for name in "ab"]
    files = [{p.name: p.read_bytes() for p in folder.rglob("*") if p.is_file()} for folder in folders]
    assert files[0] == files[1]


def test_frames_can_be_asked_for_in_any_order(tmp_path: Path) -> None:
    frames = pictures(40)
    with open_frames(write(tmp_path, "lossless", frames)) as source:
        for k in (39, 0, 17, 16, 3, 39):
            assert np.array_equal(source.frame(k), frames[k])
        with pytest.raises(IndexError):
            source.frame(40)


def test_frames_that_were_asked_for_are_decoded_once_and_let_go_when_they_are_passed(tmp_path: Path) -> None:
    frames = pictures(40)
    with open_frames(write(tmp_path, "png", frames)) as source:
        decoded: list[int] = []
        decode = source._decode.bgr
        source._decode.bgr = lambda index: decoded.append(index) or decode(index)  # type: ignore[method-assign]
        for k in range(0, 40, 4):
            source.frame(k)
        for k, (_, frame) in enumerate(source):
            assert np.array_equal(frame, frames[k])
        assert sorted(decoded) == list(range(40))
        assert not source._kept


def test_times_come_from_the_table_beside_the_video(tmp_path: Path) -> None:
    write(tmp_path, "lossless", pictures(3), [25_000, 76_000, 124_000])
    with open_frames(tmp_path / "frames.avi") as source:
        assert source.times_s.tolist() == [0.025, 0.076, 0.124]
        assert [t for t, _ in source] == source.times_s.tolist()


def test_a_video_without_a_table_has_its_own_rate(tmp_path: Path) -> None:
    write(tmp_path, "mp4", pictures(3))
    (tmp_path / "frames.csv").unlink()
    with open_frames(tmp_path / "frames.mp4") as source:
        assert source.times_s == pytest.approx([0.0, 0.05, 0.1])
    with open_frames(tmp_path / "frames.mp4", rate_hz=10) as source:
        assert source.times_s == pytest.approx([0.0, 0.1, 0.2])


def test_pictures_are_in_natural_order(tmp_path: Path) -> None:
    for number in (10, 9, 1):
        cv2.imwrite(str(tmp_path / f"img{number}.png"), np.full((4, 6, 3), number, dtype=np.uint8))
    with open_frames(tmp_path, rate_hz=20) as source:
        assert [int(frame[0, 0, 0]) for _, frame in source] == [1, 9, 10]
    with pytest.raises(DataError, match="give the frame rate"):
        open_frames(tmp_path)


def test_a_table_of_another_length_is_refused(tmp_path: Path) -> None:
    write(tmp_path, "png", pictures(3))
    (tmp_path / "frames" / "000001.png").unlink()
    with pytest.raises(DataError, match=r"has 2 frames, but .*frames\.csv has 3"):
        open_frames(tmp_path)


def test_times_that_do_not_ascend_are_named_by_line(tmp_path: Path) -> None:
    write(tmp_path, "png", pictures(2))
    (tmp_path / "frames.csv").write_text("index,t_us\n0,50\n1,50\n")
    with pytest.raises(DataError, match=r"frames\.csv:3: t_us must ascend"):
        open_frames(tmp_path)


@pytest.mark.parametrize("name", ["nothing.mp4", "empty", "text.mp4", "pictures"])
def test_what_cannot_be_read_is_one_line(
    tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.mp4").write_text("not a video")
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "a.png").write_text("not a picture")
    with pytest.raises(DataError):
        open_frames(tmp_path / name, rate_hz=20)
    assert capfd.readouterr().err == ""


def test_pictures_of_different_sizes_are_refused(tmp_path: Path) -> None:
    for k, width in enumerate((6, 8)):
        cv2.imwrite(str(tmp_path / f"{k}.png"), np.zeros((4, width, 3), dtype=np.uint8))
    with open_frames(tmp_path, rate_hz=20) as source, pytest.raises(DataError, match="8 x 4 px"):
        source.frame(1)


def test_a_failed_recording_leaves_no_video(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="does not follow"):
        write(tmp_path, "mp4", pictures(2), [50, 50])
    assert list(tmp_path.iterdir()) == []


def test_a_frame_of_another_size_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="frame must be"):
        write(tmp_path, "mp4", [np.zeros((10, 10, 3), dtype=np.uint8)])


def test_an_unknown_kind_of_video_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="mp4, webm, lossless, png"):
        FrameWriter(tmp_path, "gif", SIZE, 20.0)


@pytest.mark.parametrize("video", ["mp4", "webm", "lossless", "png"])
def test_nothing_is_said_on_stderr(tmp_path: Path, video: str, capfd: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, video, [RED] * 3)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("video", ["mp4", "webm", "lossless"])
def test_a_video_that_is_not_whole_is_told_of_and_leaves_nothing(tmp_path: Path, video: str) -> None:
    """The library that writes it says nothing of a disk that is full."""

    class Deaf:
        def __init__(self, sink) -> None:
            self.write, self.release, self.isOpened = lambda _: None, sink.release, sink.isOpened

    def half_written() -> None:
        with FrameWriter(tmp_path, video, SIZE, 20.0) as writer:
            for k, frame in enumerate(pictures(5)):
                writer.append(50_000 * k, frame)
                if k == 1:
                    writer._sink = Deaf(writer._sink)

    with pytest.raises(DataError, match=r"frames\.\w+: only 2 of 5 pictures could be written; is the disk"):
        half_written()
    assert list(tmp_path.iterdir()) == []


def test_a_gap_is_no_part_of_the_rate():
    """25 Hz with a gap of 10 s is 25 a second, and a gap."""
    times = np.concatenate([np.arange(20) / 25.0, 10.0 + np.arange(20) / 25.0])
    assert _spread(times) == "25 a second, 1 gap(s) of up to 9.24 s"
    assert _spread(times[:20]) == "25 a second"
    assert _spread(np.cumsum([0.0, *[1 / 30] * 20, *[1 / 15] * 20])) == "15 to 30 a second"
