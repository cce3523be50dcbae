"""Data sets: the same bytes whatever happens on the way, and nothing that is half there."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections import namedtuple
from functools import partial
from pathlib import Path

import pytest
import yaml

from jeat_graph.data.errors import ConfigError, DataError, JeatGraphError
from jeat_graph_sehn.simulation.dataset import disk
from jeat_graph_sehn.simulation.dataset.layout import finished_segments
from jeat_graph_sehn.simulation.dataset.manifest import read_json
from jeat_graph_sehn.simulation.dataset.protocol import Protocol
from jeat_graph_sehn.simulation.dataset.recording import record_dataset
from jeat_graph_sehn.simulation.dataset.verify import verify

Usage = namedtuple("Usage", "total used free")
pytestmark = pytest.mark.usefixtures("forked_workers")


def test_two_processes_give_the_bytes_of_one(tmp_path: Path, make, fingerprints) -> None:
    make(tmp_path / "one", workers=1)
    make(tmp_path / "two", workers=2)
    assert fingerprints(tmp_path / "one") == fingerprints(tmp_path / "two")


def test_segments_differ_and_another_seed_gives_others(tmp_path: Path, make, fingerprints) -> None:
    make(tmp_path / "a", seed=1)
    make(tmp_path / "b", seed=2)
    a, b = fingerprints(tmp_path / "a"), fingerprints(tmp_path / "b")
    events = [a[f"segments/00000{k}/events.h5"] for k in range(3)] + [b["segments/000000/events.h5"]]
    assert len(set(events)) == 4


@pytest.mark.parametrize("workers", [1, 2])
def test_a_run_that_broke_down_goes_on_to_the_same_bytes(
    tmp_path: Path, make, fingerprints, workers: int
) -> None:
    make(tmp_path / "whole", segments=4)
    with pytest.raises(RuntimeError, match="power"):
        make(tmp_path / "broken", segments=4, fail_at=2, workers=workers)
    assert not (tmp_path / "broken" / "manifest.json").exists()
    assert 2 not in finished_segments(tmp_path / "broken")
    kept = {k: stamp(tmp_path / "broken", k) for k in finished_segments(tmp_path / "broken")}
    make(tmp_path / "broken", segments=4)
    assert fingerprints(tmp_path / "broken") == fingerprints(tmp_path / "whole")
    assert {k: stamp(tmp_path / "broken", k) for k in kept} == kept


def test_a_killed_process_leaves_what_the_next_run_goes_on_from(tmp_path: Path, make, fingerprints) -> None:
    script = Path(__file__).parent / "moving_rectangles.py"
    command = [sys.executable, script, tmp_path / "killed", "4", "2"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"waiting\n"  # two frames into the third segment
        process.kill()
    assert finished_segments(tmp_path / "killed") == [0, 1]
    for name in ("killed", "whole"):
        make(tmp_path / name, segments=4)
    assert fingerprints(tmp_path / "killed") == fingerprints(tmp_path / "whole")


def stamp(root: Path, index: int) -> int:
    return (root / "segments" / f"{index:06d}" / "segment.json").stat().st_mtime_ns


def test_a_process_that_dies_is_one_line_and_the_next_run_goes_on(tmp_path: Path, make, fingerprints) -> None:
    with pytest.raises(JeatGraphError, match="run again to go on"):
        make(tmp_path / "set", fail_at=1, dies=True, workers=2)
    make(tmp_path / "set")
    make(tmp_path / "whole")
    assert fingerprints(tmp_path / "set") == fingerprints(tmp_path / "whole")


def test_a_set_made_larger_is_the_larger_set(tmp_path: Path, make, fingerprints) -> None:
    make(tmp_path / "grown", segments=2)
    make(tmp_path / "grown", segments=5)
    make(tmp_path / "large", segments=5)
    assert fingerprints(tmp_path / "grown") == fingerprints(tmp_path / "large")


def test_a_finished_set_is_not_made_again(tmp_path: Path, make, fingerprints) -> None:
    make(tmp_path / "set")
    before = fingerprints(tmp_path / "set"), stamp(tmp_path / "set", 0)
    make(tmp_path / "set", fail_at=0)
    assert (fingerprints(tmp_path / "set"), stamp(tmp_path / "set", 0)) == before


def test_other_settings_are_refused_with_the_first_that_differs(tmp_path: Path, make) -> None:
    make(tmp_path / "set")
    with pytest.raises(ConfigError, match=r"source\.vehicles: 2 there, 3 wanted"):
        make(tmp_path / "set", vehicles=3)
    with pytest.raises(ConfigError, match=r"storage\.compression: gzip there, none wanted"):
        make(tmp_path / "set", compression="none")
    with pytest.raises(ConfigError, match="holds segment 000002 already; ask for at least 3"):
        make(tmp_path / "set", segments=2)


def test_a_folder_with_other_files_is_left_alone(tmp_path: Path, make) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(ConfigError, match="holds other files"):
        make(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_full_disk_is_refused_before_anything_is_written(tmp_path: Path, make, monkeypatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda path: Usage(10**9, 10**9, 1000))
    with pytest.raises(DataError, match=r"3 segments need about .* GB, and 1e-06 GB are free"):
        make(tmp_path / "set")
    assert not (tmp_path / "set").exists()


def test_a_disk_too_small_for_the_rest_stops_after_the_first_segment(
    tmp_path: Path, make, monkeypatch
) -> None:
    # Room for four segments as large as the first one turns out to be; without a reserve for once.
    make(tmp_path / "small", segments=1)
    size = read_json(tmp_path / "small" / "manifest.json")["totals"]["bytes"]
    monkeypatch.setattr(disk, "_RESERVE", 0)
    monkeypatch.setattr(disk, "_LEAST", 0)
    monkeypatch.setattr(disk, "segment_bound", lambda *a: 0)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: Usage(0, 0, int(4.9 * size)))
    with pytest.raises(DataError, match="what is done is kept"):
        make(tmp_path / "set", segments=10)
    assert finished_segments(tmp_path / "set") == [0]
    make(tmp_path / "set", segments=4)


@pytest.mark.parametrize(
    "options", [{"vehicles": 0}, {"with_events": False}, {"with_labels": False}, {"frames": 1}]
)
def test_segments_without_vehicles_events_or_labels_are_sound(tmp_path: Path, make, options) -> None:
    make(tmp_path / "set", segments=2, **options)
    assert list(verify(tmp_path / "set")) == []


def test_the_manifest_counts_what_there_is(tmp_path: Path, make) -> None:
    manifest = make(tmp_path / "set", segments=3)
    assert manifest == read_json(tmp_path / "set" / "manifest.json")
    assert manifest["segments"] == 3
    assert manifest["totals"]["frames"] == 12
    assert manifest["totals"]["events"] == 12 * 30
    assert manifest["totals"]["boxes"] == 12 * 2
    assert manifest["totals"]["ignored"] == 12  # of the two vehicles, one is hidden
    assert sorted(name for names in manifest["splits"].values() for name in names) == [
        "000000",
        "000001",
        "000002",
    ]
    for split, names in manifest["splits"].items():
        assert (tmp_path / "set" / f"{split}.txt").read_text().split() == [f"segments/{n}" for n in names]


def test_settings_calibration_and_scenario_are_yaml(tmp_path: Path, rectangles) -> None:
    record_dataset(partial(rectangles), tmp_path / "set", Protocol(1), scenario_yaml="light: {}\n")
    settings, camera, scenario = (
        yaml.safe_load((tmp_path / "set" / f"{name}.yaml").read_text())
        for name in ("settings", "camera", "scenario")
    )
    assert settings["source"] == rectangles().settings()
    assert camera == rectangles().calibration()
    assert scenario == {"light": {}}


def test_progress_counts_every_frame_once(tmp_path: Path, rectangles) -> None:
    for workers in (1, 2):
        seen: list[int] = []
        record_dataset(
            partial(rectangles),
            tmp_path / f"{workers}",
            Protocol(3),
            workers=workers,
            on_frames=seen.append,
        )
        assert sum(seen) == 12


def test_a_source_that_breaks_the_order_of_time_is_refused(tmp_path: Path, rectangles) -> None:
    class Backwards(rectangles):
        def segment(self, index):
            yield from reversed(list(super().segment(index)))

    with pytest.raises(DataError, match="segment 000000: "):
        record_dataset(Backwards, tmp_path / "set", Protocol(1))
    assert list((tmp_path / "set" / "segments").iterdir()) == []


def test_a_source_that_cannot_begin_leaves_no_folder(tmp_path: Path, rectangles) -> None:
    class Absent(rectangles):
        def calibration(self):
            raise DataError("no server")

    with pytest.raises(DataError, match="no server"):
        record_dataset(Absent, tmp_path / "set", Protocol(1))
    assert not (tmp_path / "set").exists()


def test_a_disk_that_fills_up_ends_the_set_in_one_line_and_room_lets_it_go_on(
    tmp_path: Path, make, monkeypatch
) -> None:
    make(tmp_path / "whole", segments=2)
    real, looks = shutil.disk_usage, []

    def filling(path: Path) -> object:
        looks.append(path)
        # Room at the start and for the first frames, then none.
        return real(path) if len(looks) < 6 else Usage(0, 0, 1000)

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "disk_usage", filling)
        with pytest.raises(DataError, match="the disk is full; what is done is kept"):
            make(tmp_path / "set", segments=2)
    assert not list((tmp_path / "set").glob("segments/*.partial"))
    make(tmp_path / "set", segments=2)
    files = {p.relative_to(tmp_path / "whole") for p in (tmp_path / "whole").rglob("*") if p.is_file()}
    assert files == {p.relative_to(tmp_path / "set") for p in (tmp_path / "set").rglob("*") if p.is_file()}
    assert all((tmp_path / "set" / f).read_bytes() == (tmp_path / "whole" / f).read_bytes() for f in files)
