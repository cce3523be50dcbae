"""Where no vehicles are looked for: polygons, and a clock that is burnt into the pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.cli.main import main
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.detection.burnt_in import find_clock
from jeat_graph.detection.masks import Masks, read_masks

STREET = Path(__file__).parents[3] / "shared" / "data" / "street"
LEFT_HALF = "0,0,50,0,50,100,0,100"


def test_boxes_that_lie_mostly_in_a_mask_are_left_out():
    masked = read_masks([LEFT_HALF]).on((100, 100))
    boxes = np.array(
        [[10, 10, 20, 20], [45, 10, 20, 20], [35, 10, 20, 20], [70, 70, 10, 10], [-30, 0, 60, 9]]
    )
    scan = Scan(1.0, "rgb", boxes.astype(float), np.full(5, 0.9), np.array(list("abcde")))
    assert masked.scan(scan).classes.tolist() == ["b", "d"]
    looks = replace(scan, embeddings=np.eye(5))
    np.testing.assert_array_equal(masked.scan(looks).embeddings, np.eye(5)[[1, 3]])


@given(st.integers(0, 10**6))
def test_what_is_masked_is_counted_pixel_by_pixel(seed):
    rng = np.random.default_rng(seed)
    corners = rng.integers(0, 60, (4, 2))
    pixels = np.zeros((50, 60), dtype=np.uint8)
    cv2.fillPoly(pixels, [corners.astype(np.int32)], (1,))
    masked = Masks((tuple(map(tuple, corners.astype(float))),)).on((60, 50))
    left, top = rng.integers(0, 40, (2, 8))
    sizes = rng.integers(1, 10, (8, 2))
    boxes = np.column_stack([left, top, sizes]).astype(float)
    expected = [pixels[y : y + h, x : x + w].mean() <= 0.5 for x, y, w, h in boxes.astype(int).tolist()]
    assert masked.keep(boxes).tolist() == expected


def test_masks_come_from_files_and_from_the_command_line(tmp_path):
    file = tmp_path / "masks.yaml"
    file.write_text("masks: {sky: [[0, 0], [100, 0], [100, 20], [0, 20]], shop: [[5, 3], [9, 3], [9, 4]]}\n")
    found = read_masks([str(file), LEFT_HALF])
    assert [len(polygon) for polygon in found.polygons] == [4, 3, 4]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1,2,3", "must be 3 corners or more"),
        ("1,2,3,4", "must be 3 corners or more"),
        ("0,0,9,x,9,9", "must be FILE.yaml, or corners"),
        ("0,0,9,nan,9,9", "must be 3 corners or more"),
        ("nothing.yaml", "nothing.yaml"),
        ("masks.yaml", "must hold masks: {name: [[x, y], …]}"),
        ("corners.yaml", "masks: sky: must be 3 corners or more"),
    ],
)
def test_what_is_no_mask_is_named(tmp_path, monkeypatch, text, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "masks.yaml").write_text("lines: {a: [0, 0, 1, 1]}\n")
    (tmp_path / "corners.yaml").write_text("masks: {sky: [[0, 0], [1], [2, 2]]}\n")
    with pytest.raises(DataError) as error:
        read_masks([text])
    assert words in str(error.value)


def clip(seconds=3.0, rate=10.0, offset_s=0.35, place=(60, 12), ticks=True, still=False):
    """Pictures of a car that drives by below a line of text whose last digit is that of the second."""
    rng = np.random.default_rng(0)
    street = rng.normal(110, 2, (120, 320)).clip(0, 255).astype(np.uint8)
    frames = []
    times = np.arange(round(seconds * rate)) / rate
    for t in times:
        picture = street.copy()
        if not still:
            x = int(20 + 60 * t)
            picture[80:100, x : x + 40] = 30
        second = int(t + offset_s) % 10 if ticks else 3
        cv2.rectangle(picture, (place[0] - 4, place[1] - 12), (place[0] + 150, place[1] + 3), 0, -1)
        cv2.putText(picture, f"27.11.2026 12:11:0{second}", place, cv2.FONT_HERSHEY_SIMPLEX, 0.4, 255, 1)
        frames.append(picture)
    return frames, times


def test_a_burnt_in_clock_is_found():
    left, top, width, height = find_clock(*clip())
    assert 50 <= left <= 62
    assert top < 6
    assert 165 <= left + width <= 180
    assert height < 24


@pytest.mark.parametrize(
    "how",
    [{"ticks": False}, {"place": (60, 60)}, {"seconds": 1.5}],
    ids=["a caption", "in the middle", "too short to tell"],
)
def test_what_is_no_clock_is_none(how):
    assert find_clock(*clip(**how)) is None


def test_the_clock_of_a_street_is_found_and_its_shop_windows_are_not():
    if not STREET.is_dir():
        pytest.skip(f"{STREET} is not there")
    from jeat_graph.io.media.video import open_frames

    for name, expected in (("cars-cyclist", (253, 0, 260, 29)), ("from-above", None)):
        with open_frames(STREET / f"{name}.mp4") as source:
            greys = [cv2.cvtColor(source.frame(k), cv2.COLOR_RGB2GRAY) for k in range(60)]
            assert find_clock(greys, source.times_s[:60]) == expected


@pytest.fixture
def frames(tmp_path):
    folder = tmp_path / "frames"
    folder.mkdir()
    for k, picture in enumerate(clip()[0]):
        cv2.imwrite(str(folder / f"{k:03d}.png"), picture)
    return folder


def detected(frames, *more):
    out = frames.parent / "out.csv"
    words = ["detect", "--frames", str(frames), "--rate", "10", "--detector-frames", "motion"]
    assert main([*words, "--out", str(out), *more]) == 0
    return pd.read_csv(out).dropna(subset=["left"])


def test_a_clock_is_masked_for_what_finds_what_moves(frames, capsys):
    assert (detected(frames).top > 40).all()
    assert "a burnt-in clock" in capsys.readouterr().err
    assert (detected(frames, "--mask", "none").top < 20).any()


def test_a_mask_hides_what_moves_in_it(frames):
    assert len(detected(frames)) > 10
    assert len(detected(frames, "--mask", "0,70,320,70,320,120,0,120")) == 0


def test_none_is_no_mask_beside_others(frames, capsys):
    words = ["detect", "--frames", str(frames), "--rate", "10", "--out", str(frames.parent / "o.csv")]
    assert main([*words, "--mask", "none", "--mask", LEFT_HALF]) == 2
    assert "goes with no other" in capsys.readouterr().err
