"""A command killed at any moment leaves nothing half written, and the next one takes away what it left.

The short form kills at chosen changes to files (`dying/sitecustomize.py`), so it depends on no clock. The
long form takes all commands, kills them at changes to files and at random moments, with all three signals.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import yaml

from .commands_to_kill import COMMANDS, MAY_GROW, WRITTEN_AGAIN

FULL = bool(os.environ.get("JEAT_GRAPH_FULL"))
#: Kills of each command in the long form; half of them at changes to files.
KILLS = int(os.environ.get("JEAT_GRAPH_KILLS", "30"))
SEED = 11
PATIENCE_S = 600.0
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")


class Killed(NamedTuple):
    """What a killed command left: its status, what it said, its files under final names, and the others."""

    status: int
    said: str
    files: dict[str, bytes]
    hidden: list[str]


class Command:
    """A command with its inputs, to be run into any folder.

    Args:
        name: one of `COMMANDS`.
        places: what stands for the names in braces.
        begin: what starts it, as `start` does.
        dying: the fixture of that name.
    """

    def __init__(self, name: str, places: dict[str, Path], begin, dying) -> None:
        self._texts, self._places, self._begin, self._dying = COMMANDS[name], places, begin, dying
        self._rows = (places["recording"] / "detections.csv").read_bytes() if name == "stream" else b""

    def start(self, out: Path, **fate: object):
        """Start it, to die at a change to files if so wished."""
        out.mkdir(exist_ok=True)
        arguments = [text.format(out=out, **self._places) for text in self._texts]
        rows = out.parent / "rows"
        rows.write_bytes(self._rows)
        return self._begin(*arguments, stdin=rows, env=self._dying(out, **fate))

    def run(self, out: Path, **fate: object) -> Killed:
        """Run it to its end, whatever that is."""
        return ended(self.start(out, **fate), out)


def as_a_user(*arguments: str, stdin: Path, env: dict[str, str]) -> subprocess.Popen[bytes]:
    """Start it from nothing: what is killed at random moments may be killed while it is being loaded."""
    program = ["benchmarks"] if arguments[0] == "benchmarks" else ["jeat_graph.cli.main", arguments[0]]
    with stdin.open("rb") as rows:
        return subprocess.Popen(
            [sys.executable, "-m", *program, *arguments[1:]],
            **{"stdin": rows, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE},
            env=env,
            preexec_fn=heed_interrupts,
        )


def heed_interrupts() -> None:
    """A shell lets what it starts in the background ignore Ctrl-C, and so would all that is started here."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def ended(process, out: Path) -> Killed:
    said = process.communicate(timeout=PATIENCE_S)[1].decode()
    found = {str(p.relative_to(out)): p.read_bytes() for p in sorted(out.rglob("*")) if p.is_file()}
    hidden = [name for name in found if any(part.startswith(".") for part in Path(name).parts)]
    files = {name: data for name, data in found.items() if name not in hidden}
    return Killed(process.returncode, said, files, [name for name in hidden if not name.endswith(".lock")])


def is_whole(name: str, data: bytes) -> bool:
    """Whether a file whose bytes differ from run to run, for the times in it, is all there."""
    kind = Path(name).suffix
    if kind == ".json":
        json.loads(data)
    elif kind == ".yaml":
        return isinstance(yaml.safe_load(data), dict)
    elif kind == ".csv":
        return len({line.count(b",") for line in data.splitlines()}) == 1 and data.endswith(b"\n")
    elif kind == ".html":
        return data.rstrip().endswith(b"</html>")
    else:
        return data[:4] == b"PK\x03\x04" and b"PK\x05\x06" in data[-200:]  # a checkpoint
    return True


@pytest.fixture(scope="module")
def places(tmp_path_factory) -> dict[str, Path]:
    """Inputs of all commands: some rows of detections; in the long form recordings and a run."""
    folder = tmp_path_factory.mktemp("inputs")
    names = {name: folder / name for name in ("recording", "run", "manifest")}
    if FULL:
        call("simulate", "night", "--duration", "2", "--out", names["recording"])
        call("track", names["recording"] / "detections.csv", "--out", names["run"])
        rows = "".join(f"r{k},{names['recording'] / 'detections.csv'}\n" for k in range(2))
        names["manifest"].write_text("name,detections\n" + rows)
    else:
        names["recording"].mkdir()
        rows = "".join(f"{k * 0.05:.2f},rgb,{100 + 2 * k},200,40,30,0.95\n" for k in range(60))
        (names["recording"] / "detections.csv").write_text("t,sensor,left,top,width,height,score\n" + rows)
    return names


@pytest.fixture(scope="module")
def pictures(tmp_path_factory) -> Path:
    """A simulated set of pictures and events."""
    folder = tmp_path_factory.mktemp("pictures")
    small = ("--segments", "1", "--frames", "20", "--size", "160x96", "--workers", "1")
    call("simulate", "night", "--sensors", "pictures", *small, "--out", folder)
    return folder


def call(*arguments: object) -> None:
    command = [sys.executable, "-m", "jeat_graph.cli.main", *map(str, arguments)]
    subprocess.run(command, check=True, capture_output=True)


def check(left: Killed, whole: dict[str, bytes], number: int, varying: set[str], before: list[str]) -> None:
    """All that is there under a final name is whole, and who was asked to end has tidied up.

    Args:
        left: what is there.
        whole: what should be, in the end.
        number: the signal.
        varying: files that differ from run to run.
        before: hidden files that an earlier one left, which was not asked.
    """
    for name, data in left.files.items():
        if Path(name).name in MAY_GROW:
            continue
        assert name in whole, f"{name} is of no run"
        other = name in varying or Path(name).name in WRITTEN_AGAIN
        assert data == whole[name] or (other and is_whole(name, data)), f"{name} is not whole"
    if number == signal.SIGTERM and left.status:
        assert "Traceback" not in left.said, left.said
        # The latter while Python itself starts; and a worker that was struck does not end the command.
        assert left.status in (128 + number, -number) or "the worker process died" in left.said
        assert not set(left.hidden) - set(before) or left.status < 0


def test_a_run_killed_while_it_writes_leaves_the_earlier_one_and_can_be_repeated(
    places, tmp_path, start, dying
):
    command, log = Command("track-causal", places, start, dying), tmp_path / "log"
    whole = command.run(tmp_path / "out", log=log)
    assert whole.status == 0, whole.said
    changes = log.read_text().splitlines()
    run = {name: data for name, data in whole.files.items() if not name.endswith("run.json")}
    last = len(changes)
    first_rename = next(k for k, line in enumerate(changes, 1) if line.startswith("os.rename"))
    for at, number in ((first_rename, signal.SIGTERM), (last // 2, signal.SIGKILL)):
        left = command.run(tmp_path / "out", at=at, by=number)
        assert left.status in (-number, 128 + number)
        check(left, whole.files, number, {"run/run.json"}, [])
        assert {name: left.files.get(name) for name in run} == run
    after = command.run(tmp_path / "out")
    assert (after.status, after.hidden, after.files.keys()) == (0, [], whole.files.keys())
    assert {name: after.files[name] for name in run} == run


def moments(changes: int, takes_s: float) -> Iterator[tuple[dict[str, object], float | None]]:
    """When to kill: the fate of one at a change to files, or how long to wait (s), in turn."""
    rng = np.random.default_rng(SEED)
    for at in np.unique(np.linspace(1, changes, max(KILLS // 2, 1)).round().astype(int)).tolist():
        yield {"at": at}, None
    for _ in range(KILLS - KILLS // 2):
        yield {}, float(rng.uniform(0.2, 1.0)) * takes_s


@pytest.mark.skipif(not FULL, reason="minutes; make fuzz runs it")
@pytest.mark.parametrize("name", COMMANDS)
def test_any_command_killed_at_any_moment_leaves_whole_files_and_ends_the_same_when_repeated(
    places, tmp_path, name, dying, request
):
    if any("{pictures}" in text for text in COMMANDS[name]):
        places = {**places, "pictures": request.getfixturevalue("pictures")}
    command, log = Command(name, places, as_a_user, dying), tmp_path / "log"
    begin = time.monotonic()
    whole = command.run(tmp_path / "whole", log=log)
    takes_s = time.monotonic() - begin
    assert whole.status == 0, whole.said
    again = command.run(tmp_path / "again")
    assert again.files.keys() == whole.files.keys()
    # With what follows from where and when a command ran; `is_whole` says what such files must be like.
    varying = {file for file in whole.files if again.files[file] != whole.files[file]}
    assert all(Path(file).suffix in (".json", ".html", ".yaml", ".npz") for file in varying), varying
    out = tmp_path / "out"
    died, hidden = 0, []
    for turn, (fate, wait_s) in enumerate(moments(len(log.read_text().splitlines()), takes_s)):
        number = SIGNALS[turn % len(SIGNALS)]
        process = command.start(out, by=number, **fate)
        if wait_s is not None:
            time.sleep(wait_s)
            process.send_signal(number)
        left = ended(process, out)
        died += left.status != 0
        check(left, whole.files, number, varying, hidden)
        hidden = left.hidden
        if left.status == 0:
            shutil.rmtree(out)  # what is finished is not made again, and so would not die
    after = command.run(out)
    assert after.status == 0, after.said
    assert (after.hidden, after.files.keys()) == ([], whole.files.keys())
    # A checkpoint also counts what came twice, as all before it does for whoever goes on.
    varying |= {file for file in whole.files if Path(file).name in WRITTEN_AGAIN}
    assert all(is_whole(file, after.files[file]) for file in varying)
    assert all(after.files[file] == whole.files[file] for file in whole.files.keys() - varying)
    assert died >= max(KILLS // 3, 1)
    print(f"{name}: killed {died} times, {len(whole.files)} files whole each time")
