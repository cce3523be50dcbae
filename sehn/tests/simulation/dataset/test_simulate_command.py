"""`simulate` as a user calls it: pictures, the check, and what does not go together."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import pytest
import yaml

from jeat_graph.cli.main import main
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph.io.media.video import open_frames
from jeat_graph.io.tables.sensor_columns import declared_by
from jeat_graph_sehn.simulation import compiling
from jeat_graph_sehn.simulation.dataset.manifest import read_json
from jeat_graph_sehn.simulation.scenario import load_scenario

SMALL = ("--sensors", "pictures", "--frames", "3", "--size", "64x48", "--workers", "1")


@pytest.fixture(scope="module")
def pictures(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("sim") / "set"
    assert main(["simulate", "night", "--out", str(out), "--segments", "2", "--seed", "3", *SMALL]) == 0
    return out


def test_the_set_has_the_segments_frames_and_size_asked_for(pictures: Path) -> None:
    manifest = read_json(pictures / "manifest.json")
    assert manifest["segments"] == 2
    assert manifest["totals"]["frames"] == 6
    with open_frames(pictures / "segments" / "000000") as frames:
        assert frames.size_px == (64, 48)
        assert len(frames) == 3
    with EventFile(pictures / "segments" / "000000" / "events.h5") as events:
        assert events.size_px == (64, 48)


def test_who_waits_for_the_renderer_to_be_compiled_is_told(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.setattr(compiling, "is_compiled", lambda _: False)
    arguments = ["--segments", "1", "--seed", "3", *SMALL]
    assert main(["simulate", "night", "--out", str(tmp_path / "set"), *arguments]) == 0
    assert "jeat-graph simulate: compiling the renderer for this machine, once" in capsys.readouterr().err


@pytest.mark.parametrize("sensors", ["rgb", "events", "pictures"])
def test_who_rendered_before_is_not_told_to_wait_again(tmp_path: Path, capsys, sensors) -> None:
    arguments = ["--segments", "1", "--seed", "3", *SMALL]
    arguments[arguments.index("--sensors") + 1] = sensors
    for again in ("first", "second"):
        assert main(["simulate", "night", "--out", str(tmp_path / again), *arguments]) == 0
        told = capsys.readouterr().err
    assert "compiling the renderer" not in told


def test_the_scenario_beside_it_can_be_simulated_again(pictures: Path) -> None:
    assert load_scenario(pictures / "scenario.yaml") == load_scenario("night")


def test_a_sound_set_verifies_with_exit_code_0(pictures: Path, capsys) -> None:
    assert main(["simulate", "--verify", str(pictures)]) == 0
    assert "all as they should be" in capsys.readouterr().out


def test_a_damaged_set_verifies_with_exit_code_1_and_a_line_for_each_problem(
    tmp_path: Path, make, capsys
) -> None:
    make(tmp_path / "set", segments=1)
    (tmp_path / "set" / "train.txt").unlink()
    (tmp_path / "set" / "segments" / "000000" / "boxes.npy").write_bytes(b"")
    assert main(["simulate", "--verify", str(tmp_path / "set")]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2
    assert "changed" in lines[0]
    assert lines[1].endswith("train.txt: missing")


def test_masks_are_written_beside_the_frames_and_belong_to_the_set(tmp_path: Path) -> None:
    out, arguments = tmp_path / "set", ["--segments", "1", "--seed", "3", "--masks", *SMALL]
    assert main(["simulate", "day", "--out", str(out), *arguments]) == 0
    folder = out / "segments" / "000000"
    assert [path.name for path in sorted((folder / "masks").iterdir())] == [f"{k:06d}.png" for k in range(3)]
    mask = cv2.imread(str(folder / "masks" / "000000.png"), cv2.IMREAD_UNCHANGED)
    assert (mask.shape, str(mask.dtype)) == ((48, 64), "uint16")
    assert mask.max() > 0
    assert main(["simulate", "--verify", str(out)]) == 0
    (folder / "masks" / "000001.png").unlink()
    assert main(["simulate", "--verify", str(out)]) == 1


def test_settings_of_renderer_and_cameras_come_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "imaging.yaml").write_text("render: {width: 48, height: 32}\nevt: {leak_rate_hz: 0}\n")
    arguments = ["--sensors", "pictures", "--frames", "1", "--imaging", str(tmp_path / "imaging.yaml")]
    assert main(["simulate", "day", "--out", str(tmp_path / "set"), *arguments]) == 0
    settings = yaml.safe_load((tmp_path / "set" / "settings.yaml").read_text())["source"]["imaging"]
    assert (settings["render"]["width"], settings["render"]["height"]) == (48, 32)
    assert settings["evt"]["leak_rate_hz"] == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["night"], "SCENARIO and --out DIR are needed"),
        (["--out", "set"], "SCENARIO and --out DIR are needed"),
        (["night", "--out", "set", "--verify", "set"], "--verify DIR stands alone"),
        (["--verify", "nothing"], "nothing: no such folder"),
        (["night", "--out", "set", "--segments", "3"], "--segments does not go with --sensors detections"),
        (["night", "--out", "set", *SMALL, "--duration", "3"], "--duration does not go with"),
        (["night", "--out", "set", *SMALL, "--carla-port", "3"], "--carla-port does not go with"),
        (["night", "--out", "set", *SMALL, "--imaging", "none.yaml"], "none.yaml: no such file"),
        (["night", "--out", "set", *SMALL, "--split", "0:0:0"], "split: "),
        (["night", "--out", "set", *SMALL, "--seed", "-1"], "seed: must not be negative"),
        (["nigth", "--out", "set", *SMALL], "did you mean night"),
    ],
)
def test_a_bad_call_is_one_line_and_writes_nothing(
    arguments, words, tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments", [["--size", "64"], ["--size", "63x48"], ["--split", "1:2"], ["--segments", "0"]]
)
def test_a_badly_written_argument_is_a_usage_error(arguments, capsys) -> None:
    with pytest.raises(SystemExit) as end:
        main(["simulate", "night", "--out", "set", "--sensors", "pictures", *arguments])
    assert end.value.code == 2
    assert "usage" in capsys.readouterr().err


def test_carla_without_its_client_package_is_one_line(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.setitem(sys.modules, "carla", None)
    assert main(["simulate", "night", "--out", str(tmp_path / "set"), "--sensors", "carla"]) == 2
    assert "pip install './sehn[carla]'" in capsys.readouterr().err
    assert not (tmp_path / "set").exists()


def test_detections_say_which_sensor_is_an_event_camera(tmp_path: Path) -> None:
    out = tmp_path / "set"
    assert main(["simulate", "night-nolight", "--out", str(out), "--duration", "0.5", "--seed", "3"]) == 0
    assert declared_by(out / "detections.csv") == {"evt": {"kind": "event"}, "rgb": {"kind": "camera"}}
