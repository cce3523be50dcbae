"""An option that would do nothing is refused."""

from __future__ import annotations

import pytest

from jeat_graph.cli.main import main


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (("export", "run", "--to", "coco", "--track", "1"), "--track is for --to tum, not coco"),
        (("export", "run", "--to", "rvt", "--only", "causal"), "--only is for --to coco or cvat"),
        (("export", "run", "--to", "cvat", "--start", "0"), "--start is for --to ottrk, not cvat"),
        (("detect", "--frames", "a.mp4", "--detector-events", "sehn"), "--detector-events says nothing with"),
        (("detect", "--events", "a.raw", "--detector-frames", "sehn"), "nothing without --frames"),
        (("track", "--frames", "a.mp4", "--event-rate", "20"), "--event-rate says nothing without --events"),
    ],
)
def test_an_option_of_something_else_is_refused(tmp_path, fails, command, words):
    assert words in fails(*command, "--out", tmp_path / "out.csv")


def test_time_between_checkpoints_needs_a_checkpoint(fails):
    assert "it needs --checkpoint FILE" in fails("stream", "--every", "5")


def test_a_moment_after_the_end_is_not_drawn(tmp_path, write, fails):
    rows = [f"{k / 20},rgb,{100 + 2 * k},200,40,30,.9" for k in range(40)]
    run, out = str(tmp_path / "run"), tmp_path / "out.png"
    assert main(["track", write(*rows), "--out", run, "--image", "1280x720"]) == 0
    for at in ("99", "-9", "nan"):
        line = fails("render", run, "--at", at, "--out", str(out))
        assert f"nothing to draw at {at} s; the recording lasts from 0" in line
        assert not out.exists()
    assert main(["render", run, "--at", "1.96", "--out", str(out)]) == 0
