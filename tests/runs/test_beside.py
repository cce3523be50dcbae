"""Picture size and frame rate come from the files beside a recording."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.errors import DataError
from jeat_graph.eval.load import load_run
from jeat_graph.io.media.video_writer import FrameWriter
from jeat_graph.runs.beside import facts_beside, facts_of_frames, rate_of_truth, with_picture
from jeat_graph.runs.track_files import TrackRequest

INFO = "[Sequence]\nname=a\nimDir=img1\nframeRate=25\nseqLength=10\nimWidth=1920\nimHeight=1080\nimExt=.jpg\n"
MOT = "".join(f"{k},1,{100 + k},200,40,30,1\n" for k in range(1, 11))


@pytest.fixture
def sequence(tmp_path):
    """A MOTChallenge sequence: `det/det.txt` and `gt/gt.txt` below `seqinfo.ini`."""
    (tmp_path / "seqinfo.ini").write_text(INFO)
    for name in ("det", "gt"):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"{name}.txt").write_text(MOT)
    return tmp_path


@pytest.fixture
def run(tmp_path):
    """A run directory whose input was read at 25 Hz, as far as its record goes."""
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "run.json").write_text(json.dumps({"reading": {"rate_hz": 25.0}}))
    return folder


def test_seqinfo_tells_the_size_of_the_picture(sequence):
    facts = facts_beside([sequence / "det" / "det.txt"])
    assert facts is not None
    config, notes = with_picture(load_config("default"), [], facts)
    assert (config.image.width, config.image.height) == (1920, 1080)
    assert notes == [f"picture of 1920 x 1080 px, as {sequence / 'seqinfo.ini'} says"]


@pytest.mark.parametrize("override", ["image.width=1000", "image={width: 1000, height: 500}"])
def test_what_the_user_says_goes_before(sequence, override):
    config = load_config("default", [override])
    assert with_picture(config, [override], facts_beside([sequence / "det" / "det.txt"])) == (config, [])


def test_nothing_is_known_without_seqinfo_or_where_two_disagree(sequence, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    (other / "det.txt").write_text(MOT)
    (other / "seqinfo.ini").write_text(INFO.replace("1920", "1280"))
    assert facts_beside([sequence / "det" / "det.txt", other / "det.txt"]) is None
    (other / "seqinfo.ini").unlink()
    (sequence / "seqinfo.ini").unlink()
    assert facts_beside([other / "det.txt"]) is None


def test_a_video_tells_size_and_rate(tmp_path):
    with FrameWriter(tmp_path, "lossless", (64, 48), 20.0) as writer:
        for k in range(4):
            writer.append(50_000 * k, np.zeros((48, 64, 3), dtype=np.uint8))
    facts = facts_of_frames(tmp_path / "frames.avi")
    assert facts.size_px == (64, 48)
    assert facts.rate_hz == pytest.approx(20.0)
    (tmp_path / "det.txt").write_text(MOT)
    request = TrackRequest((str(tmp_path / "det.txt"),), "run", frames=str(tmp_path))
    assert request.with_facts()[0].rate_hz == pytest.approx(20.0)
    assert TrackRequest((request.detections[0],), "run", rate_hz=5.0, frames=request.frames).with_facts()[
        0
    ].rate_hz == pytest.approx(5.0)


def test_a_rate_that_seqinfo_or_the_run_contradicts_is_refused(sequence, run):
    truth = sequence / "gt" / "gt.txt"
    assert rate_of_truth("result.txt", truth, None) is None
    assert rate_of_truth("result.txt", truth, 25.0) == 25.0
    with pytest.raises(DataError, match=r"--rate 30 does not fit: .*seqinfo.ini says 25 Hz"):
        rate_of_truth("result.txt", truth, 30.0)
    (sequence / "seqinfo.ini").unlink()
    assert rate_of_truth(run, truth, None) == 25.0
    with pytest.raises(DataError, match="--rate 30 does not fit: the run"):
        rate_of_truth(run, truth, 30.0)


def test_a_rate_that_the_truth_contradicts_is_refused(sequence, tmp_path):
    result, truth = sequence / "det" / "det.txt", tmp_path / "gt.csv"
    rows = [f"{k / 25},1,{101 + k},200,40,30" for k in range(10)]
    header = "t,object_id,left,top,width,height\n"
    truth.write_text(header + "\n".join(rows) + "\n")
    with pytest.raises(DataError, match=r"gt\.csv: --rate 30 does not fit the truth, whose rate is 25 Hz"):
        load_run(result, truth, rate_hz=30.0)
    assert load_run(result, truth, rate_hz=25.0).causal is not None
    truth.write_text(header + "\n".join(rows[::5]) + "\n")  # truth of every fifth frame
    assert load_run(result, truth, rate_hz=25.0).causal is not None
