"""`--embedder`: what `detect` writes of each box, and where it says nothing."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.detection.colour_embedding import NUMBERS, ColourEmbedder
from jeat_graph.io.tables.detections_io import read_detections

from ..detection.moving import SIZE, picture_of

CAR = ((10, 60), (60, 8), (40, 20))


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """A folder of pictures, 10 Hz, of one thing that moves."""
    folder = tmp_path_factory.mktemp("raw") / "frames"
    folder.mkdir()
    rng = np.random.default_rng(0)
    background = rng.uniform(40, 120, (SIZE[1], SIZE[0]))
    for k in range(12):
        cv2.imwrite(str(folder / f"{k:06d}.png"), picture_of([(CAR, 200)], k / 10.0, background, rng))
    return folder


HOW = ["--detector-frames", "motion", "--rate", "10"]


@pytest.mark.parametrize("end", ["csv", "parquet"])
def test_detections_have_embeddings_and_nothing_else_changes(frames, tmp_path, end):
    plain, looks = tmp_path / f"plain.{end}", tmp_path / f"looks.{end}"
    assert main(["detect", "--frames", str(frames), *HOW, "--out", str(plain)]) == 0
    assert main(["detect", "--frames", str(frames), *HOW, "--embedder", "colour", "--out", str(looks)]) == 0
    found, without = read_detections(looks), read_detections(plain)
    assert without.embeddings is None
    np.testing.assert_array_equal(found.boxes, without.boxes)
    assert found.embeddings.shape == (len(found.boxes), NUMBERS)
    np.testing.assert_allclose(np.linalg.norm(found.embeddings, axis=1), 1.0, atol=1e-5)
    # Each is of its own picture.
    for scan in (found.scan(k) for k in range(found.num_scans)):
        picture = cv2.imread(str(frames / f"{round(scan.t * 10):06d}.png"))[..., ::-1]
        np.testing.assert_allclose(scan.embeddings, ColourEmbedder()(picture, scan.boxes), atol=1e-3)


def test_lines_have_them_too(frames, capsys):
    assert main(["detect", "--frames", str(frames), *HOW, "--embedder", "colour", "--out", "-"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    seen = [line for line in lines if line["boxes"]]
    assert seen
    assert all(np.shape(line["embeddings"]) == (len(line["boxes"]), NUMBERS) for line in seen)


def test_the_tracker_takes_them(frames, tmp_path):
    arguments = ["--frames", str(frames), *HOW, "--embedder", "colour", "--out", str(tmp_path / "run")]
    assert main(["track", *arguments]) == 0
    assert read_detections(tmp_path / "run" / "detections.csv").embeddings is not None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["detect", "--events", "e.raw", "--out", "x.csv"], "without --frames"),
        (
            ["detect", "--frames", "f", "--detector-fused", "sehn", "--out", "x.csv"],
            "without --detector-fused",
        ),
        (["track", "d.csv", "--out", "x"], "DETECTIONS have embeddings of their own"),
    ],
)
def test_where_it_says_nothing_it_is_refused(arguments, message, capsys):
    assert main([*arguments, "--embedder", "colour"]) == 2
    assert message in capsys.readouterr().err


def test_what_is_no_network_is_refused(frames, tmp_path, capsys):
    arguments = ["detect", "--frames", str(frames), *HOW, "--out", str(tmp_path / "x.csv")]
    assert main([*arguments, "--embedder", "resnet50"]) == 2
    assert "must be colour or FILE.onnx" in capsys.readouterr().err
