"""`stream` whose readers do not read: it answers, and a signal ends it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

COMMAND = [sys.executable, "-m", "jeat_graph.cli.main", "stream"]
SCAN = '{"t": %g, "sensor": "rgb", "boxes": [[%g, 100, 80, 60]], "scores": [0.9]}\n'
pytestmark = pytest.mark.skipif(os.name == "nt", reason="named pipes are of POSIX")


@pytest.fixture
def stream():
    begun = []

    def begin(*options):
        pipe = subprocess.PIPE
        begun.append(subprocess.Popen([*COMMAND, *options], stdin=pipe, stdout=pipe, stderr=pipe))
        return begun[-1]

    yield begin
    for process in begun:
        process.kill()
        process.communicate()


def test_rows_for_a_pipe_that_nobody_reads_hold_up_neither_answers_nor_signals(stream, tmp_path):
    rows = tmp_path / "rows"
    os.mkfifo(rows)
    process = stream("--smoothed", str(rows))
    for k in range(3):
        process.stdin.write((SCAN % (k / 20, 100 + 3 * k)).encode())
        process.stdin.flush()
        assert process.stdout.readline().startswith(b'{"t":')
    process.send_signal(signal.SIGTERM)
    begin = time.monotonic()
    _, said = process.communicate(timeout=20)
    assert process.returncode == 128 + signal.SIGTERM
    assert time.monotonic() - begin < 10
    assert b"rows: nobody reads it yet" in said
    assert b"rows: nobody has read the last" in said


def test_answers_that_nobody_takes_do_not_hold_up_a_signal(stream):
    process = stream()
    process.stdin.write((SCAN % (-1, 100)).encode())
    process.stdin.flush()
    assert process.stdout.readline()  # it runs
    text = "".join(SCAN % (k / 20, 100 + 3 * (k % 300)) for k in range(20_000)).encode()
    os.set_blocking(process.stdin.fileno(), False)
    sent, still = 0, time.monotonic() + 2.0
    while sent < len(text) and time.monotonic() < still:  # until it takes no more
        try:
            sent += os.write(process.stdin.fileno(), text[sent : sent + 4096])
            still = time.monotonic() + 2.0
        except BlockingIOError:
            time.sleep(0.02)
    assert 0 < sent < len(text)
    process.send_signal(signal.SIGTERM)
    process.wait(20)
    assert process.returncode == 128 + signal.SIGTERM
    assert b"its reader has not taken all tracks" in process.stderr.read()
