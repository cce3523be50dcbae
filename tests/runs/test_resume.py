"""`track --resume`: a run that was broken off anywhere writes, in the end, what an unbroken one writes."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import time

import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.detections import Detections
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.runs import run_steps
from jeat_graph.tracking.tracker import Tracker

OPTIONS = ["--diagnostics", "--format", "parquet", "--set", "smoother.lag_s=0.3"]


class BrokenOffError(Exception):
    pass


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recording")
    assert main(["simulate", "night-sparse", "--out", str(folder), "--duration", "2", "--seed", "3"]) == 0
    return folder / "detections.csv"


@pytest.fixture(autouse=True)
def saved_often(monkeypatch):
    monkeypatch.setattr(run_steps, "STEPS_PER_DRAIN", 16)
    monkeypatch.setattr(run_steps, "STEPS_PER_SAVE", 48)


def track(recording, out, *options):
    return main(["track", str(recording), "--out", str(out), *OPTIONS, *options])


def broken_off(monkeypatch, recording, out, after, *options):
    """Track, and have it end in an error after so many steps."""
    with monkeypatch.context() as patch:
        taken, step = [], Tracker.step

        def steps(self, scans):
            if len(taken) == after:
                raise BrokenOffError
            taken.append(None)
            return step(self, scans)

        patch.setattr(Tracker, "step", steps)
        with pytest.raises(BrokenOffError):
            track(recording, out, *options)


def tables_of(out):
    return {path.name: path.read_bytes() for path in out.iterdir() if path.name != "run.json"}


def record_of(out):
    record = json.loads((out / "run.json").read_text())
    return {key: value for key, value in record.items() if key != "timings"}


@pytest.mark.parametrize(
    "setting", ["smoother.engine=fixed-lag", "smoother.engine=gtsam", "smoother.identities=lag"]
)
def test_broken_off_anywhere_and_gone_on_with_it_writes_the_same_files(
    setting, recording, tmp_path, monkeypatch
):
    options = ["--set", setting]
    assert track(recording, tmp_path / "whole", *options) == 0
    out = tmp_path / "broken"
    broken_off(monkeypatch, recording, out, 20, *options)  # before anything was saved
    broken_off(monkeypatch, recording, out, 100, "--resume", *options)  # 97 steps are saved
    broken_off(monkeypatch, recording, out, 30, "--resume", *options)
    broken_off(monkeypatch, recording, out, 60, "--resume", *options)
    assert not (out / "run.json").exists()
    assert track(recording, out, "--resume", *options) == 0
    assert tables_of(out) == tables_of(tmp_path / "whole")
    assert record_of(out) == record_of(tmp_path / "whole")


def test_a_run_without_the_option_begins_anew(recording, tmp_path, monkeypatch):
    out = tmp_path / "out"
    broken_off(monkeypatch, recording, out, 60)
    steps = []
    monkeypatch.setattr(Detections, "batches", _counted(Detections.batches, steps))
    assert track(recording, out) == 0
    assert len(steps) == len(read_detections(recording).scan_t)
    assert not (out / ".resume").exists()


def _counted(batches, into):
    def counted(self):
        for batch in batches(self):
            into.extend(batch)
            yield batch

    return counted


def test_what_was_left_by_another_run_is_refused_with_a_sentence(recording, tmp_path, monkeypatch, capsys):
    out = tmp_path / "out"
    broken_off(monkeypatch, recording, out, 60)
    assert track(recording, out, "--resume", "--set", "output.clip=false") == 2
    assert "was left by a run with other settings" in capsys.readouterr().err
    (out / ".resume" / "state.npz").write_bytes(b"damaged")
    assert track(recording, out, "--resume") == 2
    assert "no saved tracker" in capsys.readouterr().err
    assert track(recording, out) == 0


def test_rows_that_are_missing_are_noticed(recording, tmp_path, monkeypatch, capsys):
    out = tmp_path / "out"
    broken_off(monkeypatch, recording, out, 60)
    (out / ".resume" / "rows.bin").write_bytes(b"")
    assert track(recording, out, "--resume") == 2
    assert "shorter than when the state was saved" in capsys.readouterr().err


def test_a_tracker_that_is_not_saved_cannot_be_gone_on_with(recording, tmp_path, capsys):
    assert track(recording, tmp_path / "out", "--resume", "--set", "tracker.engine=reference") == 2
    assert "--resume does not go with tracker.engine=reference" in capsys.readouterr().err


def test_killed_at_random_moments_it_goes_on(tmp_path, full):
    """The command itself, killed again and again until it is through."""
    if not full:
        pytest.skip("the long form only: a recording long enough to be saved on the way")
    assert main(["simulate", "night-sparse", "--out", str(tmp_path), "--duration", "200", "--seed", "3"]) == 0
    command = [sys.executable, "-m", "jeat_graph.cli.main", "track", str(tmp_path / "detections.csv")]
    subprocess.run([*command, "--out", str(tmp_path / "whole")], check=True, env=os.environ)
    rng, kills = random.Random(1), 0
    while True:
        process = subprocess.Popen([*command, "--out", str(tmp_path / "killed"), "--resume"])
        if kills < 10:
            time.sleep(rng.uniform(3.0, 25.0))
            process.kill()
        if process.wait() == 0:
            break
        kills += 1
    assert kills
    assert tables_of(tmp_path / "killed") == tables_of(tmp_path / "whole")
