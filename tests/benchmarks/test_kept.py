"""What detectors found is kept from one run to the next, and taken only if nothing has changed."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from benchmarks import kept
from benchmarks.kept import digest, kept_or_found, read_kept, write_kept
from benchmarks.raw_segments import Finding, RawSegment
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.detection.settings import load_settings

from .test_raw import write_segment


@pytest.fixture(scope="module")
def segment(tmp_path_factory):
    folder = tmp_path_factory.mktemp("set") / "000000"
    write_segment(folder)
    return RawSegment("set", "000000", folder)


def test_detections_come_back_bit_by_bit(tmp_path):
    rng = np.random.default_rng(0)
    counts = {0.0: 2, 1.0 / 3.0: 0, 2.0 / 3.0: 3}
    scans = [Scan(t, "rgb", rng.random((n, 4)) + 1.0, rng.random(n)) for t, n in counts.items()]
    detections = Detections.from_scans(scans)
    write_kept(detections, tmp_path / "new" / "one.npz")
    again = read_kept(tmp_path / "new" / "one.npz")
    assert again is not None
    assert again.sensors == ("rgb",)
    for name in ("scan_t", "scan_sensor", "scan_start", "boxes", "scores"):
        np.testing.assert_array_equal(getattr(again, name), getattr(detections, name))
    assert again.classes is None


def test_nothing_and_damage_are_no_detections(tmp_path):
    assert read_kept(tmp_path / "none.npz") is None
    (tmp_path / "half.npz").write_bytes(b"PK\x03\x04half")
    assert read_kept(tmp_path / "half.npz") is None


def test_the_second_run_does_not_detect(segment, tmp_path, monkeypatch):
    job = (Finding(segment, "rgb", "motion"), str(tmp_path))
    first = kept_or_found(job)
    assert len(first.detections.scores) > 0
    monkeypatch.setattr(kept, "find_in", lambda finding: pytest.fail("detected again"))
    second = kept_or_found(job)
    np.testing.assert_array_equal(first.detections.boxes, second.detections.boxes)


def test_whatever_a_result_follows_from_changes_the_name(segment, tmp_path, monkeypatch):
    settings = load_settings(None, ["model_frames.score=0.2"])
    other = RawSegment("set", "000000", tmp_path / "000000")
    shutil.copytree(segment.folder, other.folder)
    first = digest(Finding(segment, "rgb", "motion"))
    assert digest(Finding(other, "rgb", "motion")) == first
    (other.folder / "frames.csv").write_text("index,t_us\n0,0\n")
    names = {
        first,
        digest(Finding(segment, "evt", "motion")),
        digest(Finding(segment, "rgb", "motion", settings)),
        digest(Finding(segment, "rgb", "sehn")),
        digest(Finding(other, "rgb", "motion")),
    }
    monkeypatch.setattr(kept, "_code", lambda: "other code")
    names.add(digest(Finding(segment, "rgb", "motion")))
    assert len(names) == 6
