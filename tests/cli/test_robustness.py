"""Whatever the machine does to a command: one line, and nothing half written or left behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from jeat_graph.cli import main as entry
from jeat_graph.cli.terminal import describe, in_good_order, one_line, say, warn
from jeat_graph.data.errors import DataError

from .conftest import HEADER, as_user

ROWS = "".join(f"{k * 0.05:.2f},rgb,{100 + 2 * k},200,40,30,0.95\n" for k in range(10))
posix = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")


def start(*arguments: object, **options) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "jeat_graph.cli.main", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def test_what_a_terminal_would_obey_is_written_out():
    assert one_line("a\x1b[2J\nb\u202e\tc é") == "a\\x1b[2J b\\u202e c é"


def test_a_full_disk_and_too_little_memory_have_words():
    assert "the disk is full, writing x.csv" in describe(OSError(28, "No space left on device", "x.csv"))
    assert describe(MemoryError()) == "not enough memory"


def test_too_little_memory_is_one_line(monkeypatch, capsys, tmp_path):
    def out_of_memory(args: object) -> int:
        raise MemoryError("Unable to allocate 7 TiB")

    monkeypatch.setattr("jeat_graph.cli.track_command.run", out_of_memory)
    assert entry.main(["track", "d.csv", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == "jeat-graph track: not enough memory: Unable to allocate 7 TiB\n"


def test_what_a_command_tells_is_one_line_that_no_terminal_obeys(capsys):
    say("track", "run\x1b[2J\nnight: odd")
    warn("track", "night\nodd")
    assert capsys.readouterr().err == (
        "jeat-graph track: run\\x1b[2J night: odd\njeat-graph track: warning: night odd\n"
    )


def test_a_warning_is_one_line_with_the_command_s_name(capsys):
    import warnings

    with in_good_order("report"):
        warnings.warn("this\nand that", stacklevel=1)
    assert capsys.readouterr().err == "jeat-graph report: warning: this and that\n"


def test_an_error_without_a_signal_stays_what_it_is():
    with pytest.raises(ZeroDivisionError), in_good_order("track"):
        raise ZeroDivisionError


def test_a_sensor_s_name_does_not_reach_the_terminal_as_it_is(tmp_path, fails):
    path = tmp_path / "d.csv"
    path.write_text(HEADER + "0,r\x1b[2Jgb,1,2,3,4,.5\n", encoding="utf-8")
    assert "\x1b" not in fails("track", path, "--out", tmp_path / "run")


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="file names there are text")
def test_names_that_are_not_utf8_and_a_terminal_of_ascii_do_not_lose_a_run(tmp_path):
    path = os.path.join(os.fsencode(tmp_path), b"caf\xe9-\xc3\xa4.csv")
    with open(path, "w", encoding="utf-8") as file:
        file.write(HEADER + ROWS)
    name = os.fsdecode(path)
    done = as_user(
        *("track", name, "--out", os.fsdecode(os.path.join(os.fsencode(tmp_path), b"r\xe9"))),
        *("--smoother", "none"),
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    record = json.loads(
        Path(os.fsdecode(os.path.join(os.fsencode(tmp_path), b"r\xe9", b"run.json"))).read_bytes()
    )
    assert record["inputs"][0]["path"] == name


@posix
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_workers_end_with_their_parent(tmp_path, number):
    process = start(
        *("simulate", "night", "--sensors", "pictures", "--segments", 4, "--frames", 400, "--workers", 2),
        *("--size", "64x48", "--out", tmp_path / "set"),
    )
    try:
        deadline = time.monotonic() + 100
        while len(family(process.pid)) < 2 and time.monotonic() < deadline:
            time.sleep(0.1)
        children = family(process.pid)
        assert len(children) >= 2
        process.send_signal(number)
        process.wait(60)
        if number == signal.SIGTERM:
            assert process.returncode == 128 + number
        deadline = time.monotonic() + 60
        while any(map(alive, children)) and time.monotonic() < deadline:
            time.sleep(0.1)
        assert not any(map(alive, children))
    finally:
        process.kill()
        process.communicate()


def family(parent: int) -> list[int]:
    """Processes that `parent` has started, without the one that watches over shared memory."""
    children = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            after = (place / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
            command = (place / "cmdline").read_bytes()
        except OSError:
            continue
        if int(after[1]) == parent and b"spawn_main" in command:
            children.append(int(place.name))
    return children


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def test_a_folder_that_cannot_be_written_is_noticed_before_the_work(tmp_path, monkeypatch):
    from jeat_graph.io.files.atomic import check_writable

    def refuse(*args: object, **options: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("jeat_graph.io.files.atomic.tempfile.TemporaryFile", refuse)
    with pytest.raises(DataError, match="cannot be written: Permission denied"):
        check_writable(tmp_path / "deep" / "er" / "config.yaml")
    assert list(tmp_path.iterdir()) == []
