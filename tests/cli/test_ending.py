"""How the process of a command ends: its code, what is written and put off, and that nothing aborts it."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

_SCRIPT = """
import atexit, sys, threading, time
from jeat_graph.cli.ending import end_with
atexit.register(lambda: print("put off"))
def main():
    threading.Thread(target=lambda: (time.sleep(.1), print("thread"))).start()
    print("main")
    {body}
end_with(main)
"""


@pytest.mark.parametrize(
    ("body", "code", "said"),
    [
        ("return 0", 0, ""),
        ("return 143", 143, ""),
        ("sys.exit()", 0, ""),
        ("sys.exit(2)", 2, ""),
        ("sys.exit('what is wrong')", 1, "what is wrong\n"),
        ("raise ValueError('unexpected')", 1, "ValueError: unexpected\n"),
    ],
)
def test_code_and_output_are_those_of_any_program_of_python(body, code, said):
    ended = subprocess.run(
        [sys.executable, "-c", _SCRIPT.format(body=body)], capture_output=True, text=True, timeout=60
    )
    assert ended.returncode == code
    assert ended.stdout == "main\nthread\nput off\n"
    assert ended.stderr.endswith(said)
    assert bool(said) == bool(ended.stderr)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a device that is full")
def test_output_that_cannot_be_written_at_the_end_is_noticed():
    script = "from jeat_graph.cli.ending import end_with; end_with(lambda: print('x') or 0)"
    env = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}
    with open("/dev/full", "w", encoding="utf-8") as full:
        ended = subprocess.run([sys.executable, "-c", script], stdout=full, env=env, timeout=60)
    assert ended.returncode == 120


ERRORS = {
    "twice": (["eval", "res.txt", "--gt", "gt.txt", "--rate", "25"], "track 1 is there twice"),
    "track": (["track", "res.txt", "--rate", "25", "--out", "res.txt"], "res.txt"),
    "no file": (["track", "none.csv", "--out", "run"], "none.csv"),
    "usage": (["count", "--nonsense"], "usage"),
}


def ends(folder, arguments):
    command = [sys.executable, "-m", "jeat_graph", *arguments]
    ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    return ended.returncode, ended.stderr


@pytest.mark.parametrize("times", [2, pytest.param(100, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ERRORS)
def test_no_command_that_says_what_is_wrong_aborts_however_busy_the_machine(name, times, tmp_path):
    arguments, said = ERRORS[name]
    rows = [f"{k},1,{100 + k},100,50,40,1,-1,-1,-1" for k in range(1, 11)]
    (tmp_path / "gt.txt").write_text("\n".join(rows) + "\n")
    (tmp_path / "res.txt").write_text("\n".join([*rows, rows[3]]) + "\n")
    # More at a time than there are cores: threads then start late.
    with ThreadPoolExecutor(4 * (os.cpu_count() or 1) if times > 2 else 2) as pool:
        found = list(pool.map(lambda _: ends(tmp_path, arguments), range(times)))
    assert {code for code, _ in found} == {2}
    assert all(said in text for _, text in found)
