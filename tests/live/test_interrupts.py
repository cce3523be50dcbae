"""Signals while lines are read: none is lost, and none more is waited for; files, pipes and terminals."""

from __future__ import annotations

import io
import os
import pty
import signal
import threading
import time
from contextlib import contextmanager

from jeat_graph.live.interrupts import GRACE_S, Interrupts

PATIENCE_S = 60.0


@contextmanager
def a_pipe():
    """A pipe: what reads from it, as a stream, and the number of what writes."""
    read, write = os.pipe()
    with os.fdopen(read, "rb") as stream:
        try:
            yield stream, write
        finally:
            os.close(write)


@contextmanager
def after(seconds, do):
    """Have something done meanwhile."""
    timer = threading.Timer(seconds, do)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


def terminate():
    os.kill(os.getpid(), signal.SIGTERM)


def test_a_signal_ends_the_wait_for_a_line_at_once():
    with a_pipe() as (stream, write), Interrupts() as interrupts:
        os.write(write, b"a\n")
        with after(0.2, terminate), after(PATIENCE_S, lambda: os.write(write, b"late\n")):
            begin = time.monotonic()
            assert list(interrupts.lines(stream)) == [b"a\n"]
        assert time.monotonic() - begin < PATIENCE_S / 2
        assert interrupts.seen == signal.SIGTERM


def test_a_signal_whose_handler_has_not_run_yet_when_the_wait_begins_ends_it_too():
    """The wait begins between the system's taking down the signal and the handler's run."""
    with a_pipe() as (stream, write), Interrupts() as interrupts:
        terminate()
        assert interrupts.seen == signal.SIGTERM
        interrupts.seen = None  # as if it had not
        with after(PATIENCE_S, lambda: os.write(write, b"late\n")):
            begin = time.monotonic()
            assert list(interrupts.lines(stream)) == []
        assert time.monotonic() - begin < PATIENCE_S / 2
        assert interrupts.seen == signal.SIGTERM


def first_of(stream, write, text, interrupts):
    """The first line of a text and those behind it, which are asked for after a signal."""
    os.write(write, text)
    lines = interrupts.lines(stream)
    first = next(lines)
    terminate()
    return first, lines


def test_lines_that_were_read_before_the_signal_are_given_out_and_none_behind_them_is_taken():
    with a_pipe() as (stream, write), Interrupts() as interrupts:
        first, lines = first_of(stream, write, b"a\nb\nc\n", interrupts)
        os.write(write, b"d\n")
        assert [first, *lines] == [b"a\n", b"b\n", b"c\n"]
        assert os.read(stream.fileno(), 100) == b"d\n"


def test_a_line_that_was_begun_is_read_to_its_end_and_no_further():
    with a_pipe() as (stream, write), Interrupts() as interrupts:
        first, lines = first_of(stream, write, b"a\nbeg", interrupts)
        with after(0.2 * GRACE_S, lambda: os.write(write, b"un\nnext\n")):
            got = [first, *lines]
        assert got == [b"a\n", b"begun\n"]
        assert os.read(stream.fileno(), 100) == b"next\n"


def test_the_end_of_a_line_that_never_comes_is_waited_for_a_moment_only():
    with a_pipe() as (stream, write), Interrupts() as interrupts:
        first, lines = first_of(stream, write, b"a\nbeg", interrupts)
        begin = time.monotonic()
        assert [first, *lines] == [b"a\n"]
        assert time.monotonic() - begin < GRACE_S + 1.0


def test_every_line_is_taken_once_whenever_the_signal_comes():
    """A writer that never rests; what one reader leaves, the next one finds."""
    total, width = 400, 700
    with a_pipe() as (stream, write):
        text = b"".join(b"%06d".ljust(width, b".") % k + b"\n" for k in range(total))

        def send() -> None:
            sent = 0
            while sent < len(text):  # a signal may cut a write short
                sent += os.write(write, text[sent:])

        writer = threading.Thread(target=send)
        writer.start()
        got: list[bytes] = []
        while len(got) < total:
            with Interrupts() as interrupts:
                for line in interrupts.lines(stream):
                    got.append(line)
                    if len(got) % 37 == 5:
                        terminate()
                    if len(got) == total:
                        break
        writer.join()
    assert b"".join(got) == text


def test_a_file_and_an_object_in_memory_are_read_to_their_ends(tmp_path):
    text = b"a\n\n" + 100_000 * b"b" + b"\nno end"
    (tmp_path / "lines").write_bytes(text)
    with (tmp_path / "lines").open("rb") as stream, Interrupts() as interrupts:
        assert list(interrupts.lines(stream)) == text.splitlines(keepends=True)
        assert list(interrupts.lines(io.BytesIO(text))) == text.splitlines(keepends=True)


def test_lines_of_a_terminal_are_given_out_as_they_are_typed_until_the_signal():
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "rb", buffering=0) as stream, Interrupts() as interrupts:
        lines = interrupts.lines(stream)
        os.write(ours, b"a\n")
        assert next(lines) == b"a\n"
        with after(0.2, terminate):
            assert list(lines) == []
    os.close(ours)


def test_a_line_that_is_too_long_is_read_in_bounded_memory_from_a_pipe_too(monkeypatch):
    most = 1000
    monkeypatch.setattr("jeat_graph.io.streams.stream_text.LONGEST_LINE", most)
    monkeypatch.setattr("jeat_graph.io.streams.stream_text._REST", 64)
    with a_pipe() as (stream, write), Interrupts() as interrupts:
        os.write(write, b"a\n" + 30_000 * b"b" + b"\nc\n")
        lines = interrupts.lines(stream)
        assert [next(lines) for _ in range(3)] == [b"a\n", (most + 1) * b"b", b"c\n"]


def test_other_signals_and_handlers_are_left_as_they_were():
    before = signal.signal(signal.SIGUSR1, lambda *_: came.append(1))
    came: list[int] = []
    handlers = [signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM)]
    try:
        with a_pipe() as (stream, write), Interrupts() as interrupts:
            lines = interrupts.lines(stream)
            told = after(0.2, lambda: os.kill(os.getpid(), signal.SIGUSR1))
            with told, after(0.5, lambda: os.write(write, b"a\n")):
                assert next(lines) == b"a\n"
            assert interrupts.seen is None
        assert came == [1]
        assert [signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM)] == handlers
        assert signal.set_wakeup_fd(-1) == -1
    finally:
        signal.signal(signal.SIGUSR1, before)


def test_in_another_thread_interrupts_stay_what_they_are():
    got: list[bytes] = []

    def read() -> None:
        with a_pipe() as (stream, write), Interrupts() as interrupts:
            os.write(write, b"a\n")
            got.append(next(interrupts.lines(stream)))

    thread = threading.Thread(target=read)
    thread.start()
    thread.join(PATIENCE_S)
    assert got == [b"a\n"]
