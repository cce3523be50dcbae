"""Named pipes: nobody reads yet, reads slowly, goes, or never comes; nothing of it waits for good."""

from __future__ import annotations

import os
import threading
import time

import pytest

from jeat_graph.data.errors import InputWarning
from jeat_graph.io.files import pipe_writer
from jeat_graph.io.files.growing import GrowingFile
from jeat_graph.io.files.pipe_writer import PipeWriter

pytestmark = pytest.mark.skipif(os.name == "nt", reason="named pipes are of POSIX")
LINE = b"0123456789abcde\n"


@pytest.fixture
def pipe(tmp_path):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    return path


def read_all(path):
    with path.open("rb") as file:
        return file.read()


def test_what_is_written_before_a_reader_comes_is_kept_for_him(pipe):
    with pytest.warns(InputWarning, match="pipe: nobody reads it yet"):
        file = GrowingFile(pipe)
    file.begin(b"head\n")
    file.write(LINE)
    got = []
    reader = threading.Thread(target=lambda: got.append(read_all(pipe)))
    reader.start()
    file.write(LINE)
    file.close()
    reader.join(10)
    assert got == [b"head\n" + 2 * LINE]


def test_without_a_reader_what_is_kept_is_bounded_and_what_is_lost_is_said(pipe, monkeypatch):
    monkeypatch.setattr(pipe_writer, "_LAST_WAIT_S", 0.0)

    def unread():
        writer = PipeWriter(pipe, most=5 * len(LINE))
        for _ in range(8):
            writer.write(LINE)
        writer.close()

    with pytest.warns(InputWarning) as said:
        unread()
    texts = [str(one.message) for one in said]
    assert len(texts) == 3
    assert "the oldest lines, beyond 80 bytes, go" in texts[1]
    assert "nobody has read the last 80 bytes: they are lost" in texts[2]


def test_a_slow_reader_is_waited_for_until_the_program_is_to_end(pipe):
    over = threading.Event()
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    writer = PipeWriter(pipe, over.is_set)
    timer = threading.Timer(0.3, over.set)
    timer.start()
    begin = time.monotonic()
    writer.write(LINE * 20_000)  # more than a pipe holds
    assert 0.25 < time.monotonic() - begin < 5.0
    with pytest.warns(InputWarning, match="nobody has read the last"):
        writer.close()
    os.close(reader)


def test_one_reader_may_follow_another(pipe):
    first = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    writer = PipeWriter(pipe)
    writer.write(b"a\n")
    assert os.read(first, 10) == b"a\n"
    os.close(first)
    with pytest.warns(InputWarning, match="its reader has gone"):
        writer.write(b"b\n")
    writer.write(b"c\n")
    second = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    writer.close()
    assert os.read(second, 10) == b"c\n"
    os.close(second)
