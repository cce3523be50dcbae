"""Every command, as a user runs it: help, exit codes, one line for an error, pipes."""

from __future__ import annotations

import shlex
import subprocess
import sys

import pytest

from jeat_graph.cli.examples import EXAMPLES, GROUPS
from jeat_graph.cli.main import COMMANDS, build_parser, main


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_explains_itself(command, capsys):
    with pytest.raises(SystemExit) as end:
        main([command, "--help"])
    assert end.value.code == 0
    assert f"usage: jeat-graph {command}" in capsys.readouterr().out


def test_the_overview_lists_every_command(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    assert end.value.code == 0
    out = capsys.readouterr().out
    assert all(command in out for command in COMMANDS)
    shown = [line.strip() for line in out.splitlines() if line.strip()]
    for first, title in GROUPS.items():
        assert shown[shown.index(f"{title}:") + 1].split()[0] == first


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_each_command_has_an_example_that_it_takes(command, capsys):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    shown = " ".join(capsys.readouterr().out.partition("example: ")[2].split())
    assert shown == EXAMPLES[command]
    program, *arguments = shlex.split(shown.partition(" < ")[0])
    assert program == "jeat-graph"
    assert build_parser(command).parse_args(arguments).command == command


@pytest.mark.parametrize(
    "arguments",
    [
        ["track", "nothing.csv", "--out", "run"],
        ["track", "rgb=nothing.csv", "--out", "run"],
        ["simulate", "dawn", "--out", "run"],
        ["simulate", "night", "--out", "run", "--duration", "-1"],
        ["eval", "nothing", "--gt", "nothing.csv"],
        ["demo", "--scenario", "dawn", "--out", "run"],
        ["demo", "--duration", "0", "--out", "run"],
        ["demo", "--config", "nothing.yaml", "--out", "run"],
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(arguments, fails, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert fails(*arguments).startswith(f"jeat-graph {arguments[0]}: ")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments", [[], ["trak"], ["track"], ["track", "x.csv", "--out", "y", "--rate", "0"]]
)
def test_wrong_usage_exits_with_2(arguments, capsys):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert "usage" in capsys.readouterr().err


def test_a_process_shows_no_progress_bar_and_no_traceback_in_a_pipe(recording, tmp_path, call):
    good = call("track", recording / "detections.csv", "--out", tmp_path / "run")
    assert good.returncode == 0
    assert good.stdout.endswith(f"wrote {tmp_path / 'run'}\n")
    assert "%|" not in good.stderr
    bad = call("track", tmp_path / "missing.csv", "--out", tmp_path / "other")
    assert bad.returncode == 2
    assert bad.stderr.count("\n") == 1
    assert bad.stderr.endswith("missing.csv: no such file\n")


def test_a_reader_that_leaves_early_is_no_error(recording, tmp_path, start):
    run = ["--smoother", "none", "--out", str(tmp_path / "run")]
    assert main(["track", str(recording / "detections.csv"), *run]) == 0
    process = start("eval", tmp_path / "run", "--gt", recording / "gt.csv")
    process.stdout.close()
    assert process.stderr.read() == b""
    assert process.wait() == 0


@pytest.mark.parametrize("module", ["jeat_graph", "jeat_graph.cli.main"])
def test_importing_the_package_is_light(module):
    heavy = "{'numba', 'gtsam', 'matplotlib', 'pyarrow'}"
    code = f"import sys, {module}; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
