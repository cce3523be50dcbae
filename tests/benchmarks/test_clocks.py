"""A clock that steps in a live stream of a rig costs next to nothing; without being corrected it would."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks import clocks
from benchmarks.__main__ import main


def test_a_step_of_a_second_costs_less_than_two_points(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["clocks", "--quick", "--out", str(tmp_path)]) == 0
    assert "step of +1 s" in capsys.readouterr().out
    [row] = json.loads((tmp_path / "clocks.json").read_text(encoding="utf-8"))["clocks"]
    assert row["cost"] < 2.0


def test_a_clock_that_is_not_watched_loses_the_tracks(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same step with `input.clocks=as_given`: the events are ahead from then on."""
    scans, truth = clocks.draw(1, 30.0)
    monkeypatch.setattr(clocks, "_CONFIG", (*clocks._CONFIG, "input.clocks=as_given"))
    table = clocks.track(scans, "evt", lambda t: 1.0 * (t > clocks.STEP_AT_S))
    assert clocks.mota(table, truth) < 90.0
