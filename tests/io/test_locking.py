"""Folders that one process at a time writes into, and what killed ones left."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys

import pytest

from jeat_graph.data.errors import DataError, InputWarning
from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.io.files.locking import hold_file, hold_folder, hold_made_folder
from jeat_graph.runs.directory import RunDirectory

pytest.importorskip("fcntl")
# Begins to write and is then killed, so that nothing is tidied up.
KILLED = """
import os, signal, sys
from jeat_graph.{module} import {name}
with {call} as thing:
    {use}
    print("begun", flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


def kill_within(module: str, name: str, call: str, use: str = "pass") -> None:
    code = KILLED.format(module=module, name=name, call=call, use=use)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.stdout, done.returncode) == ("begun\n", -9), done.stderr


def test_a_second_process_is_refused_and_a_later_one_is_not(tmp_path):
    other = (
        "from jeat_graph.runs.directory import RunDirectory\nfrom jeat_graph.data.errors import DataError\n"
    )
    other += f"try:\n    with RunDirectory({str(tmp_path)!r}): print('in')\nexcept DataError as e: print(e)"
    with RunDirectory(tmp_path) as run:
        run.path("causal.csv").write_text("mine", encoding="utf-8")
        said = subprocess.run(
            [sys.executable, "-c", other], capture_output=True, text=True, check=True
        ).stdout
        assert "another command is writing here" in said
    assert (tmp_path / "causal.csv").read_text(encoding="utf-8") == "mine"
    assert (
        subprocess.run([sys.executable, "-c", other], capture_output=True, text=True, check=True).stdout
        == "in\n"
    )


def test_one_folder_is_held_once(tmp_path):
    with hold_folder(tmp_path) as held:
        assert held
        with pytest.raises(DataError, match="another command"), hold_folder(tmp_path):
            pass
    with hold_folder(tmp_path) as again:
        assert again


def test_the_next_run_takes_away_what_a_killed_one_left(tmp_path):
    (tmp_path / "notes").mkdir()
    kill_within("runs.directory", "RunDirectory", f"RunDirectory({str(tmp_path)!r})")
    assert sorted(p.name[:12] for p in tmp_path.iterdir()) == [".unfinished-", "notes"]
    with RunDirectory(tmp_path) as run:
        run.path("causal.csv").write_text("mine", encoding="utf-8")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["causal.csv", "notes"]


def test_the_next_file_takes_away_what_a_killed_process_left_of_it(tmp_path):
    path = tmp_path / "a[1].html"
    (tmp_path / ".a[1].mine.html").write_text("a user's own", encoding="utf-8")
    kill_within("io.files.atomic", "open_atomic", f"open_atomic({str(path)!r})", "thing.write('half')")
    assert len(list(tmp_path.iterdir())) == 2
    with open_atomic(path) as file:
        file.write("whole")
        with open_atomic(path) as another:  # a file being written is no leftover
            another.write("first")
    assert path.read_text(encoding="utf-8") == "whole"
    assert sorted(p.name for p in tmp_path.iterdir()) == [".a[1].mine.html", "a[1].html"]


def test_a_name_that_is_not_utf8_can_be_written_into_json(tmp_path):
    import json

    with open_atomic(tmp_path / "a.json") as file:
        file.write(json.dumps({"path": "caf\udce9.csv"}, ensure_ascii=False))
    assert json.loads((tmp_path / "a.json").read_bytes()) == {"path": "caf\udce9.csv"}


HOLDING = """
import sys
from jeat_graph.data.errors import DataError
from jeat_graph.io.files.locking import hold_file
try:
    with hold_file(sys.argv[1]) as held:
        print(held, flush=True)
        sys.stdin.read()
except DataError as error:
    print(error, flush=True)
"""


def holder(path):
    """Another process that holds a file until its input ends; what it said first."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDING, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    return process, process.stdout.readline().strip()


def test_one_file_is_held_by_one_process_by_whatever_name(tmp_path):
    (tmp_path / "same").symlink_to(tmp_path)
    process, said = holder(tmp_path / "a.npz")
    assert said == "True"
    for name in ("a.npz", "same/a.npz", "./a.npz"):
        with pytest.raises(DataError, match="another command is writing it"), hold_file(tmp_path / name):
            pass
    with hold_file(tmp_path / "b.npz") as held:  # a neighbour is no matter
        assert held
    process.kill()
    process.wait(timeout=60)
    assert (tmp_path / ".a.npz.lock").exists()  # what a killed one leaves holds nobody up
    with hold_file(tmp_path / "a.npz") as held:
        assert held
    assert sorted(p.name for p in tmp_path.iterdir()) == ["same"]


def test_a_folder_that_was_made_for_a_file_goes_again(tmp_path):
    with hold_file(tmp_path / "a" / "b" / "c.csv") as held:
        assert held
        assert (tmp_path / "a" / "b").is_dir()
    assert list(tmp_path.iterdir()) == []
    with hold_made_folder(tmp_path / "a" / "b"):
        (tmp_path / "a" / "b" / "c.csv").touch()
    assert (tmp_path / "a" / "b" / "c.csv").exists()


@pytest.mark.parametrize("kind", ["folder", "pipe", "link", "dangling", "garbage", "others"])
def test_what_is_in_the_way_of_a_lock_neither_holds_up_nor_crashes(kind, tmp_path):
    lock, elsewhere = tmp_path / ".a.csv.lock", tmp_path / "elsewhere"
    elsewhere.write_text("mine", encoding="utf-8")
    make = {
        "folder": lock.mkdir,
        "pipe": lambda: os.mkfifo(lock),
        "link": lambda: lock.symlink_to(elsewhere),
        "dangling": lambda: lock.symlink_to(tmp_path / "none"),
        "garbage": lambda: lock.write_bytes(bytes(range(256))),
        "others": lambda: lock.touch(0o444),
    }
    make[kind]()
    regular = kind in ("garbage", "others")
    told = contextlib.nullcontext() if regular else pytest.warns(InputWarning, match="in the way of a lock")
    with told, hold_file(tmp_path / "a.csv") as held:
        assert held is regular
    assert elsewhere.read_text(encoding="utf-8") == "mine"
    assert not (tmp_path / "none").exists()


def test_devices_and_pipes_are_not_held(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", "/dev/null"):
        with hold_file(path) as held:
            assert not held
